//! Tasks, their subgoals, and the automaton that says in which order subgoals are to be reached.

mod automaton;
mod detection;
mod error;
mod gripper;
mod optional_parts;
mod order;
mod order_automaton;
mod order_walk;
mod region;

pub use automaton::{Automaton, Transition};
pub use detection::{Occurrence, SubgoalDetection, SubgoalRule, locate_subgoals};
pub use error::TaskError;
pub use gripper::{GripperEvent, GripperSignal};
pub use order::Order;
pub use order_automaton::{OrderAutomaton, OrderTooLarge, OrderTransition};
pub use region::Region;

use serde::{Deserialize, Serialize};

/// Something that a task demands on the way, such as `sock_grasped`; a [`SubgoalRule`] says how it is
/// found in the demonstrations.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Subgoal {
    /// The task that demands it.
    pub task: String,
    /// Its name, unique within the task.
    pub name: String,
}

/// A task as the planner knows it: a name, and its subgoals in the order in which they must be
/// reached. The last one is the end of the task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    /// Unique within a composition.
    pub name: String,
    /// In order; never empty.
    pub subgoals: Vec<Subgoal>,
}
