use thiserror::Error;

use super::{GripperEvent, Occurrence};

/// Why subgoals cannot be found in a demonstration.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum TaskError {
    /// The demonstration has no step, so nothing can be reached in it.
    #[error("demonstration '{trajectory}' of task '{task}' has no steps")]
    NoSteps {
        /// The task.
        task: String,
        /// The demonstration.
        trajectory: String,
    },
    /// No marker of the name that a subgoal is found by.
    #[error(
        "demonstration '{trajectory}' has no marker '{marker}', by which subgoal '{subgoal}' of task \
         '{task}' is found; its markers: {present}"
    )]
    MarkerMissing {
        /// The task.
        task: String,
        /// The subgoal.
        subgoal: String,
        /// The demonstration.
        trajectory: String,
        /// The marker that was looked for.
        marker: String,
        /// The markers that are there, separated by commas.
        present: String,
    },
    /// A marker stands beyond the last step.
    #[error(
        "marker '{marker}' of demonstration '{trajectory}' stands at step {step}, but there are only \
         {steps} steps"
    )]
    MarkerBeyondEnd {
        /// The demonstration.
        trajectory: String,
        /// The marker.
        marker: String,
        /// Where it stands.
        step: usize,
        /// Number of steps.
        steps: usize,
    },
    /// The gripper moves less often than a subgoal asks for.
    #[error(
        "demonstration '{trajectory}': subgoal '{subgoal}' of task '{task}' is found when the gripper is \
         told to {event} for the {wanted} time from step {after} on, but that happens {found} times"
    )]
    GripperEventMissing {
        /// The task.
        task: String,
        /// The subgoal.
        subgoal: String,
        /// The demonstration.
        trajectory: String,
        /// Closing or opening.
        event: GripperEvent,
        /// Which one is asked for.
        wanted: Occurrence,
        /// Step of the subgoal before, from which on events count.
        after: usize,
        /// How many there are.
        found: usize,
    },
    /// The action space does not say what the gripper does in the way that the task expects.
    #[error(
        "demonstration '{trajectory}': gripper events of task '{task}' are read off {signal}, which its \
         action space does not have; it has: {present}"
    )]
    GripperSignalAbsent {
        /// The task.
        task: String,
        /// The demonstration.
        trajectory: String,
        /// What the task reads them off, printed.
        signal: String,
        /// Primitives or dimensions of the action space, separated by commas.
        present: String,
    },
    /// The demonstration reaches a subgoal before the one that the task puts before it.
    #[error(
        "demonstration '{trajectory}' reaches subgoal '{later}' of task '{task}' at step {later_step}, \
         before '{earlier}' at step {earlier_step}"
    )]
    OutOfOrder {
        /// The task.
        task: String,
        /// The demonstration.
        trajectory: String,
        /// The subgoal that the task puts first.
        earlier: String,
        /// Where the demonstration reaches it.
        earlier_step: usize,
        /// The subgoal that the task puts after it.
        later: String,
        /// Where the demonstration reaches that one.
        later_step: usize,
    },
}
