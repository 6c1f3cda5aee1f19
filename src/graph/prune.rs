use std::collections::{BTreeMap, HashSet};

use serde::{Deserialize, Serialize};

use super::scoring::keep_most_probable_edges;
use super::{Edge, EdgeKind, NodeId, TopologicalGraph};

/// Which predicted edges stay; temporal edges always do.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PruneOptions {
    /// Least probability (0..=1) of being connected, for learned and cross-task edges.
    pub min_probability: f32,
    /// At most this many learned edges leave a node, the most probable ones. Cross-task edges
    /// are counted apart.
    pub max_out_edges: Option<usize>,
    /// At least so many of the two neighbouring edges (from the state before to the state before, from
    /// the state after to the state after) must exist, 0..=2: a true way between two demonstrations
    /// runs beside them for a while, a chance likeness stands alone. Order of time counts.
    pub min_support: u32,
}

impl PruneOptions {
    /// Whether every edge stays.
    #[must_use]
    pub fn keeps_all(&self) -> bool {
        *self == Self::default()
    }
}

/// The same nodes and temporal edges with fewer predicted edges.
#[must_use]
pub fn prune(graph: &TopologicalGraph, options: &PruneOptions) -> TopologicalGraph {
    let mut pruned = TopologicalGraph::new(graph.latents().dim(), graph.d_max());
    for (id, node) in graph.nodes() {
        pruned.add_node(node.clone(), graph.latents().row(id.index()));
    }
    for (from, to, edge) in kept(graph, options) {
        pruned.push_edge(from, to, edge);
    }
    pruned
}

/// The predicted edges that [`prune`] would leave out, by their ends.
#[must_use]
pub fn left_out(graph: &TopologicalGraph, options: &PruneOptions) -> HashSet<(NodeId, NodeId)> {
    if options.keeps_all() {
        return HashSet::new();
    }
    let kept = kept(graph, options);
    let kept: HashSet<_> = kept.iter().map(|(from, to, _)| (*from, *to)).collect();
    graph
        .edges()
        .map(|(from, to, _)| (from, to))
        .filter(|ends| !kept.contains(ends))
        .collect()
}

/// The edges that stay: all temporal ones whatever the options, and the predicted ones that satisfy them.
fn kept(graph: &TopologicalGraph, options: &PruneOptions) -> Vec<(NodeId, NodeId, Edge)> {
    let predicted: HashSet<(NodeId, NodeId)> = graph
        .edges()
        .filter(|(_, _, e)| e.kind != EdgeKind::Temporal)
        .map(|(from, to, _)| (from, to))
        .collect();
    let mut groups: BTreeMap<_, Vec<(NodeId, NodeId, Edge)>> = BTreeMap::new();
    for (from, to, edge) in graph.edges() {
        let stays = edge.kind == EdgeKind::Temporal
            || (edge.connected_probability() >= options.min_probability
                && support(graph, &predicted, from, to) >= options.min_support);
        if stays {
            groups
                .entry((from, edge.kind))
                .or_default()
                .push((from, to, edge.clone()));
        }
    }
    let mut all = Vec::new();
    for ((_, kind), mut edges) in groups {
        if let (Some(cap), true) = (options.max_out_edges, kind != EdgeKind::Temporal) {
            keep_most_probable_edges(&mut edges, cap);
        }
        all.append(&mut edges);
    }
    all
}

fn support(
    graph: &TopologicalGraph,
    predicted: &HashSet<(NodeId, NodeId)>,
    from: NodeId,
    to: NodeId,
) -> u32 {
    [-1, 1]
        .into_iter()
        .filter(|by| {
            let pair = neighbour(graph, from, *by).zip(neighbour(graph, to, *by));
            pair.is_some_and(|p| predicted.contains(&p))
        })
        .count() as u32
}

/// The state one step before or after in the same demonstration; a demonstration's nodes have
/// successive ids.
fn neighbour(graph: &TopologicalGraph, node: NodeId, by: i64) -> Option<NodeId> {
    let id = u32::try_from(i64::from(node.0) + by).ok()?;
    if id as usize >= graph.node_count() {
        return None;
    }
    let (a, b) = (graph.node(node), graph.node(NodeId(id)));
    let follows = i64::from(b.step) == i64::from(a.step) + by;
    (follows && a.trajectory == b.trajectory && a.task == b.task).then_some(NodeId(id))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::fakes::{add_demonstration, task};

    #[test]
    fn lonely_edge_goes_and_parallel_ones_stay() {
        let mut graph = TopologicalGraph::new(1, 4);
        let task = task("a", &["done"]);
        let line = |from: f32| (0..6).map(|i| vec![from + i as f32]).collect::<Vec<_>>();
        let a = add_demonstration(&mut graph, &task, "x", &line(0.0), &[5]);
        let b = add_demonstration(&mut graph, &task, "y", &line(10.0), &[5]);
        let learned = Edge::predicted(EdgeKind::Learned, &[0.7, 0.1, 0.1, 0.1]);
        for i in 0..3 {
            graph.add_edge(a[i], b[i + 1], learned.clone());
        }
        graph.add_edge(a[5], b[0], learned);
        let options = PruneOptions {
            min_support: 1,
            ..PruneOptions::default()
        };
        let pruned = prune(&graph, &options);
        assert!(pruned.edge(a[5], b[0]).is_none());
        assert!((0..3).all(|i| pruned.edge(a[i], b[i + 1]).is_some()));
        assert_eq!(pruned.edge_count(), 10 + 3);
        assert_eq!(left_out(&graph, &options), [(a[5], b[0])].into());
    }

    #[test]
    fn temporal_edges_stay_whatever_is_asked() {
        let mut graph = TopologicalGraph::new(1, 4);
        let task = task("a", &["done"]);
        let line: Vec<Vec<f32>> = (0..6).map(|i| vec![i as f32]).collect();
        let a = add_demonstration(&mut graph, &task, "x", &line, &[5]);
        let learned = Edge::predicted(EdgeKind::Learned, &[0.9, 0.05, 0.05, 0.0]);
        for (from, to) in [(0, 2), (0, 3), (1, 3), (4, 1)] {
            graph.add_edge(a[from], a[to], learned.clone());
        }
        let strictest = PruneOptions {
            min_probability: 1.0,
            max_out_edges: Some(0),
            min_support: 2,
        };
        let pruned = prune(&graph, &strictest);
        assert_eq!(pruned.edge_count(), 5);
        assert!(pruned.edges().all(|(_, _, e)| e.kind == EdgeKind::Temporal));
        assert!(a.windows(2).all(|ab| pruned.edge(ab[0], ab[1]).is_some()));
        assert_eq!(left_out(&graph, &strictest).len(), 4);
        assert!(left_out(&graph, &PruneOptions::default()).is_empty());
    }
}
