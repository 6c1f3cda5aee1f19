use serde::{Deserialize, Serialize};

use crate::task::Subgoal;

/// Index of a node in its graph; merging graphs renumbers them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct NodeId(pub u32);

impl NodeId {
    /// As an index into per-node tables.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A state of a demonstration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Node {
    /// The task that the demonstration shows.
    pub task: String,
    /// The demonstration's id.
    pub trajectory: String,
    /// Step of the demonstration, from 0.
    pub step: u32,
    /// Subgoals whose marker stands at exactly this step.
    pub reached: Vec<Subgoal>,
    /// How many of the task's subgoals hold here: those marked at this step or earlier.
    pub progress: u32,
    /// Whether this is the last state of its demonstration, and so a possible final state.
    pub is_end: bool,
}

impl Node {
    /// Where it comes from, as `demonstration:step`.
    #[must_use]
    pub fn place(&self) -> String {
        format!("{}:{}", self.trajectory, self.step)
    }

    /// Whether all these subgoals are reached at exactly this step.
    #[must_use]
    pub fn reaches(&self, due: &[Subgoal]) -> bool {
        due.iter().all(|due| self.reached.contains(due))
    }
}
