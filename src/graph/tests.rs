//! Building, and in `merging` merging, in a world whose distances are known.

use std::sync::Mutex;
use std::sync::atomic::Ordering;

use super::fakes::{
    BrokenEncoder, Oracle, PixelEncoder, add_demonstration, demonstrations, subgoal, task,
};
use super::*;
use crate::model::{Encoder, Latents, ModelError, ModelSpec};
use crate::task::Subgoal;
use crate::trajectory::State;

mod merging;

const D_MAX: usize = 5;

/// Walking along x on the same row takes a step each; there is no way back and none to other rows.
fn forward(a: &[f32], b: &[f32]) -> Option<u32> {
    ((a[1] - b[1]).abs() < 0.5 && b[0] >= a[0]).then(|| (b[0] - a[0]) as u32)
}

fn silent(_: GraphProgress) {}

fn line(start: u8, row: u8, steps: u8) -> Vec<[u8; 3]> {
    (0..steps).map(|i| [start + i, row, 0]).collect()
}

fn reached(at: &[usize]) -> Vec<(Subgoal, usize)> {
    let name = |i| subgoal("a", ["first", "second"][i]);
    at.iter().enumerate().map(|(i, s)| (name(i), *s)).collect()
}

fn two_lines(options: &BuildOptions) -> (TopologicalGraph, u64) {
    let set = demonstrations("a", &[line(0, 0, 8), line(2, 0, 6), line(0, 9, 3)]);
    let steps = [reached(&[3, 7]), reached(&[1, 5]), reached(&[1, 2])];
    let oracle = Oracle::new(D_MAX, forward);
    let graph = build(
        &set,
        &steps,
        &PixelEncoder::new(D_MAX),
        &oracle,
        options,
        &silent,
    );
    (
        graph.expect("the fakes fit").graph,
        oracle.pairs.load(Ordering::Relaxed),
    )
}

#[test]
fn nodes_know_their_subgoals_and_temporal_edges_join_successive_ones() {
    let (graph, _) = two_lines(&BuildOptions::default());
    assert_eq!(graph.node_count(), 17);
    let node = graph.node(NodeId(3));
    assert_eq!((node.step, node.progress, node.is_end), (3, 1, false));
    assert_eq!(node.reached, vec![subgoal("a", "first")]);
    assert_eq!(graph.node(NodeId(4)).reached, vec![]);
    assert!(graph.node(NodeId(7)).is_end && graph.node(NodeId(7)).progress == 2);
    let temporal = graph
        .edges()
        .filter(|(_, _, e)| e.kind == EdgeKind::Temporal);
    assert_eq!(temporal.count(), 7 + 5 + 2);
    assert!(graph.edge(NodeId(7), NodeId(8)).is_none());
}

#[test]
fn learned_edges_are_exactly_the_near_pairs_of_different_demonstrations() {
    let (graph, pairs) = two_lines(&BuildOptions::default());
    assert_eq!(pairs, 17 * 17 - (8 * 8 + 6 * 6 + 3 * 3));
    for (a, from) in graph.nodes() {
        for (b, to) in graph.nodes() {
            let (x, y) = (
                graph.latents().row(a.index()),
                graph.latents().row(b.index()),
            );
            let near = forward(x, y).filter(|s| (*s as usize) < D_MAX);
            let learned = graph.edge(a, b).filter(|e| e.kind == EdgeKind::Learned);
            let expected = near.filter(|_| from.trajectory != to.trajectory);
            assert_eq!(
                learned.map(|e| e.steps),
                expected.map(|s| s.max(1)),
                "{a:?} {b:?}"
            );
        }
    }
}

#[test]
fn same_trajectory_pairs_are_scored_only_when_asked_for() {
    let options = BuildOptions {
        learned: LearnedEdges {
            same_trajectory: true,
            ..LearnedEdges::default()
        },
        ..BuildOptions::default()
    };
    let (graph, _) = two_lines(&options);
    assert_eq!(graph.edge(NodeId(0), NodeId(2)).map(|e| e.steps), Some(2));
    assert_eq!(
        graph.edge(NodeId(0), NodeId(1)).map(|e| e.kind),
        Some(EdgeKind::Temporal)
    );
    assert!(graph.edge(NodeId(0), NodeId(0)).is_none());
}

#[test]
fn cap_keeps_the_most_probable_edges() {
    let options = BuildOptions {
        learned: LearnedEdges {
            max_out_edges: Some(2),
            ..LearnedEdges::default()
        },
        ..BuildOptions::default()
    };
    let (graph, _) = two_lines(&options);
    for (id, _) in graph.nodes() {
        let learned = graph
            .edges_from(id)
            .filter(|(_, e)| e.kind == EdgeKind::Learned);
        assert!(learned.count() <= 2);
    }
    let kept: Vec<u32> = graph.edges_from(NodeId(2)).map(|(_, e)| e.steps).collect();
    assert!(kept.contains(&1), "{kept:?}");
}

#[test]
fn same_graph_on_one_thread_and_on_many() {
    let edges = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let (graph, _) = pool.install(|| two_lines(&BuildOptions::default()));
        graph
            .edges()
            .map(|(a, b, e)| (a, b, e.clone()))
            .collect::<Vec<_>>()
    };
    assert_eq!(edges(1), edges(4));
}

