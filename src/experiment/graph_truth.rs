use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{ExperimentError, RecordedState, Replay, TrueSteps};
use crate::graph::{EdgeKind, NodeId, TopologicalGraph};

/// How near is there: one primitive in every direction, so that what is called false is so whatever grid of primitives a
/// robot happens to be on.
pub(super) const WIDE_TOLERANCE: f64 = 1.0;
/// The other bound: as near as a robot of primitives can be brought.
pub(super) const NARROW_TOLERANCE: f64 = 0.5;

/// The true steps of one predicted edge; `None` where no number of steps leads there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EdgeTruth {
    pub(super) kind: EdgeKind,
    pub(super) claimed: u32,
    /// To within one primitive.
    pub(super) wide: Option<u32>,
    /// To within half a primitive.
    pub(super) narrow: Option<u32>,
}

/// The true steps of all predicted edges of a graph whose demonstrations were replayed.
pub(super) struct GraphTruth<'a> {
    graph: &'a TopologicalGraph,
    states: Vec<RecordedState>,
    pub(super) wide: TrueSteps<'a>,
    pub(super) narrow: TrueSteps<'a>,
    pub(super) edges: HashMap<(NodeId, NodeId), EdgeTruth>,
}

impl<'a> GraphTruth<'a> {
    pub(super) fn new(
        graph: &'a TopologicalGraph,
        replays: &'a [Replay],
    ) -> Result<Self, ExperimentError> {
        let mut truth = Self {
            graph,
            states: states(graph, replays)?,
            wide: TrueSteps::new(replays, WIDE_TOLERANCE),
            narrow: TrueSteps::new(replays, NARROW_TOLERANCE),
            edges: HashMap::new(),
        };
        let predicted: Vec<(NodeId, NodeId, EdgeKind, u32)> = graph
            .edges()
            .filter(|(_, _, edge)| edge.kind != EdgeKind::Temporal)
            .map(|(from, to, edge)| (from, to, edge.kind, edge.steps))
            .collect();
        truth.edges = predicted
            .into_par_iter()
            .map(|(from, to, kind, claimed)| {
                let (a, b) = (truth.state(from), truth.state(to));
                // A task that is done several times has a seam with itself.
                let steps = |truth: &TrueSteps<'_>| match kind {
                    EdgeKind::CrossTask => truth.across_seam(a, b),
                    EdgeKind::Temporal | EdgeKind::Learned => truth.between(a, b),
                };
                let found = EdgeTruth {
                    kind,
                    claimed,
                    wide: steps(&truth.wide),
                    narrow: steps(&truth.narrow),
                };
                ((from, to), found)
            })
            .collect();
        Ok(truth)
    }

    pub(super) fn state(&self, node: NodeId) -> RecordedState {
        self.states[node.index()]
    }

    /// Predicted edges by kind and tasks.
    pub(super) fn tallies(&self) -> Vec<EdgeTally> {
        let d_max = self.graph.d_max() as u32;
        let mut groups: BTreeMap<(EdgeKind, &str, &str), Vec<EdgeTruth>> = BTreeMap::new();
        for ((from, to), truth) in &self.edges {
            let tasks = [*from, *to].map(|n| self.graph.node(n).task.as_str());
            let group = groups.entry((truth.kind, tasks[0], tasks[1]));
            group.or_default().push(*truth);
        }
        groups
            .into_iter()
            .map(|((kind, from_task, to_task), edges)| EdgeTally {
                kind,
                from_task: from_task.to_owned(),
                to_task: to_task.to_owned(),
                edges: edges.len(),
                within_one_primitive: FalseEdges::count(&edges, |e| e.wide, d_max),
                within_half_a_primitive: FalseEdges::count(&edges, |e| e.narrow, d_max),
            })
            .collect()
    }
}

