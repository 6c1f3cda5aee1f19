//! Pairs of states with their true classes.

use std::collections::BTreeMap;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::graph_truth::GraphTruth;
use crate::graph::{NodeId, TopologicalGraph};

/// Pairs of different demonstrations that are judged, each task.
const SAMPLED_PAIRS: usize = 20_000;

/// The class of a number of steps.
pub(super) fn class_of(steps: Option<u32>, d_max: usize) -> usize {
    steps.map_or(d_max, |s| (s as usize).min(d_max)).max(1) - 1
}

/// A pair of nodes, its true class, and its weight.
pub(super) type Labelled = ((u32, u32), usize, f64);

/// Pairs of one demonstration by their distance in time, and a sample of pairs of two demonstrations of one task by the
/// simulator.
pub(super) fn labelled_pairs(
    graph: &TopologicalGraph,
    truth: &GraphTruth<'_>,
    rng: &mut ChaCha8Rng,
) -> (Vec<Labelled>, Vec<Labelled>) {
    let d_max = graph.d_max();
    let mut by_task: BTreeMap<&str, Vec<NodeId>> = BTreeMap::new();
    for (id, node) in graph.nodes() {
        by_task.entry(&node.task).or_default().push(id);
    }
    let (mut same, mut sampled) = (Vec::new(), Vec::new());
    for nodes in by_task.values() {
        for from in nodes {
            let of_one = |to: &&NodeId| {
                let (a, b) = (graph.node(*from), graph.node(**to));
                *to != from && a.trajectory == b.trajectory
            };
            same.extend(nodes.iter().filter(of_one).map(|to| {
                let gap = i64::from(graph.node(*to).step) - i64::from(graph.node(*from).step);
                let steps = u32::try_from(gap).ok();
                ((from.0, to.0), class_of(steps, d_max), 1.0)
            }));
        }
        let demonstrations: Vec<&str> = nodes
            .iter()
            .map(|n| graph.node(*n).trajectory.as_str())
            .collect();
        if demonstrations.iter().all(|d| *d == demonstrations[0]) {
            continue;
        }
        for _ in 0..SAMPLED_PAIRS {
            let (a, b) = loop {
                let pair = [0; 2].map(|_| rng.random_range(0..nodes.len()));
                if demonstrations[pair[0]] != demonstrations[pair[1]] {
                    break (nodes[pair[0]], nodes[pair[1]]);
                }
            };
            sampled.push((a, b));
        }
    }
    weigh_halves(&mut same, d_max);
    let other = sampled.into_par_iter().map(|(a, b)| {
        let steps = truth.wide.between(truth.state(a), truth.state(b));
        ((a.0, b.0), class_of(steps, d_max), 1.0)
    });
    (same, other.collect())
}

/// Half of the weight to near pairs, half to far ones.
fn weigh_halves(pairs: &mut [Labelled], d_max: usize) {
    let near = pairs.iter().filter(|p| p.1 + 1 < d_max).count();
    let far = pairs.len() - near;
    for pair in pairs {
        let count = if pair.1 + 1 < d_max { near } else { far };
        pair.2 = 0.5 / count as f64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_of_steps() {
        let classes = [Some(1), Some(4), Some(5), Some(30), None, Some(0)];
        let classes = classes.map(|steps| class_of(steps, 5));
        assert_eq!(classes, [0, 3, 4, 4, 4, 0]);
    }

    #[test]
    fn near_and_far_pairs_weigh_the_same() {
        let mut pairs = vec![((0, 1), 0, 1.0), ((0, 2), 4, 1.0), ((0, 3), 4, 1.0)];
        weigh_halves(&mut pairs, 5);
        let weights: Vec<f64> = pairs.iter().map(|p| p.2).collect();
        assert_eq!(weights, [0.5, 0.25, 0.25]);
    }
}
