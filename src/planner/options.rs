use serde::{Deserialize, Serialize};

use super::EdgeCost;
use crate::graph::PruneOptions;

/// What a plan may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Search {
    /// Subgoals in order, each one reached.
    InOrder,
    /// The plain shortest path over all edges, as in the paper; subgoals may be skipped.
    Unconstrained,
}

/// Which edges a plan may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeChoice {
    /// Within a task only temporal edges; cross-task edges between tasks.
    TemporalOnly,
    /// Learned edges too, as in the paper.
    All,
}

/// Where a plan joins the graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Join {
    /// At whichever state is cheapest to go through by its predicted distance, as in the paper. The
    /// cheapest of thousands of predictions is one that errs on the short side.
    Cheapest,
    /// At the state where the filter believes the robot to be; a lost robot joins where it is nearest.
    Believed,
}

/// How to plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlannerOptions {
    /// What a plan may do.
    pub search: Search,
    /// What an edge costs.
    pub cost: EdgeCost,
    /// Which edges a plan may use.
    pub edges: EdgeChoice,
    /// Which predicted edges a plan may use, of those that [`edges`](Self::edges) allows; by default
    /// all. Temporal edges always stay.
    pub predicted_edges: PruneOptions,
    /// Where a plan joins the graph.
    pub join: Join,
    /// How many steps further along the composition a predicted edge may lead than it takes, in the
    /// median time of the demonstrations; `None` lets it lead anywhere. Bounds what a false edge can
    /// gain.
    pub forward_leap_steps: Option<u32>,
    /// Least probability (0..=1) that a state is fewer than `d_max` steps away for the robot to be
    /// sent there.
    pub min_live_probability: f32,
    /// How many predicted steps ahead along the route the goal state may lie; below `d_max`, since
    /// the local policy has seen no others. 0 takes the first state of the route, as in the paper; where the
    /// route goes on from the believed state, the one after that.
    pub lookahead_steps: u32,
}

impl Default for PlannerOptions {
    fn default() -> Self {
        Self {
            search: Search::InOrder,
            cost: EdgeCost::RiskAverse { lambda: 3.0 },
            edges: EdgeChoice::TemporalOnly,
            predicted_edges: PruneOptions::default(),
            join: Join::Believed,
            forward_leap_steps: Some(3),
            min_live_probability: 0.1,
            lookahead_steps: 3,
        }
    }
}

impl PlannerOptions {
    /// What the paper does (Fu & Finn, section III-D): all edges, the most probable class as cost,
    /// nothing about subgoals, the first state of the shortest path as goal.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            search: Search::Unconstrained,
            cost: EdgeCost::Argmax,
            edges: EdgeChoice::All,
            predicted_edges: PruneOptions::default(),
            join: Join::Cheapest,
            forward_leap_steps: None,
            min_live_probability: 0.0,
            lookahead_steps: 0,
        }
    }
}