/// Which recorded state each node is.
fn states(
    graph: &TopologicalGraph,
    replays: &[Replay],
) -> Result<Vec<RecordedState>, ExperimentError> {
    let index: HashMap<(&str, &str), usize> = replays
        .iter()
        .enumerate()
        .map(|(i, r)| ((r.task.name(), r.recording.as_str()), i))
        .collect();
    graph
        .nodes()
        .map(|(_, node)| {
            let replay = index.get(&(node.task.as_str(), node.trajectory.as_str()));
            let step = node.step as usize;
            replay
                .filter(|r| step < replays[**r].insights.len())
                .map(|r| RecordedState { replay: *r, step })
                .ok_or_else(|| ExperimentError::NotReplayed {
                    demonstration: node.trajectory.clone(),
                })
        })
        .collect()
}

/// Whether an edge that truly takes so many steps is false.
pub(super) fn is_false(steps: Option<u32>, d_max: u32) -> bool {
    steps.is_none_or(|s| s >= d_max)
}

/// Whether it is so by far.
pub(super) fn is_wormhole(steps: Option<u32>, d_max: u32) -> bool {
    is_false(steps, 2 * d_max)
}

/// How many edges between two tasks, or within one, claim what is not so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeTally {
    /// Within a task or between tasks.
    pub kind: EdgeKind,
    /// The task that is left.
    pub from_task: String,
    /// The task that is entered, the same for learned edges.
    pub to_task: String,
    /// Edges of this kind.
    pub edges: usize,
    /// What is false though a robot counts as arrived one primitive before the goal.
    pub within_one_primitive: FalseEdges,
    /// What is false if it must come as near as its primitives allow.
    pub within_half_a_primitive: FalseEdges,
}

/// False edges at one tolerance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FalseEdges {
    /// Edges that truly take `d_max` steps or more, or lead where no number of steps leads.
    pub count: usize,
    /// Their share (0..=1) of all.
    pub share: f64,
    /// Those of them that no number of steps brings about: another thing is held, another subgoal reached, the thing
    /// lies elsewhere.
    pub impossible: usize,
    /// Those of them that are impossible or truly take at least twice `d_max` steps.
    pub wormholes: usize,
    /// Edges that are no false ones, but take at least two steps more than they claim.
    pub understated: usize,
    /// Median of true steps minus claimed ones, the lower one of an even number; `None` where it is of an impossible edge.
    pub median_error_steps: Option<f64>,
}

impl FalseEdges {
    fn count(edges: &[EdgeTruth], steps: fn(&EdgeTruth) -> Option<u32>, d_max: u32) -> Self {
        let count = |is: &dyn Fn(&EdgeTruth, Option<u32>) -> bool| {
            edges.iter().filter(|e| is(e, steps(e))).count()
        };
        let false_edges = count(&|_, s| is_false(s, d_max));
        let mut errors: Vec<f64> = edges
            .iter()
            .map(|e| steps(e).map_or(f64::INFINITY, |s| f64::from(s) - f64::from(e.claimed)))
            .collect();
        errors.sort_by(f64::total_cmp);
        let median = errors.get(errors.len().saturating_sub(1) / 2).copied();
        Self {
            count: false_edges,
            share: false_edges as f64 / edges.len().max(1) as f64,
            impossible: count(&|_, s| s.is_none()),
            wormholes: count(&|_, s| is_wormhole(s, d_max)),
            understated: count(&|e, s| s.is_some_and(|s| s < d_max && s >= e.claimed + 2)),
            median_error_steps: median.filter(|m| m.is_finite()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn false_edges_by_hand() {
        let edge = |claimed, wide| EdgeTruth {
            kind: EdgeKind::Learned,
            claimed,
            wide,
            narrow: None,
        };
        let edges = [
            edge(1, Some(1)),
            edge(1, Some(4)),
            edge(2, Some(5)),
            edge(2, Some(12)),
            edge(3, None),
        ];
        let found = FalseEdges::count(&edges, |e| e.wide, 5);
        assert_eq!((found.count, found.impossible, found.wormholes), (3, 1, 2));
        assert_eq!(found.understated, 1);
        assert_eq!(found.median_error_steps, Some(3.0));
        let all = FalseEdges::count(&edges, |e| e.narrow, 5);
        assert_eq!((all.share, all.median_error_steps), (1.0, None));
    }
}
