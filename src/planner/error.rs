use thiserror::Error;

/// Why nothing can be planned on a graph.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum PlannerError {
    /// The composition names no task.
    #[error("the composition has no task")]
    NoTask,
    /// The graph has no state.
    #[error(
        "the graph has no states, so nothing can be planned on it: build it from at least one demonstration"
    )]
    NoStates,
    /// The composition names a task that the graph does not show.
    #[error("the composition needs task '{task}', the graph has: {known}")]
    UnknownTask {
        /// The task.
        task: String,
        /// The graph's tasks, separated by commas.
        known: String,
    },
    /// No state can be final.
    #[error(
        "task '{task}' has no final state: of {ends} end states of its demonstrations, none has \
         reached all {subgoals} subgoals. Look at the markers of its demonstrations (`catena demos`), or record \
         one that does the whole task, and build its graph again"
    )]
    NoFinalState {
        /// The last task.
        task: String,
        /// How many end states there are.
        ends: usize,
        /// How many subgoals the task has.
        subgoals: usize,
    },
    /// All final states lie in regions that are to be avoided.
    #[error("every final state of '{task}' lies in a region that is to be avoided: {regions}")]
    FinalStatesAvoided {
        /// The last task.
        task: String,
        /// The regions, separated by commas.
        regions: String,
    },
    /// A start at the end of a task that the graph does not show.
    #[error("the robot is to start at the end of '{task}', the graph has: {known}")]
    UnknownStart {
        /// The task.
        task: String,
        /// The graph's tasks, separated by commas.
        known: String,
    },
    /// A start at a stage that the composition does not have.
    #[error("there is no stage {stage}: the composition has {subgoals} subgoals")]
    UnknownStage {
        /// What was asked for.
        stage: usize,
        /// How many subgoals there are.
        subgoals: usize,
    },
    /// A demonstration was asked for that is not there or whose end cannot be final.
    #[error(
        "demonstration '{demonstration}' cannot give the final state of '{task}'; these can: {known}"
    )]
    UnknownDemonstration {
        /// What was asked for.
        demonstration: String,
        /// The last task.
        task: String,
        /// Demonstrations whose end can be final.
        known: String,
    },
    /// The stages of the graph's states could not be learnt.
    #[error(
        "the stages of the graph's states cannot be told from their latents ({reason}): look at the graph with \
         `catena graph show`, or build it again"
    )]
    Classifier {
        /// What went wrong.
        reason: String,
    },
}
