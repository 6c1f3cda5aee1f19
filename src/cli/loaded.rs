use std::path::{Path, PathBuf};
use std::sync::Arc;

use indicatif::ProgressBar;

use super::arguments::{Arguments, EngineArgument, ReadArguments};
use super::error::CliError;
use super::progress;
use crate::composer::{Calibration, Composition, ResolvedTask, compose_named};
use crate::graph::{
    CrossTaskCandidates, GraphProgress, MergeOptions, MergeReport, TopologicalGraph, merge,
};
use crate::inference::{EngineChoice, Model};
use crate::planner::{Plan, Planner, PlannerOptions, Terms};
use crate::rollout::{RolloutModel, RolloutOptions};
use crate::simulator::BedroomConfig;
use crate::storage::{
    GraphImages, GraphManifest, GraphTask, ReadOptions, RecordingReport, Recordings,
    ensure_same_model, load_graph, sha256_file,
};
use crate::trajectory::{ActionSpace, DemonstrationSet};

/// How far from the end of one task and the start of the next cross-task edges are looked for.
const SEAM_WINDOW_STEPS: u32 = 10;
/// Pairs elsewhere that are scored too, each two tasks and direction, so that the audit of the paper's
/// plan meets the wormholes that are there.
const SAMPLED_PAIRS: u32 = 100_000;

impl From<EngineArgument> for EngineChoice {
    fn from(argument: EngineArgument) -> Self {
        match argument {
            EngineArgument::Auto => Self::Auto,
            EngineArgument::Native => Self::Native,
            EngineArgument::Embedded => Self::Tract,
        }
    }
}

/// How graphs are merged on the command line.
pub(super) fn merge_options() -> MergeOptions {
    MergeOptions {
        candidates: CrossTaskCandidates::SeamAndSample {
            window_steps: SEAM_WINDOW_STEPS,
            pairs: SAMPLED_PAIRS,
            seed: 0,
        },
        ..MergeOptions::default()
    }
}

/// What a graph is called in errors.
pub(super) fn in_folder(folder: &Path) -> String {
    format!("the graph in {}", folder.display())
}

/// Graph folders with the graphs in them.
pub(super) struct GraphFolders {
    pub(super) graphs: Vec<TopologicalGraph>,
    pub(super) manifests: Vec<GraphManifest>,
}

impl GraphFolders {
    /// Loads graphs, and refuses those that another model built or that have no states.
    pub(super) fn load(folders: &[PathBuf], model: &Model) -> Result<Self, CliError> {
        let mut loaded = Self {
            graphs: Vec::new(),
            manifests: Vec::new(),
        };
        for folder in folders {
            let (graph, manifest) = load_graph(folder)?;
            ensure_same_model(folder, &manifest.model_digest, &model.digest())?;
            let (what, spec) = (in_folder(folder), &model.manifest().spec);
            graph.ensure_states(&what)?;
            graph.ensure_fits(&what, spec.d_max, spec.latent_dim)?;
            loaded.graphs.push(graph);
            loaded.manifests.push(manifest);
        }
        Ok(loaded)
    }
}

/// How recordings are to be read.
pub(super) fn read_options(arguments: &ReadArguments) -> ReadOptions {
    ReadOptions {
        every: arguments.every.map(|every| every as usize),
        image_size: arguments.image_size,
    }
}

/// The demonstrations of a task, and what is to be said of each recording; what was lost of a damaged
/// one is told.
pub(super) fn read_demonstrations(
    recordings: &Recordings,
    task: &str,
) -> Result<(DemonstrationSet, Vec<RecordingReport>), CliError> {
    let (set, reports) = recordings.demonstrations(task)?;
    for report in reports.iter().filter(|r| !r.losses.is_empty()) {
        eprintln!("warning: {report}");
    }
    Ok((set, reports))
}

/// Refuses demonstrations whose actions mean something else in the action space of a model.
fn ensure_same_actions(set: &DemonstrationSet, space: &ActionSpace) -> Result<(), CliError> {
    let recorded = set.action_space();
    if space.takes_actions_of(recorded) {
        return Ok(());
    }
    let are_values = |space: &ActionSpace| !matches!(space, ActionSpace::Primitives { .. });
    let way_out = if are_values(space) && are_values(recorded) {
        "list the model's names in its order under 'keep' of the 'actions' in a mapping file (under 'names' where the \
         same values are only called otherwise)"
    } else {
        "record with the actions of the model, primitives in its order"
    };
    let first = set.trajectories().first();
    Err(CliError::ActionsDiffer {
        task: set.task().to_owned(),
        trajectory: first.map(|t| t.id.clone()).unwrap_or_default(),
        found: recorded.with_names(),
        expected: space.with_names(),
        way_out,
    })
}

