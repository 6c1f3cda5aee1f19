//! What each option of the edges does to a graph and to the plans on it.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::ExperimentError;
use super::graph_truth::{GraphTruth, is_false, is_wormhole};
use crate::graph::{EdgeKind, NodeId, PruneOptions, TopologicalGraph};
use crate::planner::{EdgeChoice, EdgeCost, FinalChoice, Plan, Planner, PlannerOptions};
use crate::task::Automaton;

/// A way of choosing and pricing edges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeOptions {
    /// What differs, in few words.
    pub name: String,
    /// How to plan.
    pub planner: PlannerOptions,
    /// Whether the probabilities are calibrated by the model's temperature.
    pub is_calibrated: bool,
}

/// What came of one way of choosing and pricing edges.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OptionEffect {
    /// The way.
    pub options: EdgeOptions,
    /// Learned edges that a plan may use.
    pub learned_edges: usize,
    /// Cross-task edges that a plan may use.
    pub cross_task_edges: usize,
    /// Share (0..=1) of both that is false, though a robot counts as arrived one primitive before the goal.
    pub false_share: f64,
    /// Share (0..=1) of both that is a wormhole: false by `d_max` steps and more, or impossible.
    pub wormhole_share: f64,
    /// Starts of the first task's demonstrations, each a plan.
    pub starts: usize,
    /// Those from which there is a plan.
    pub plans: usize,
    /// Plans that go over a false edge.
    pub plans_over_false_edges: usize,
    /// Mean cost of the plans; all means are 0 where there is no plan.
    pub mean_cost: f64,
    /// Mean of the steps that the plans claim.
    pub mean_claimed_steps: f64,
    /// Mean of the steps that they truly take, edges that lead nowhere left out.
    pub mean_true_steps: f64,
    /// Mean number of false edges of a plan.
    pub mean_false_edges: f64,
    /// Mean number of wormholes of a plan.
    pub mean_wormholes: f64,
}

impl EdgeOptions {
    /// The composition's own options; then, with all learned edges, each way of pricing, and each other option alone
    /// beside `risk_averse: 3`. Subgoals are in order.
    #[must_use]
    pub fn compared(own: &PlannerOptions, is_calibrated: bool) -> Vec<Self> {
        let free = PlannerOptions {
            cost: EdgeCost::RiskAverse { lambda: 3.0 },
            edges: EdgeChoice::All,
            forward_leap_steps: None,
            ..PlannerOptions::default()
        };
        let cost = |cost| PlannerOptions {
            cost,
            ..free.clone()
        };
        let pruned = |predicted_edges| PlannerOptions {
            predicted_edges,
            ..free.clone()
        };
        let probable = |min_probability| {
            pruned(PruneOptions {
                min_probability,
                ..PruneOptions::default()
            })
        };
        let supported = |min_support| {
            pruned(PruneOptions {
                min_support,
                ..PruneOptions::default()
            })
        };
        let capped = |cap| {
            pruned(PruneOptions {
                max_out_edges: Some(cap),
                ..PruneOptions::default()
            })
        };
        let leap = PlannerOptions {
            forward_leap_steps: PlannerOptions::default().forward_leap_steps,
            ..free.clone()
        };
        let expected = EdgeCost::Expected {
            disconnected_steps: 60.0,
        };
        let named = |name: &str, planner: PlannerOptions, is_calibrated| Self {
            name: name.to_owned(),
            planner,
            is_calibrated,
        };
        let averse = |lambda| cost(EdgeCost::RiskAverse { lambda });
        vec![
            named("as the file says", own.clone(), is_calibrated),
            named("argmax", cost(EdgeCost::Argmax), true),
            named("expected 60", cost(expected), true),
            named("expected 60, not calibrated", cost(expected), false),
            named("risk_averse 3", averse(3.0), true),
            named("risk_averse 3, not calibrated", averse(3.0), false),
            named("risk_averse 10", averse(10.0), true),
            named("risk_averse 3, max_out_edges 8", capped(8), true),
            named("risk_averse 3, max_out_edges 2", capped(2), true),
            named("risk_averse 3, min_probability 0.8", probable(0.8), true),
            named("risk_averse 3, min_probability 0.95", probable(0.95), true),
            named("risk_averse 3, min_support 1", supported(1), true),
            named("risk_averse 3, min_support 2", supported(2), true),
            named("risk_averse 3, forward_leap_steps 3", leap, true),
        ]
    }
}

