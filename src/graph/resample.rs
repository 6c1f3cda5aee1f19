use std::collections::HashMap;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::build::trajectory_spans;
use super::{GraphError, NodeId, TopologicalGraph};

/// Noise on the latents of copies, as a share of the root mean square of all latents.
const NOISE: f32 = 0.01;

/// A graph of exactly `states` nodes made of another's demonstrations, to see how costs grow with
/// their number.
///
/// Demonstrations are taken whole, tasks in turn; when all are used up they are taken again, as copies
/// whose latents differ by a little noise. Edges stay within a round of copies. The last demonstration
/// is cut off where the number is reached. The same seed gives the same graph.
///
/// # Errors
/// [`GraphError::TooFewStates`] when there is not room for one demonstration of each task.
pub fn resampled(
    graph: &TopologicalGraph,
    states: usize,
    seed: u64,
) -> Result<TopologicalGraph, GraphError> {
    let turns = in_turn(graph);
    let firsts = &turns[..graph.tasks().len().min(turns.len())];
    let least: usize = firsts
        .iter()
        .map(|(start, end)| (end - start) as usize)
        .sum();
    if states < least || turns.is_empty() {
        return Err(GraphError::TooFewStates {
            least: least.max(1),
            found: states,
        });
    }
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = NOISE * root_mean_square(graph.latents().values());
    let mut resampled = TopologicalGraph::new(graph.latents().dim(), graph.d_max());
    let mut round = 0;
    while resampled.node_count() < states {
        let mut copies = HashMap::new();
        for id in turns
            .iter()
            .flat_map(|(start, end)| *start..*end)
            .map(NodeId)
        {
            if resampled.node_count() == states {
                break;
            }
            let mut node = graph.node(id).clone();
            let mut latent = graph.latents().row(id.index()).to_vec();
            if round > 0 {
                node.trajectory = format!("{}#{round}", node.trajectory);
                for value in &mut latent {
                    *value += rng.random_range(-noise..=noise);
                }
            }
            copies.insert(id, resampled.add_node(node, &latent));
        }
        for (from, to, edge) in graph.edges() {
            if let (Some(from), Some(to)) = (copies.get(&from), copies.get(&to)) {
                resampled.push_edge(*from, *to, edge.clone());
            }
        }
        round += 1;
    }
    Ok(resampled)
}

/// The nodes of each demonstration: the first of each task, then the second of each, and so on.
fn in_turn(graph: &TopologicalGraph) -> Vec<(u32, u32)> {
    let mut spans = trajectory_spans(graph);
    spans.dedup();
    let mut counts: HashMap<&str, usize> = HashMap::new();
    let mut turns: Vec<(usize, (u32, u32))> = spans
        .iter()
        .map(|span| {
            let count = counts.entry(&graph.node(NodeId(span.0)).task).or_insert(0);
            *count += 1;
            (*count, *span)
        })
        .collect();
    turns.sort_by_key(|(turn, span)| (*turn, *span));
    turns.into_iter().map(|(_, span)| span).collect()
}

fn root_mean_square(values: &[f32]) -> f32 {
    let sum: f64 = values.iter().map(|v| f64::from(*v).powi(2)).sum();
    (sum / values.len().max(1) as f64).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::fakes::{add_demonstration, task};
    use crate::graph::{Edge, EdgeKind, GraphStatistics};

    fn two_tasks() -> TopologicalGraph {
        let mut graph = TopologicalGraph::new(1, 4);
        let line = |from: f32, steps: usize| -> Vec<Vec<f32>> {
            (0..steps).map(|i| vec![from + i as f32]).collect()
        };
        let [a, b] = [task("a", &["first"]), task("b", &["second"])];
        let first = add_demonstration(&mut graph, &a, "x", &line(1.0, 5), &[4]);
        add_demonstration(&mut graph, &a, "y", &line(11.0, 6), &[5]);
        let next = add_demonstration(&mut graph, &b, "z", &line(21.0, 4), &[3]);
        graph.add_edge(
            first[4],
            next[0],
            Edge::predicted(EdgeKind::CrossTask, &[0.7, 0.1, 0.1, 0.1]),
        );
        graph
    }

    #[test]
    fn fewer_states_are_whole_demonstrations_of_every_task() {
        let small = resampled(&two_tasks(), 9, 0).expect("one of each task fits");
        assert_eq!(small.node_count(), 9);
        assert_eq!(small.tasks(), ["a", "b"]);
        let ends = small.nodes().filter(|(_, node)| node.is_end).count();
        assert_eq!(ends, 2);
        assert_eq!(small.edge_count(), 4 + 3 + 1);
    }

    #[test]
    fn more_states_are_rounds_of_copies_that_differ_a_little() {
        let graph = two_tasks();
        let large = resampled(&graph, 34, 0).expect("there is room");
        assert_eq!(large.node_count(), 34);
        let copy = large
            .nodes()
            .find(|(_, n)| n.trajectory == "x#1" && n.step == 2);
        let (copy, _) = copy.expect("the second round has every demonstration");
        let (original, _) = large
            .nodes()
            .find(|(_, n)| n.trajectory == "x" && n.step == 2)
            .unwrap();
        let difference =
            large.latents().row(copy.index())[0] - large.latents().row(original.index())[0];
        assert!(difference != 0.0 && difference.abs() < 0.5, "{difference}");
        let crossing = GraphStatistics::new(&large, 0).cross_task_edges;
        assert_eq!(
            crossing, 2,
            "the third round is cut off before the second task"
        );
        let again = resampled(&graph, 34, 0).expect("there is room");
        assert_eq!(again.latents(), large.latents());
    }

    #[test]
    fn too_few_states_are_refused_with_the_least_number() {
        let refused = resampled(&two_tasks(), 8, 0);
        assert!(matches!(
            refused,
            Err(GraphError::TooFewStates { least: 9, found: 8 })
        ));
        let empty = resampled(&TopologicalGraph::new(1, 4), 8, 0);
        assert!(matches!(empty, Err(GraphError::TooFewStates { .. })));
    }
}
