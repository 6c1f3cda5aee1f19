use serde::{Deserialize, Serialize};

use super::{Event, StepTimes};

/// Why a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum EpisodeEnd {
    /// All subgoals are seen to be reached, and the robot is at a final state or has settled.
    Finished,
    /// The limit of time steps was hit.
    OutOfSteps,
    /// A shortcut was seen, and the composition says to stop.
    Shortcut,
    /// There is no way on; why.
    NoPath(String),
}

/// What became of a run, as seen from images and actions alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Episode {
    /// Time steps.
    pub steps: usize,
    /// Why it ended.
    pub end: EpisodeEnd,
    /// How many subgoals were seen to be reached.
    pub stage: usize,
    /// All events in order.
    pub events: Vec<Event>,
    /// Steps at which the robot was lost.
    pub lost_steps: usize,
    /// What each step took.
    pub times: Vec<StepTimes>,
}
