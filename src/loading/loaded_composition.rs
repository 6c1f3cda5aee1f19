use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::LoadError;
use super::graph_folders::GraphFolders;
use super::merging::{merge_options, merge_tasks};
use crate::composer::{Calibration, Composition, ResolvedTask};
use crate::graph::{MergeOptions, MergeReport, ProgressFn, TopologicalGraph};
use crate::inference::{EngineChoice, InferenceError, Model};
use crate::planner::{Planner, PlannerError, PlannerOptions};
use crate::storage::{GraphImages, GraphManifest, GraphTask};

/// A composition with everything that planning and running it needs.
///
/// ```no_run
/// use catena::composer::compose_named;
/// use catena::inference::EngineChoice;
/// use catena::loading::LoadedComposition;
///
/// let composition = compose_named("sock_then_trash", ".".as_ref())?;
/// let loaded = LoadedComposition::load(composition, EngineChoice::Auto)?;
/// let planner = loaded.own_planner()?;
/// println!("{} steps", planner.plan_from_start()?.steps);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct LoadedComposition {
    /// The composition, with its regions found on the graph and, of several orders, the cheapest taken.
    pub composition: Composition,
    /// Its model, calibrated as it says.
    pub model: Model,
    /// The graphs of all its tasks in one, calibrated as it says.
    pub graph: Arc<TopologicalGraph>,
    /// What merging them found.
    pub merge_report: MergeReport,
    /// In the order of all its tasks.
    images: Vec<GraphImages>,
}

impl LoadedComposition {
    /// Loads the model and the graphs of a composition or of a task alone, and merges the graphs with
    /// [`merge_options`].
    ///
    /// Of several orders it takes the cheapest, of those that leave the fewest optional parts out; where none
    /// connects, the first, whose plan says why.
    ///
    /// # Errors
    /// [`LoadError::Composer`] for folders that are not there, at the lines that name them, before anything is loaded,
    /// and for what only the graph can tell, such as regions without states; [`LoadError::Inference`] for the model;
    /// [`LoadError::Storage`] and [`LoadError::Graph`] for graphs that cannot be read, are of another model or do not
    /// fit together; [`LoadError::SubgoalsDiffer`] for one that was built when its task had other subgoals;
    /// [`LoadError::Planner`] where no order can be settled.
    pub fn load(composition: Composition, engine: EngineChoice) -> Result<Self, LoadError> {
        Self::load_with(composition, engine, &merge_options(), &|_| {})
    }

    /// The same with other options of merging, which takes longest and tells how far it is.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_with(
        mut composition: Composition,
        engine: EngineChoice,
        options: &MergeOptions,
        progress: ProgressFn<'_>,
    ) -> Result<Self, LoadError> {
        composition.check_files()?;
        let model = load_model(&composition, engine)?;
        let folders: Vec<PathBuf> = composition.all_tasks().map(|t| t.graph.clone()).collect();
        let mut loaded = GraphFolders::load(&folders, &model)?;
        for (task, manifest) in composition.all_tasks().zip(&loaded.manifests) {
            ensure_same_subgoals(task, manifest, &composition.model)?;
        }
        if composition.calibration == Calibration::None {
            // Their edges were predicted at the model's own temperature.
            let exponent = model.manifest().temperature / model.temperature();
            for graph in &mut loaded.graphs {
                *graph = graph.tempered(exponent);
            }
        }
        let images = folders
            .iter()
            .map(|f| GraphImages::open(f))
            .collect::<Result<_, _>>()?;
        let merged = merge_tasks(&loaded.graphs, &composition, &model, options, progress)?;
        let graph = composition.place_regions(merged.graph)?;
        if composition.orders.way_count() > 1 {
            composition.settle(&graph)?;
        }
        composition.check_against(&graph)?;
        Ok(Self {
            composition,
            model,
            graph: Arc::new(graph),
            merge_report: merged.report,
            images,
        })
    }

    /// The pictures of a task's graph; `None` for a task that the composition does not name. Ids of demonstrations tell
    /// them apart within a task only.
    #[must_use]
    pub fn images_of(&self, task: &str) -> Option<&GraphImages> {
        let mut of_graphs = self.composition.all_tasks().zip(&self.images);
        let (_, images) = of_graphs.find(|(of, _)| of.task.name == task)?;
        Some(images)
    }

    /// A planner with the composition's own options.
    ///
    /// # Errors
    /// As [`planner`](Self::planner).
    pub fn own_planner(&self) -> Result<Planner, PlannerError> {
        self.planner(self.composition.planner.clone())
    }

    /// A planner with these options instead.
    ///
    /// # Errors
    /// Those of [`Planner::new`].
    pub fn planner(&self, options: PlannerOptions) -> Result<Planner, PlannerError> {
        Planner::new(
            Arc::clone(&self.graph),
            &self.composition.automaton,
            self.composition.terms(),
            options,
        )
    }
}

/// The model of a composition, calibrated as it says.
fn load_model(composition: &Composition, engine: EngineChoice) -> Result<Model, InferenceError> {
    let model = Model::load(&composition.model, engine)?;
    Ok(match composition.calibration {
        Calibration::Temperature => model,
        Calibration::None => model.at_temperature(1.0),
    })
}

/// Refuses a graph that was built when its task named other subgoals, or the same in another order: its states
/// count those that hold.
fn ensure_same_subgoals(
    task: &ResolvedTask,
    manifest: &GraphManifest,
    model: &Path,
) -> Result<(), LoadError> {
    let named = GraphTask::from(&task.task);
    let built = manifest.tasks.iter().find(|t| t.name == named.name);
    match built {
        Some(built) if built.subgoals != named.subgoals => Err(LoadError::SubgoalsDiffer {
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
}
