use thiserror::Error;

use crate::model::ModelError;

/// Why a graph could not be built or merged.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum GraphError {
    /// The model gave no answer.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A latent holds a value that is not a number; such a state can be compared with nothing.
    #[error(
        "the latent of task '{task}', demonstration '{trajectory}', step {step} holds {value}: \
         the model or its normalisation is broken, train or export it again"
    )]
    LatentNotFinite {
        /// The task.
        task: String,
        /// The demonstration.
        trajectory: String,
        /// Its step.
        step: u32,
        /// The first value that is not finite, printed.
        value: String,
    },
    /// A graph without a state.
    #[error(
        "{what} has no states, so there is nothing to plan, merge or look at: build it from at least one \
         demonstration with `catena graph build`"
    )]
    NoStates {
        /// What was looked at.
        what: String,
    },
    /// Graphs and models that do not belong together: another number of traversability classes.
    #[error("{what} has d_max {found}, expected {expected}: build all graphs with one model")]
    DMaxDiffers {
        /// What was looked at.
        what: String,
        /// The number that the others have.
        expected: usize,
        /// The number that was found.
        found: usize,
    },
    /// Graphs and models that do not belong together: latents of another length.
    #[error(
        "{what} has latents of {found} values, expected {expected}: build all graphs with one model"
    )]
    LatentLengthDiffers {
        /// What was looked at.
        what: String,
        /// The length that the others have.
        expected: usize,
        /// The length that was found.
        found: usize,
    },
    /// There is not one list of subgoal steps for each demonstration.
    #[error("{found} lists of subgoal steps for {expected} demonstrations of '{task}'")]
    SubgoalLists {
        /// The task.
        task: String,
        /// Number of demonstrations.
        expected: usize,
        /// Number of lists.
        found: usize,
    },
    /// A subgoal stands at a step that the demonstration does not have.
    #[error(
        "subgoal '{subgoal}' stands at step {step} of demonstration '{trajectory}', which has {steps} steps"
    )]
    SubgoalOutOfRange {
        /// The demonstration.
        trajectory: String,
        /// The subgoal's name.
        subgoal: String,
        /// Where it was said to be.
        step: usize,
        /// Number of steps that there are.
        steps: usize,
    },
    /// Nothing was given to merge.
    #[error("no graph to merge")]
    NothingToMerge,
    /// Two of the graphs to merge show the same task.
    #[error("task '{task}' is in two of the graphs to merge; merge each task once")]
    TaskTwice {
        /// The task.
        task: String,
    },
    /// A pair of tasks that follow each other names one that no graph shows.
    #[error("the order names task '{task}', the graphs have: {known}")]
    UnknownTask {
        /// The task that was named.
        task: String,
        /// The tasks that are there, separated by commas.
        known: String,
    },
    /// A graph with so few states cannot show every task.
    #[error("{found} states are fewer than one demonstration of each task takes: at least {least}")]
    TooFewStates {
        /// The least number.
        least: usize,
        /// The number that was asked for.
        found: usize,
    },
}