/// The demonstrations as a model takes them: with its action space, which has bins where the recordings have
/// none, and with the images of its cameras in their size. Demonstrations with other actions are refused.
pub(super) fn in_model_space(
    set: &DemonstrationSet,
    model: &Model,
) -> Result<DemonstrationSet, CliError> {
    let spec = &model.manifest().spec;
    ensure_same_actions(set, &spec.action_space)?;
    let mut trajectories = set.trajectories().to_vec();
    for trajectory in &mut trajectories {
        trajectory.action_space = spec.action_space.clone();
        for step in &mut trajectory.steps {
            step.observation = Arc::new(step.observation.fitted(&spec.cameras)?);
        }
    }
    Ok(DemonstrationSet::new(set.task(), trajectories)?)
}

/// A composition with everything that planning and running it needs.
pub(super) struct Loaded {
    pub(super) composition: Composition,
    pub(super) model: Model,
    pub(super) graph: Arc<TopologicalGraph>,
    /// In the order of all its tasks.
    images: Vec<GraphImages>,
    pub(super) merge_report: MergeReport,
}

impl Loaded {
    /// Reads a composition or a task, its model and graphs, and merges the graphs.
    ///
    /// Of several orders it takes the cheapest; where none connects, the first, whose plan says why.
    pub(super) fn load(name_or_path: &str, arguments: &Arguments) -> Result<Self, CliError> {
        Self::of(compose_named(name_or_path, &arguments.root)?, arguments)
    }

    /// The same for a composition that was read already.
    pub(super) fn of(
        mut composition: Composition,
        arguments: &Arguments,
    ) -> Result<Self, CliError> {
        composition.check_files()?;
        if is_bedroom(&composition) {
            bedroom(&composition)?;
        }
        let model = load_model(&composition, arguments)?;
        let folders: Vec<PathBuf> = composition.all_tasks().map(|t| t.graph.clone()).collect();
        let mut loaded = GraphFolders::load(&folders, &model)?;
        for (task, manifest) in composition.all_tasks().zip(&loaded.manifests) {
            ensure_same_subgoals(task, manifest, &composition.model)?;
        }
        let exponent = model.manifest().temperature / model.temperature();
        if composition.calibration == Calibration::None {
            for graph in &mut loaded.graphs {
                *graph = graph.tempered(exponent);
            }
        }
        let images = folders
            .iter()
            .map(|f| GraphImages::open(f))
            .collect::<Result<_, _>>()?;
        let bar = progress::bar("merging", 0);
        let merged = merge_all(&loaded.graphs, &composition, &model, &bar)?;
        bar.finish_and_clear();
        let graph = composition.place_regions(merged.0)?;
        if composition.orders.way_count() > 1 {
            composition.settle(&graph)?;
        }
        composition.check_against(&graph)?;
        Ok(Self {
            composition,
            model,
            graph: Arc::new(graph),
            images,
            merge_report: merged.1,
        })
    }

    /// The pictures of a task's graph. Ids of demonstrations tell them apart within a task only.
    pub(super) fn images_of(&self, task: &str) -> Option<&GraphImages> {
        let mut of_graphs = self.composition.all_tasks().zip(&self.images);
        let (_, images) = of_graphs.find(|(of, _)| of.task.name == task)?;
        Some(images)
    }

    /// A planner with these options.
    pub(super) fn planner(&self, options: PlannerOptions) -> Result<Planner, CliError> {
        Ok(Planner::new(
            Arc::clone(&self.graph),
            &self.composition.automaton,
            self.composition.terms(),
            options,
        )?)
    }

    /// A planner of the composition on another graph of its tasks, whose states are numbered otherwise:
    /// nothing is avoided, and nothing left out.
    pub(super) fn planner_on(
        &self,
        graph: Arc<TopologicalGraph>,
        options: PlannerOptions,
    ) -> Result<Planner, CliError> {
        Ok(Planner::new(
            graph,
            &self.composition.automaton,
            self.terms_without_regions(),
            options,
        )?)
    }

