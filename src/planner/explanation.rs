//! Why a plan is what it is, as data that can be printed, drawn and written as JSON.

mod describe;
mod ends;
mod orders;
mod parts;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::{AuditedEdge, NoPath, Planner};
use crate::task::{OrderAutomaton, Subgoal, Task};

/// Why a plan is what it is: the automaton, the orders that were open, what each part of the plan costs, how
/// probable it is to hold, and how the end state of each task was chosen.
///
/// [`Display`](std::fmt::Display) puts it into words.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// The subgoals in the order in which they are due.
    pub stages: Vec<StageExplained>,
    /// The orders of tasks that were open.
    pub orders: OrdersExplained,
    /// The plan, subgoal by subgoal; the last part leads to the final state. One that is not searched in
    /// order has that part only.
    pub parts: Vec<PlanPart>,
    /// How probable the plan is to hold.
    pub odds: PlanOdds,
    /// How the end of each task was chosen, in the order of the tasks.
    pub ends: Vec<TaskEnds>,
}

/// A stage of the automaton that is not the last one, and what ends it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageExplained {
    /// How many subgoals are reached when it begins.
    pub stage: usize,
    /// At which of the composition's tasks, from 0.
    pub occurrence: usize,
    /// That task.
    pub task: String,
    /// The subgoal that ends it.
    pub subgoal: String,
    /// How many demonstrations of the task reach it.
    pub demonstrations: usize,
}

/// The orders of tasks that a composition allows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrdersExplained {
    /// How many different orders are open: those that end with the task of the final state, where that is said. `None`
    /// where they are too many to be counted.
    pub order_count: Option<u64>,
    /// How many different orders were planned for this explanation, the chosen one included; not more than 64.
    pub planned: usize,
    /// How many of these connect.
    pub connected: usize,
    /// The cheapest ones, the chosen one among them, then those that do not connect; not more than six.
    pub listed: Vec<OrderExplained>,
}

/// One order of tasks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrderExplained {
    /// The tasks.
    pub tasks: Vec<String>,
    /// What its cheapest plan costs; `None` where it does not connect.
    pub cost: Option<f64>,
    /// Predicted steps of that plan.
    pub steps: Option<u32>,
    /// How many optional parts it leaves out.
    #[serde(default)]
    pub left_out: usize,
    /// Whether it is the order that is planned.
    pub is_chosen: bool,
}

/// The part of a plan that leads to one subgoal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanPart {
    /// The task.
    pub task: String,
    /// The subgoal; `None` for what leads from the last one to the final state.
    pub subgoal: Option<String>,
    /// The state where it begins, by demonstration and step.
    pub from: String,
    /// The state where it ends.
    pub to: String,
    /// Predicted time steps.
    pub steps: u32,
    /// What its edges cost.
    pub cost: f64,
    /// Probability that it holds, 0..=1: the product over its predicted edges.
    pub probability: f64,
    /// How many of its edges are predicted.
    pub predicted_edges: usize,
}

/// How probable a plan is to hold, and what that rests on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanOdds {
    /// The product of P(connected) over all predicted edges of the plan, 0..=1.
    pub probability: f64,
    /// Those edges in order.
    pub predicted_edges: Vec<AuditedEdge>,
    /// What must be true for the product to be the probability.
    pub assumption: String,
}

/// How the end of one task of a plan was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TaskEnds {
    /// The task.
    pub task: String,
    /// Which of the composition's tasks, from 0.
    pub occurrence: usize,
    /// Whether it is the last one, whose end is the final state.
    pub is_last: bool,
    /// How many of its demonstrations end with all its subgoals reached.
    pub end_states: usize,
    /// How many of these have an edge into the next task; for the last task, how many may be final and
    /// can be got to.
    pub leading_on: usize,
    /// The best states at which a plan may leave the task, by total cost, of each demonstration the best
    /// one; not more than five, the chosen one among them.
    pub candidates: Vec<EndCandidate>,
    /// The end state that is cheapest to get to, for comparison; of the last task only where it is cheaper
    /// than the chosen one.
    pub nearest: Option<EndCandidate>,
    /// Why the chosen one is.
    pub reason: String,
}

/// A state at which a task may end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EndCandidate {
    /// The state, by demonstration and step.
    pub state: String,
    /// What it costs to get there from the start of the plan.
    pub cost_to: f64,
    /// What it costs from there to the final state; 0 for a final state, `None` where no way leads on.
    pub cost_onward: Option<f64>,
    /// Probability that the whole route through it holds, 0..=1: the product over its predicted edges.
    pub route_probability: f64,
    /// Whether the plan passes it.
    pub is_chosen: bool,
}

impl EndCandidate {
    /// What the cheapest plan through it costs.
    #[must_use]
    pub fn total(&self) -> Option<f64> {
        Some(self.cost_to + self.cost_onward?)
    }
}

impl Explanation {
    /// Explains what [`Planner::plan_from_start`] gives. `orders` are those that the composition allows, with
    /// the subgoals of their `tasks`; with `final_task` only those that end with it.
    ///
    /// Plans up to 64 of the orders, each on its own.
    ///
    /// # Errors
    /// [`NoPath`] where there is no plan.
    pub fn new(
        planner: &Planner,
        orders: &OrderAutomaton,
        tasks: &[Task],
        final_task: Option<&str>,
    ) -> Result<Self, NoPath> {
        let plan = planner.plan_from_start()?;
        let trip = parts::Trip::new(planner, &plan);
        Ok(Self {
            stages: stages(planner),
            orders: orders::explain(planner, &plan, orders, tasks, final_task),
            parts: parts::parts(planner, &plan, &trip),
            odds: trip.odds(planner),
            ends: ends::ends(planner, &trip),
        })
    }
}

fn stages(planner: &Planner) -> Vec<StageExplained> {
    let automaton = planner.automaton();
    let offsets = super::layout::stage_offsets(automaton);
    let subgoals = automaton.subgoals().iter().enumerate();
    let reaching = |subgoal: &Subgoal| {
        let nodes = planner.graph().nodes().map(|(_, n)| n);
        let reached = nodes.filter(|n| n.reached.contains(subgoal));
        reached
            .map(|n| &n.trajectory)
            .collect::<BTreeSet<_>>()
            .len()
    };
    subgoals
        .map(|(stage, subgoal)| StageExplained {
            stage,
            occurrence: offsets.partition_point(|offset| *offset <= stage) - 1,
            task: subgoal.task.clone(),
            subgoal: subgoal.name.clone(),
            demonstrations: reaching(subgoal),
        })
        .collect()
}
