use thiserror::Error;

/// What can be wrong with images, actions and trajectories in memory.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// The pixel buffer does not hold `height * width * 3` bytes.
    #[error("an RGB image of {height}x{width} needs {expected} bytes, the buffer has {found}")]
    PixelCount {
        /// Rows.
        height: u32,
        /// Columns.
        width: u32,
        /// Bytes that the size asks for.
        expected: usize,
        /// Bytes that were given.
        found: usize,
    },
    /// An observation lacks a camera that somebody asked for.
    #[error("no camera named '{wanted}' in the observation, which has: {present}")]
    CameraMissing {
        /// The camera that was asked for.
        wanted: String,
        /// The cameras that are there, separated by commas.
        present: String,
    },
    /// An action does not belong to the action space: wrong kind, length or range.
    #[error("action {action} does not fit the action space {space}: {reason}")]
    ActionOutsideSpace {
        /// The action, printed.
        action: String,
        /// The space, printed.
        space: String,
        /// What does not fit.
        reason: String,
    },
    /// A dimension that the action space does not have.
    #[error("the actions have no dimension '{found}'; they have: {known}")]
    UnknownDimension {
        /// What was asked for.
        found: String,
        /// The dimensions, separated by commas.
        known: String,
    },
    /// A range for a dimension that ends before it begins, where the recorded values give the end that is not given.
    #[error(
        "the range of '{dimension}' is empty: {low} to {high}, while its values are from {least} to {greatest}. Give a \
         range that they lie in, or both of its ends"
    )]
    EmptyRange {
        /// The dimension.
        dimension: String,
        /// The lower end: the one that is given, or else the least value.
        low: f32,
        /// The upper end: the one that is given, or else the greatest value.
        high: f32,
        /// The least recorded value.
        least: f32,
        /// The greatest recorded value.
        greatest: f32,
    },
    /// Trajectories that were put into one set do not agree.
    #[error("trajectory '{trajectory}' has {found}, the others of the set have {expected}")]
    SetDisagrees {
        /// The trajectory that differs.
        trajectory: String,
        /// What the set has.
        expected: String,
        /// What this one has.
        found: String,
    },
    /// A trajectory that no camera saw.
    #[error("trajectory '{trajectory}' was seen by no camera: its first observation has no image")]
    NoCamera {
        /// The trajectory.
        trajectory: String,
    },
    /// A marker stands beyond the last step of its trajectory.
    #[error(
        "marker '{marker}' of trajectory '{trajectory}' stands at step {step}, beyond the last one, which is {last}"
    )]
    MarkerBeyondEnd {
        /// The trajectory.
        trajectory: String,
        /// The marker.
        marker: String,
        /// Where it stands, counted from 0.
        step: usize,
        /// The last step.
        last: usize,
    },
    /// A set without trajectories, or a trajectory without steps.
    #[error("{what} is empty")]
    Empty {
        /// What is empty.
        what: String,
    },
}