/// A composition on a graph of replayed demonstrations.
pub(super) struct Judged<'a> {
    pub(super) calibrated: &'a Arc<TopologicalGraph>,
    pub(super) uncalibrated: &'a Arc<TopologicalGraph>,
    pub(super) truth: &'a GraphTruth<'a>,
    pub(super) automaton: &'a Automaton,
    pub(super) final_choice: &'a FinalChoice,
}

impl Judged<'_> {
    pub(super) fn effect(&self, options: EdgeOptions) -> Result<OptionEffect, ExperimentError> {
        let graph = if options.is_calibrated {
            self.calibrated
        } else {
            self.uncalibrated
        };
        let planner = Planner::new(
            Arc::clone(graph),
            self.automaton,
            self.final_choice,
            options.planner.clone(),
        )?;
        let used = self
            .truth
            .edges
            .iter()
            .filter(|((from, to), _)| planner.may_use(*from, *to));
        let d_max = graph.d_max() as u32;
        let (mut learned_edges, mut cross_task_edges) = (0, 0);
        let (mut false_edges, mut wormholes) = (0, 0);
        for (_, edge) in used {
            learned_edges += usize::from(edge.kind == EdgeKind::Learned);
            cross_task_edges += usize::from(edge.kind == EdgeKind::CrossTask);
            false_edges += usize::from(is_false(edge.wide, d_max));
            wormholes += usize::from(is_wormhole(edge.wide, d_max));
        }
        let share = |count: usize| count as f64 / (learned_edges + cross_task_edges).max(1) as f64;
        let first = self.automaton.tasks().first();
        let starts: Vec<NodeId> = graph
            .nodes()
            .filter(|(_, n)| n.step == 0 && Some(&n.task) == first)
            .map(|(id, _)| id)
            .collect();
        let plans = starts.iter().filter_map(|s| planner.plan_from(*s).ok());
        let plans: Vec<PlanTruth> = plans.map(|plan| self.judge(&plan)).collect();
        let mean = |value: fn(&PlanTruth) -> f64| {
            plans.iter().map(value).sum::<f64>() / plans.len().max(1) as f64
        };
        Ok(OptionEffect {
            learned_edges,
            cross_task_edges,
            false_share: share(false_edges),
            wormhole_share: share(wormholes),
            starts: starts.len(),
            plans: plans.len(),
            plans_over_false_edges: plans.iter().filter(|p| p.false_edges > 0).count(),
            mean_cost: mean(|p| p.cost),
            mean_claimed_steps: mean(|p| f64::from(p.claimed_steps)),
            mean_true_steps: mean(|p| f64::from(p.true_steps)),
            mean_false_edges: mean(|p| f64::from(p.false_edges)),
            mean_wormholes: mean(|p| f64::from(p.wormholes)),
            options,
        })
    }

    fn judge(&self, plan: &Plan) -> PlanTruth {
        let mut truth = PlanTruth {
            cost: plan.cost,
            claimed_steps: plan.steps,
            true_steps: 0,
            false_edges: 0,
            wormholes: 0,
        };
        let d_max = self.calibrated.d_max() as u32;
        for pair in plan.route.windows(2) {
            let Some(edge) = self.truth.edges.get(&(pair[0], pair[1])) else {
                // A temporal edge.
                truth.true_steps += 1;
                continue;
            };
            // An edge that leads nowhere has no number of steps.
            truth.true_steps += edge.wide.unwrap_or(0);
            truth.false_edges += u32::from(is_false(edge.wide, d_max));
            truth.wormholes += u32::from(is_wormhole(edge.wide, d_max));
        }
        truth
    }
}

struct PlanTruth {
    cost: f64,
    claimed_steps: u32,
    true_steps: u32,
    false_edges: u32,
    wormholes: u32,
}