    fn terms_without_regions(&self) -> Terms {
        Terms {
            avoid: Vec::new(),
            unplaced: Vec::new(),
            ..self.composition.terms()
        }
    }

    /// What the paper would plan, which knows nothing of what is to be avoided, to be audited; none where
    /// it finds no way.
    pub(super) fn paper_plan(&self) -> Result<Option<(Planner, Plan)>, CliError> {
        let planner = Planner::new(
            Arc::clone(&self.graph),
            &self.composition.automaton,
            self.terms_without_regions(),
            PlannerOptions::paper(),
        )?;
        let plan = planner.plan_from_start().ok();
        Ok(plan.map(|plan| (planner, plan)))
    }

    pub(super) fn rollout_model(&self) -> RolloutModel<'_> {
        RolloutModel {
            encoder: &self.model,
            traversability: &self.model,
            policy: &self.model,
            landmarks: self.model.landmarks(),
        }
    }

    /// How the composition is run; `nearest_states` is what was given by `--nearest-states`.
    pub(super) fn rollout_options(&self, nearest_states: Option<usize>) -> RolloutOptions {
        RolloutOptions {
            nearest_states,
            max_steps: self.composition.limits.steps as usize,
            on_shortcut: self.composition.on_shortcut,
            ..RolloutOptions::default()
        }
    }

    /// The bedroom that the composition starts in.
    pub(super) fn bedroom(&self) -> Result<BedroomConfig, CliError> {
        bedroom(&self.composition)
    }
}

/// Refuses a graph that was built when its task named other subgoals, or the same in another order: its states
/// count those that hold.
fn ensure_same_subgoals(
    task: &ResolvedTask,
    manifest: &GraphManifest,
    model: &Path,
) -> Result<(), CliError> {
    let named = GraphTask::from(&task.task);
    let built = manifest.tasks.iter().find(|t| t.name == named.name);
    match built {
        Some(built) if built.subgoals != named.subgoals => Err(CliError::SubgoalsDiffer {
            command: format!(
                "catena graph build tasks/{}.yaml --model {}",
                named.name,
                model.display()
            ),
            task: named.name,
            named: named.subgoals.join(", "),
            built: built.subgoals.join(", "),
        }),
        _ => Ok(()),
    }
}

/// Digests of the graphs of a composition's tasks, each as `task:digest`.
pub(super) fn graph_digests(composition: &Composition) -> Result<Vec<String>, CliError> {
    let digest = |task: &ResolvedTask| {
        let digest = sha256_file(&task.graph.join("manifest.json"))?;
        Ok(format!("{}:{digest}", task.task.name))
    };
    composition.all_tasks().map(digest).collect()
}

/// Whether a composition's world is the simulated bedroom; robots of one's own may have another, or none.
fn is_bedroom(composition: &Composition) -> bool {
    let world = composition.environment.as_ref();
    world.is_some_and(|world| world.kind.value == "bedroom")
}

/// The bedroom that a composition starts in.
pub(super) fn bedroom(composition: &Composition) -> Result<BedroomConfig, CliError> {
    match &composition.environment {
        Some(environment) if environment.kind.value == "bedroom" => Ok(environment.settings_as()?),
        other => Err(CliError::UnknownWorld {
            composition: composition.name.clone(),
            found: other
                .as_ref()
                .map_or_else(|| "none".to_owned(), |e| format!("'{}'", e.kind.value)),
        }),
    }
}

/// The model of a composition, calibrated as it says.
pub(super) fn load_model(
    composition: &Composition,
    arguments: &Arguments,
) -> Result<Model, CliError> {
    let model = Model::load(&composition.model, arguments.engine.into())?;
    Ok(match composition.calibration {
        Calibration::Temperature => model,
        Calibration::None => model.at_temperature(1.0),
    })
}

