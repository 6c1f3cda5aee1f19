use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use petgraph::algo::{connected_components, kosaraju_scc};
use serde::Serialize;

use super::{EdgeKind, NodeId, ScoredPair, TopologicalGraph};
use crate::wording::{counted, grouped};

/// Numbers by which a person can judge a graph.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphStatistics {
    /// Number of states.
    pub node_count: usize,
    /// Edges between successive states.
    pub temporal_edges: usize,
    /// Predicted edges within tasks.
    pub learned_edges: usize,
    /// Predicted edges between tasks.
    pub cross_task_edges: usize,
    /// Parts that are not joined by any edge, whichever way edges point.
    pub components: usize,
    /// Size of the largest set of states that can all reach each other.
    pub largest_strong_component: usize,
    /// Mean number of edges that leave a node.
    pub mean_out_degree: f64,
    /// Largest number of edges that leave a node.
    pub max_out_degree: usize,
    /// Each task, in the order of its first node.
    pub tasks: Vec<TaskStatistics>,
    /// Each two tasks with an edge from one to the other.
    pub cross_task: Vec<CrossTaskStatistics>,
}

/// The states of one task.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct TaskStatistics {
    /// The task.
    pub task: String,
    /// Number of demonstrations.
    pub demonstrations: usize,
    /// Number of states.
    pub nodes: usize,
    /// States that can be final.
    pub end_states: usize,
    /// In how many demonstrations each subgoal is reached, by name.
    pub subgoals: BTreeMap<String, usize>,
}

/// The edges from one task to another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrossTaskStatistics {
    /// The task that is left.
    pub from_task: String,
    /// The task that is entered.
    pub to_task: String,
    /// Number of edges.
    pub edges: usize,
    /// The most probable edges, best first.
    pub best: Vec<CrossTaskEdge>,
}

/// One cross-task edge, in words that lead back to the recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CrossTaskEdge {
    /// The state that is left.
    pub from: NodeId,
    /// `demonstration:step` of the state that is left.
    pub from_state: String,
    /// The state that is entered.
    pub to: NodeId,
    /// `demonstration:step` of the state that is entered.
    pub to_state: String,
    /// Predicted time steps.
    pub steps: u32,
    /// Probability that it is passable in fewer than `d_max` steps.
    pub connected_probability: f32,
}

impl GraphStatistics {
    /// Counts; each two tasks list their `best` most probable edges.
    #[must_use]
    pub fn new(graph: &TopologicalGraph, best: usize) -> Self {
        let mut kinds = BTreeMap::new();
        let mut cross: BTreeMap<(&str, &str), Vec<ScoredPair>> = BTreeMap::new();
        let mut out_degrees = vec![0_usize; graph.node_count()];
        for (from, to, edge) in graph.edges() {
            *kinds.entry(edge.kind).or_insert(0) += 1;
            out_degrees[from.index()] += 1;
            if edge.kind == EdgeKind::CrossTask {
                let tasks = (graph.node(from).task.as_str(), graph.node(to).task.as_str());
                cross.entry(tasks).or_default().push(ScoredPair {
                    from,
                    to,
                    connected_probability: edge.connected_probability(),
                });
            }
        }
        let kind = |k| kinds.get(&k).copied().unwrap_or(0);
        Self {
            node_count: graph.node_count(),
            temporal_edges: kind(EdgeKind::Temporal),
            learned_edges: kind(EdgeKind::Learned),
            cross_task_edges: kind(EdgeKind::CrossTask),
            components: connected_components(graph.as_petgraph()),
            largest_strong_component: kosaraju_scc(graph.as_petgraph())
                .iter()
                .map(Vec::len)
                .max()
                .unwrap_or(0),
            mean_out_degree: graph.edge_count() as f64 / graph.node_count().max(1) as f64,
            max_out_degree: out_degrees.into_iter().max().unwrap_or(0),
            tasks: graph.tasks().iter().map(|t| task(graph, t)).collect(),
            cross_task: cross
                .into_iter()
                .map(|((a, b), pairs)| cross_task(graph, a, b, pairs, best))
                .collect(),
        }
    }
}

fn task(graph: &TopologicalGraph, name: &str) -> TaskStatistics {
    let nodes = || {
        graph
            .nodes()
            .filter(|(_, n)| n.task == name)
            .map(|(_, n)| n)
    };
    let mut subgoals = BTreeMap::new();
    for subgoal in nodes().flat_map(|n| &n.reached) {
        *subgoals.entry(subgoal.name.clone()).or_insert(0) += 1;
    }
    TaskStatistics {
        task: name.to_owned(),
        demonstrations: nodes()
            .map(|n| &n.trajectory)
            .collect::<BTreeSet<_>>()
            .len(),
        nodes: nodes().count(),
        end_states: nodes().filter(|n| n.is_end).count(),
        subgoals,
    }
}

fn cross_task(
    graph: &TopologicalGraph,
    from_task: &str,
    to_task: &str,
    mut pairs: Vec<ScoredPair>,
    best: usize,
) -> CrossTaskStatistics {
    pairs.sort_by(|a, b| {
        b.connected_probability
            .total_cmp(&a.connected_probability)
            .then((a.from, a.to).cmp(&(b.from, b.to)))
    });
    CrossTaskStatistics {
        from_task: from_task.to_owned(),
        to_task: to_task.to_owned(),
        edges: pairs.len(),
        best: pairs
            .iter()
            .take(best)
            .map(|p| CrossTaskEdge {
                from: p.from,
                from_state: graph.node(p.from).place(),
                to: p.to,
                to_state: graph.node(p.to).place(),
                steps: graph.edge(p.from, p.to).map_or(0, |e| e.steps),
                connected_probability: p.connected_probability,
            })
            .collect(),
    }
}

impl fmt::Display for GraphStatistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}, {} ({} temporal, {} learned, {} cross-task)",
            counted(self.node_count, "node"),
            counted(
                self.temporal_edges + self.learned_edges + self.cross_task_edges,
                "edge"
            ),
            grouped(self.temporal_edges),
            grouped(self.learned_edges),
            grouped(self.cross_task_edges)
        )?;
        writeln!(
            f,
            "{}, largest strongly connected part {}, out-degree {:.1} (at most {})",
            counted(self.components, "component"),
            counted(self.largest_strong_component, "node"),
            self.mean_out_degree,
            self.max_out_degree
        )?;
        for t in &self.tasks {
            let subgoals: Vec<String> = t
                .subgoals
                .iter()
                .map(|(name, count)| format!("{name} in {count}"))
                .collect();
            writeln!(
                f,
                "task {}: {}, {}, {}; {}",
                t.task,
                counted(t.demonstrations, "demonstration"),
                counted(t.nodes, "node"),
                counted(t.end_states, "end state"),
                if subgoals.is_empty() {
                    "no subgoals".to_owned()
                } else {
                    subgoals.join(", ")
                }
            )?;
        }
        for c in &self.cross_task {
            writeln!(
                f,
                "{} -> {}: {}",
                c.from_task,
                c.to_task,
                counted(c.edges, "edge")
            )?;
            for e in &c.best {
                writeln!(
                    f,
                    "  {} -> {}: {}, P(connected) {:.3}",
                    e.from_state,
                    e.to_state,
                    counted(e.steps as usize, "step"),
                    e.connected_probability
                )?;
            }
        }
        Ok(())
    }
}
