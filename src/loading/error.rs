use thiserror::Error;

use crate::composer::Diagnostics;
use crate::graph::GraphError;
use crate::inference::InferenceError;
use crate::planner::PlannerError;
use crate::storage::StorageError;

/// Why a composition could not be loaded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LoadError {
    /// Faults of YAML files: folders that are not there, and what only a graph can tell.
    #[error(transparent)]
    Composer(#[from] Diagnostics),
    /// The graphs do not belong together, or cannot be merged.
    #[error(transparent)]
    Graph(#[from] GraphError),
    /// The model cannot be loaded.
    #[error(transparent)]
    Inference(#[from] InferenceError),
    /// No order can be settled on the graph.
    #[error(transparent)]
    Planner(#[from] PlannerError),
    /// A graph folder cannot be read, or another model built it.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A graph was built when its task had other subgoals.
    #[error(
        "the graph of task '{task}' was built with the subgoals {built}, but the task now has {named}: build its graph \
         again (`{command}`), or give the task the subgoals that it had"
    )]
    SubgoalsDiffer {
        /// The task.
        task: String,
        /// The subgoals of the graph, in order.
        built: String,
        /// Those of the task.
        named: String,
        /// What builds the graph again.
        command: String,
    },
}