/// The graphs of a composition's tasks in one.
pub(super) fn merge_all(
    graphs: &[TopologicalGraph],
    composition: &Composition,
    model: &Model,
    bar: &ProgressBar,
) -> Result<(TopologicalGraph, MergeReport), CliError> {
    let follows = composition.follows();
    if let ([graph], true) = (graphs, follows.is_empty()) {
        return Ok((graph.clone(), MergeReport::default()));
    }
    let graphs: Vec<&TopologicalGraph> = graphs.iter().collect();
    let known: Vec<&str> = graphs.iter().flat_map(|graph| graph.tasks()).collect();
    let follows: Vec<(&str, &str)> = follows
        .into_iter()
        .filter(|(from, to)| known.contains(from) && known.contains(to))
        .collect();
    let merged = merge(&graphs, &follows, model, &merge_options(), &|p| {
        show(bar, p);
    })?;
    Ok((merged.graph, merged.report))
}

/// Moves a bar to how far the work is.
pub(super) fn show(bar: &ProgressBar, progress: GraphProgress) {
    bar.set_length(progress.total);
    bar.set_position(progress.done);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::composer::{FoundBy, TaskSpec};
    use crate::trajectory::{Action, ActionDimension, Image, Observation, Step, Trajectory};

    #[test]
    fn recordings_with_other_actions_than_the_model_are_refused_with_both_lists() {
        let image = Image::new(1, 1, vec![0; 3]).expect("one pixel");
        let observation = Arc::new(Observation::new([("head".to_owned(), image)]));
        let told = |recorded: &[&str], of_model: &[&str]| {
            let trajectory = Trajectory {
                id: "demo".to_owned(),
                task: "cup".to_owned(),
                action_space: ActionSpace::Continuous {
                    names: recorded.iter().map(|n| (*n).to_owned()).collect(),
                },
                steps: vec![Step {
                    time_secs: 0.0,
                    observation: Arc::clone(&observation),
                    action: Action::Continuous(vec![0.0; recorded.len()]),
                }],
                markers: Vec::new(),
            };
            let set = DemonstrationSet::new("cup", vec![trajectory]).expect("one trajectory");
            let dimension = |name: &&str| ActionDimension::uniform(*name, 0.0, 1.0, 2);
            let dimensions = of_model.iter().map(dimension).collect();
            let checked = ensure_same_actions(&set, &ActionSpace::Binned { dimensions });
            checked.err().map(|e| e.to_string())
        };
        assert_eq!(told(&["x", "gripper"], &["x", "gripper"]), None);
        assert_eq!(told(&["action_0", "action_1"], &["x", "gripper"]), None);
        assert_eq!(told(&["x", "gripper"], &["action_0", "action_1"]), None);
        assert_eq!(
            told(&["gripper", "x"], &["x", "gripper"]).as_deref(),
            Some(
                "the recordings of task 'cup', such as 'demo', have 2 continuous dimensions (gripper, x), but the \
                 model has 2 binned dimensions (x, gripper): list the model's names in its order under 'keep' of the \
                 'actions' in a mapping file (under 'names' where the same values are only called otherwise), or train \
                 a model with these recordings"
            )
        );
    }

    #[test]
    fn a_graph_of_other_subgoals_is_refused_with_both_lists() {
        let resolved = |subgoals: &[&str]| {
            let spec = TaskSpec::new("cup", "graphs/cup");
            let all = subgoals.iter();
            let spec = all.fold(spec, |spec, s| spec.subgoal(*s, FoundBy::Marker(None)));
            spec.resolve(Path::new("")).expect("a sound task")
        };
        let built = resolved(&["door_open", "cup_grasped", "cup_in_sink"]);
        let options = serde_json::Value::Null;
        let tasks = std::slice::from_ref(&built.task);
        let manifest = GraphManifest::new(tasks, "model", "demos", options);
        let told = |task: &ResolvedTask| {
            let checked = ensure_same_subgoals(task, &manifest, Path::new("graphs/model"));
            checked.err().map(|e| e.to_string())
        };
        assert_eq!(told(&built), None);
        let removed = told(&resolved(&["door_open", "cup_in_sink"]));
        assert_eq!(
            removed.as_deref(),
            Some(
                "the graph of task 'cup' was built with the subgoals door_open, cup_grasped, \
                 cup_in_sink, but the task now has door_open, cup_in_sink: build its graph again \
                 (`catena graph build tasks/cup.yaml --model graphs/model`), or give the task the \
                 subgoals that it had"
            )
        );
        let reordered = ["cup_grasped", "door_open", "cup_in_sink"];
        assert!(told(&resolved(&reordered)).is_some());
    }
}