#[test]
fn progress_counts_up_to_the_total() {
    let set = demonstrations("a", &[line(0, 0, 50), line(0, 0, 60)]);
    let seen = Mutex::new(Vec::new());
    let count = |p| seen.lock().unwrap().push(p);
    let oracle = Oracle::new(D_MAX, forward);
    let steps = [vec![], vec![]];
    let options = BuildOptions::default();
    build(
        &set,
        &steps,
        &PixelEncoder::new(D_MAX),
        &oracle,
        &options,
        &count,
    )
    .unwrap();
    let seen = seen.into_inner().unwrap();
    let most = |phase| {
        seen.iter()
            .filter(|p| p.phase == phase)
            .map(|p| (p.done, p.total))
            .max()
    };
    assert_eq!(most(GraphPhase::Encode), Some((110, 110)));
    assert_eq!(most(GraphPhase::Score), Some((6000, 6000)));
}

#[test]
fn inputs_that_do_not_fit_are_refused() {
    let set = demonstrations("a", &[line(0, 0, 4)]);
    let oracle = Oracle::new(D_MAX, forward);
    let build_with = |steps: &[Vec<(Subgoal, usize)>], d_max| {
        let options = BuildOptions::default();
        build(
            &set,
            steps,
            &PixelEncoder::new(d_max),
            &oracle,
            &options,
            &silent,
        )
        .unwrap_err()
    };
    assert!(matches!(
        build_with(&[], D_MAX),
        GraphError::SubgoalLists {
            expected: 1,
            found: 0,
            ..
        }
    ));
    let beyond = build_with(&[reached(&[4])], D_MAX);
    assert!(matches!(
        beyond,
        GraphError::SubgoalOutOfRange {
            step: 4,
            steps: 4,
            ..
        }
    ));
    let other = build_with(&[vec![]], 6);
    assert!(matches!(
        other,
        GraphError::DMaxDiffers {
            expected: 6,
            found: 5,
            ..
        }
    ));
}

#[test]
fn a_state_whose_latent_is_no_number_is_refused_with_its_place() {
    let set = demonstrations("a", &[line(0, 0, 4), line(0, 9, 3)]);
    let encoder = BrokenEncoder::new(D_MAX, [2, 9]);
    let oracle = Oracle::new(D_MAX, forward);
    let steps = [reached(&[3]), reached(&[2])];
    let built = build(
        &set,
        &steps,
        &encoder,
        &oracle,
        &BuildOptions::default(),
        &silent,
    );
    let error = built.unwrap_err().to_string();
    for part in ["'a'", "'a_1'", "step 2", "NaN", "train or export it again"] {
        assert!(error.contains(part), "{error}");
    }
}

/// Gives so many rows of so many values, whatever it says of itself and is asked.
struct CarelessEncoder {
    says: PixelEncoder,
    rows: usize,
    values: usize,
}

impl Encoder for CarelessEncoder {
    fn spec(&self) -> &ModelSpec {
        self.says.spec()
    }

    fn encode(&self, _: &[State]) -> Result<Latents, ModelError> {
        let zeros = vec![0.0; self.rows * self.values];
        Ok(Latents::from_values(self.values, zeros))
    }
}

#[test]
fn an_encoder_that_does_not_give_what_it_says_is_refused() {
    let set = demonstrations("a", &[line(0, 0, 4)]);
    let oracle = Oracle::new(D_MAX, forward);
    for (rows, values, said) in [
        (4, 2, "have 2 values, the model expects 3"),
        (3, 3, "have 9 values, the model expects 12"),
        (5, 3, "have 15 values, the model expects 12"),
    ] {
        let encoder = CarelessEncoder {
            says: PixelEncoder::new(D_MAX),
            rows,
            values,
        };
        let options = BuildOptions::default();
        let built = build(&set, &[vec![]], &encoder, &oracle, &options, &silent);
        let error = built.unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

#[test]
fn nearest_candidates_find_the_edges_of_the_exhaustive_build_with_fewer_pairs() {
    let set = demonstrations(
        "a",
        &[
            line(0, 0, 60),
            line(2, 0, 60),
            line(1, 1, 60),
            line(0, 9, 60),
        ],
    );
    let build_with = |candidates| {
        let options = BuildOptions {
            candidates,
            ..BuildOptions::default()
        };
        let oracle = Oracle::new(D_MAX, forward);
        let encoder = PixelEncoder::new(D_MAX);
        let steps = vec![vec![]; 4];
        let built = build(&set, &steps, &encoder, &oracle, &options, &silent);
        (
            built.expect("the fakes fit"),
            oracle.pairs.load(Ordering::Relaxed),
        )
    };
    let (all, every_pair) = build_with(PairCandidates::All);
    assert_eq!(all.report.scored_pairs, all.report.all_pairs);
    assert_eq!(
        (all.report.recall, every_pair),
        (None, all.report.all_pairs)
    );
    let (near, pairs) = build_with(PairCandidates::Nearest {
        share: 0.1,
        sample: 0.3,
    });
    assert_eq!(near.report.scored_pairs, pairs);
    assert!(pairs < every_pair / 3, "{pairs} of {every_pair}");
    let found = all
        .graph
        .edges()
        .filter(|(a, b, _)| near.graph.edge(*a, *b).is_some());
    let recall = found.count() as f64 / all.graph.edge_count() as f64;
    assert!(recall > 0.9, "{recall}");
    let measured = near.report.recall.expect("it is measured");
    assert!(
        (measured - recall).abs() < 0.15,
        "{measured} measured, {recall} true"
    );
    let edges = near.graph.edges();
    for (a, b, edge) in edges {
        assert_eq!(
            all.graph.edge(a, b),
            Some(edge),
            "no edge that is not there otherwise"
        );
    }
}
