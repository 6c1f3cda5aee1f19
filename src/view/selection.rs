//! Which edges are drawn where there are too many to see.

use std::collections::BTreeMap;

use super::layout::GraphLayout;
use crate::graph::{Edge, EdgeKind, NodeId, TopologicalGraph};

/// An edge with the nodes that it joins.
pub(super) type Ends<'a> = (NodeId, NodeId, &'a Edge);

/// All edges of a kind.
pub(super) fn of_kind(graph: &TopologicalGraph, kind: EdgeKind) -> Vec<Ends<'_>> {
    graph.edges().filter(|(.., e)| e.kind == kind).collect()
}

/// At most `most` edges, evenly over the list.
pub(super) fn spread<'a>(edges: &[Ends<'a>], most: usize) -> Vec<Ends<'a>> {
    let shown = edges.len().min(most);
    (0..shown).map(|i| edges[i * edges.len() / shown]).collect()
}

/// At most `most` edges, the most probable ones from each task to each other one, so that every seam
/// shows; the most probable last.
pub(super) fn most_probable_of_each_pair<'a>(
    layout: &GraphLayout,
    edges: &[Ends<'a>],
    most: usize,
) -> Vec<Ends<'a>> {
    let mut pairs: BTreeMap<(usize, usize), Vec<Ends<'a>>> = BTreeMap::new();
    for ends in edges {
        let pair = (
            layout.block_of[ends.0.index()],
            layout.block_of[ends.1.index()],
        );
        pairs.entry(pair).or_default().push(*ends);
    }
    let share = most / pairs.len().max(1);
    let shown: Vec<Ends<'a>> = pairs
        .values()
        .flat_map(|edges| most_probable(edges, share))
        .collect();
    most_probable(&shown, most)
}

/// At most `most` edges, those of the highest probability, the most probable last.
fn most_probable<'a>(edges: &[Ends<'a>], most: usize) -> Vec<Ends<'a>> {
    let mut edges = edges.to_vec();
    edges.sort_by(|a, b| {
        a.2.connected_probability()
            .total_cmp(&b.2.connected_probability())
    });
    edges.split_off(edges.len().saturating_sub(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_spread_and_the_most_probable_come_last() {
        let edges: Vec<Edge> = (0..10)
            .map(|i| Edge {
                kind: EdgeKind::CrossTask,
                steps: 1,
                probabilities: vec![
                    ((i * 7) % 10) as f32 / 10.0,
                    1.0 - ((i * 7) % 10) as f32 / 10.0,
                ],
            })
            .collect();
        let ends: Vec<Ends<'_>> = edges.iter().map(|e| (NodeId(0), NodeId(1), e)).collect();
        let of =
            |ends: &[Ends<'_>]| -> Vec<f32> { ends.iter().map(|e| e.2.probabilities[0]).collect() };
        assert_eq!(of(&most_probable(&ends, 3)), [0.7, 0.8, 0.9]);
        assert_eq!(of(&spread(&ends, 2)), [of(&ends)[0], of(&ends)[5]]);
        assert_eq!(spread(&ends, 99).len(), 10);
        assert!(spread(&[], 5).is_empty());
    }
}
