//! Models, graphs and compositions as commands load them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::arguments::{Arguments, EngineArgument};
use super::error::CliError;
use super::merging::merge_all;
use super::progress;
use super::worlds::{BEDROOM, composed};
use crate::composer::{Calibration, Composition, EnvironmentConfig, ResolvedTask};
use crate::graph::{MergeReport, TopologicalGraph};
use crate::inference::{EngineChoice, Model};
use crate::planner::{Plan, Planner, PlannerOptions, Terms};
use crate::rollout::{RolloutModel, RolloutOptions};
use crate::simulator::{BedroomConfig, Level};
use crate::storage::{
    GraphImages, GraphManifest, GraphTask, ensure_same_model, load_graph, sha256_file,
};

impl From<EngineArgument> for EngineChoice {
    fn from(argument: EngineArgument) -> Self {
        match argument {
            EngineArgument::Auto => Self::Auto,
            EngineArgument::Native => Self::Native,
            EngineArgument::Embedded => Self::Tract,
        }
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
    /// Of several orders it takes the cheapest, of those that leave the fewest optional parts out; where none
    /// connects, the first, whose plan says why.
    pub(super) fn load(name_or_path: &str, arguments: &Arguments) -> Result<Self, CliError> {
        Self::of(composed(name_or_path, &arguments.root)?, arguments)
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
    let all = digests_by_task(composition)?.into_iter();
    let written = all.map(|(task, digest)| format!("{task}:{digest}"));
    Ok(written.collect())
}

/// The same digests with the tasks' names.
pub(super) fn digests_by_task(
    composition: &Composition,
) -> Result<Vec<(String, String)>, CliError> {
    let digest = |task: &ResolvedTask| {
        let digest = sha256_file(&task.graph.join("manifest.json"))?;
        Ok((task.task.name.clone(), digest))
    };
    composition.all_tasks().map(digest).collect()
}

/// Whether a composition's world is the simulated bedroom; robots of one's own may have another, or none.
fn is_bedroom(composition: &Composition) -> bool {
    let world = composition.environment.as_ref();
    world.is_some_and(|world| world.kind.value == BEDROOM.name)
}

/// The bedroom that a composition starts in.
pub(super) fn bedroom(composition: &Composition) -> Result<BedroomConfig, CliError> {
    Ok(world(composition)?.settings_as()?)
}

/// The same at another level than it names, at which also is what it does not say of the variation.
pub(super) fn bedroom_at(
    composition: &Composition,
    level: Level,
) -> Result<BedroomConfig, CliError> {
    let mut world = world(composition)?.clone();
    let level = serde_json::to_value(level)?;
    world.settings.insert("level".to_owned(), level);
    Ok(world.settings_as()?)
}

/// What a composition says of the bedroom.
fn world(composition: &Composition) -> Result<&EnvironmentConfig, CliError> {
    match &composition.environment {
        Some(world) if world.kind.value == BEDROOM.name => Ok(world),
        Some(other) => Err(other.unknown(&[BEDROOM.name]).into()),
        None => Err(CliError::NoWorld {
            composition: composition.name.clone(),
        }),
    }
}

/// Tells what may not be meant as it is written, though it works.
pub(super) fn tell_warnings(composition: &Composition) {
    for warning in &composition.warnings {
        let help = warning.help.as_ref();
        let help = help.map_or_else(String::new, |help| format!(" ({help})"));
        eprintln!("warning: {}{help}", warning.line());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::composer::{FoundBy, TaskSpec};

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

    fn composition_in(world: Option<EnvironmentConfig>) -> Composition {
        let task = TaskSpec::new("cup", "graphs/cup")
            .subgoal("cup_in_sink", FoundBy::End)
            .resolve(Path::new(""))
            .expect("a sound task");
        let builder = Composition::builder("one").model("m").task(task);
        let builder = match world {
            Some(world) => builder.environment(world),
            None => builder,
        };
        builder.build().expect("a sound composition")
    }

    #[test]
    fn what_is_not_said_of_a_bedroom_is_as_at_the_level_that_is_asked_for() {
        let settings = serde_json::json!({"start": "wine", "variation": {"light": 0.1}});
        let serde_json::Value::Object(settings) = settings else {
            panic!("a map")
        };
        let composition = composition_in(Some(EnvironmentConfig::new("bedroom", settings)));
        let headings = |config: BedroomConfig| {
            let variation = config.variation.expect("it is given");
            (variation.light, variation.start_heading_deg)
        };
        let own = bedroom(&composition).expect("it is possible");
        assert_eq!(headings(own), (0.1, 15.0));
        let hard = bedroom_at(&composition, Level::Hard).expect("it is possible");
        assert_eq!((hard.level, headings(hard)), (Level::Hard, (0.1, 30.0)));
    }

    #[test]
    fn a_world_that_is_not_known_is_refused_with_the_nearest_one() {
        let named = EnvironmentConfig::new("bedrom", serde_json::Map::new());
        let error = bedroom(&composition_in(Some(named))).expect_err("there is none");
        let told = error.report();
        assert!(told.contains("the world 'bedrom' is not known"), "{told}");
        assert!(told.contains("did you mean 'bedroom'?"), "{told}");
        let error = bedroom(&composition_in(None)).expect_err("there is none");
        assert!(error.to_string().starts_with("'one' names no world; write"));
    }
}
