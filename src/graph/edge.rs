use serde::{Deserialize, Serialize};

/// Where an edge comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeKind {
    /// Two states that follow each other in one demonstration.
    Temporal,
    /// Predicted, between states of the same task.
    Learned,
    /// Predicted, from a task to the next one: states of different tasks, or the end and the start of one
    /// that is done several times.
    CrossTask,
}

/// A directed edge: how many time steps lead from one state to another.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Edge {
    /// Where it comes from.
    pub kind: EdgeKind,
    /// Time steps, `1..d_max`: the most probable class, or the true number for a temporal edge.
    pub steps: u32,
    /// Probabilities of the classes `1..=d_max`; a temporal edge is certain of its class.
    pub probabilities: Vec<f32>,
}

impl Edge {
    /// Probability that the second state can be reached in fewer than `d_max` steps: 1 minus that of
    /// the last class.
    #[must_use]
    pub fn connected_probability(&self) -> f32 {
        1.0 - self.probabilities.last().copied().unwrap_or(0.0)
    }
}
