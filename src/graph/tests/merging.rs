use super::*;

/// Two tasks on one row: `a` ends at 9, `b` starts at 10; the second demonstration of `b` is elsewhere.
fn two_tasks() -> (TopologicalGraph, TopologicalGraph) {
    let row = |from: u8, to: u8, y: u8| {
        (from..to)
            .map(|x| vec![f32::from(x), f32::from(y), 0.0])
            .collect::<Vec<_>>()
    };
    let (mut a, mut b) = (
        TopologicalGraph::new(3, D_MAX),
        TopologicalGraph::new(3, D_MAX),
    );
    add_demonstration(&mut a, &task("a", &["done"]), "a0", &row(0, 10, 0), &[9]);
    add_demonstration(&mut b, &task("b", &["done"]), "b0", &row(10, 20, 0), &[9]);
    add_demonstration(&mut b, &task("b", &["done"]), "b1", &row(0, 10, 7), &[9]);
    (a, b)
}

fn merge_with(options: &MergeOptions) -> Merged {
    let (a, b) = two_tasks();
    let oracle = Oracle::new(D_MAX, forward);
    merge(&[&a, &b], None, &oracle, options, &silent).expect("the graphs fit")
}

#[test]
fn merging_keeps_all_and_finds_the_seam() {
    let options = MergeOptions {
        seam_floor: 0,
        candidates: CrossTaskCandidates::Seam { window_steps: 3 },
        ..MergeOptions::default()
    };
    let merged = merge_with(&options);
    assert_eq!(merged.graph.node_count(), 30);
    assert_eq!(merged.graph.tasks(), ["a", "b"]);
    assert_eq!(merged.report.pair_count, 3 * 6);
    let seam = &merged.report.seams[0];
    // 7, 8, 9 to 10, 11, 12 of the same row, where they are less than 5 apart.
    assert_eq!((seam.accepted, seam.below_rule), (8, 0));
    assert_eq!(
        merged.graph.edge(NodeId(9), NodeId(10)).map(|e| e.steps),
        Some(1)
    );
    let statistics = GraphStatistics::new(&merged.graph, 2);
    assert_eq!(
        (statistics.temporal_edges, statistics.cross_task_edges),
        (27, 8)
    );
    assert_eq!(statistics.components, 2);
    let text = statistics.to_string();
    assert!(
        text.contains("task b: 2 demonstrations, 20 nodes, 2 end states; done in 2"),
        "{text}"
    );
    assert!(text.contains("a -> b: 8 edges"), "{text}");
}

#[test]
fn floor_keeps_improbable_seam_edges_with_their_probabilities() {
    let options = MergeOptions {
        seam_floor: 12,
        ..MergeOptions::default()
    };
    let merged = merge_with(&options);
    let seam = &merged.report.seams[0];
    assert_eq!(seam.accepted + seam.below_rule, 12);
    let weak = merged
        .graph
        .edges()
        .filter(|(_, _, e)| e.connected_probability() < 0.5);
    assert_eq!(weak.count(), seam.below_rule);
    assert!(seam.near_misses[0].connected_probability < 0.5);
}

#[test]
fn all_candidates_and_a_large_sample_find_the_same_edges() {
    let edges = |candidates| {
        let merged = merge_with(&MergeOptions {
            candidates,
            seam_floor: 0,
            ..MergeOptions::default()
        });
        let mut edges: Vec<_> = merged
            .graph
            .edges()
            .filter(|(_, _, e)| e.kind == EdgeKind::CrossTask)
            .map(|(a, b, e)| (a, b, e.steps))
            .collect();
        edges.sort_unstable();
        edges
    };
    let sample = CrossTaskCandidates::SeamAndSample {
        window_steps: 2,
        pairs: 20_000,
        seed: 7,
    };
    let all = edges(CrossTaskCandidates::All);
    assert_eq!(all.len(), 4 + 3 + 2 + 1);
    assert_eq!(edges(sample), all);
}

#[test]
fn a_task_that_follows_itself_has_a_seam_also_where_all_pairs_are_scored() {
    let mut twice = TopologicalGraph::new(3, D_MAX);
    for (id, start) in [("a0", 0_u8), ("a1", 20)] {
        let points = (start..start + 20).map(|x| vec![f32::from(x), 0.0, 0.0]);
        let points: Vec<Vec<f32>> = points.collect();
        add_demonstration(&mut twice, &task("a", &["done"]), id, &points, &[19]);
    }
    let (_, b) = two_tasks();
    let oracle = Oracle::new(D_MAX, forward);
    let merged = |candidates| {
        let options = MergeOptions {
            candidates,
            seam_floor: 0,
            ..MergeOptions::default()
        };
        let again = [("a", "a")];
        merge(&[&twice, &b], Some(&again), &oracle, &options, &silent).expect("the graphs fit")
    };
    let all = merged(CrossTaskCandidates::All);
    let seams = merged(CrossTaskCandidates::Seam { window_steps: 10 });
    assert_eq!(all.report.seams, seams.report.seams);
    let seam = &all.report.seams[0];
    assert_eq!((seam.from_task.as_str(), seam.to_task.as_str()), ("a", "a"));
    // 16 to 19 of the first demonstration to 20 to 23 of the second, where they are less than 5 apart.
    assert_eq!(seam.accepted, 10);
    let kind = |from, to| all.graph.edge(NodeId(from), NodeId(to)).map(|e| e.kind);
    assert_eq!(kind(19, 20), Some(EdgeKind::CrossTask));
    assert_eq!(kind(18, 19), Some(EdgeKind::Temporal));
    assert_eq!(kind(5, 7), None);
}

#[test]
fn tasks_none_of_which_follows_another_have_no_seam() {
    let (a, b) = two_tasks();
    let oracle = Oracle::new(D_MAX, forward);
    let options = MergeOptions::default();
    let merged = merge(&[&a, &b], Some(&[]), &oracle, &options, &silent).expect("the graphs fit");
    assert_eq!(merged.report, MergeReport::default());
    assert_eq!(merged.graph.tasks(), ["a", "b"]);
    let kinds = merged.graph.edges().map(|(_, _, edge)| edge.kind);
    assert_eq!(kinds.filter(|kind| *kind != EdgeKind::Temporal).count(), 0);
}

#[test]
fn a_merged_graph_is_merged_with_another_as_its_parts_are() {
    let (a, b) = two_tasks();
    let mut c = TopologicalGraph::new(3, D_MAX);
    let row: Vec<Vec<f32>> = (20..30_u8).map(|x| vec![f32::from(x), 0.0, 0.0]).collect();
    add_demonstration(&mut c, &task("c", &["done"]), "c0", &row, &[9]);
    let oracle = Oracle::new(D_MAX, forward);
    let options = MergeOptions::default();
    let merged = |graphs: &[&TopologicalGraph]| {
        let merged = merge(graphs, None, &oracle, &options, &silent);
        merged.expect("the graphs fit").graph
    };
    let in_turn = merged(&[&merged(&[&a, &b]), &c]);
    assert_eq!(in_turn.ends_joined_twice(), None);
    let edges = |graph: &TopologicalGraph| {
        let edges = graph.edges().map(|(a, b, e)| (a, b, e.kind, e.steps));
        let mut edges: Vec<_> = edges.collect();
        edges.sort_unstable();
        edges
    };
    assert_eq!(edges(&in_turn), edges(&merged(&[&a, &b, &c])));
}

#[test]
fn merging_what_does_not_belong_together_is_refused() {
    let (a, _) = two_tasks();
    let oracle = Oracle::new(D_MAX, forward);
    let options = MergeOptions::default();
    let refused = |graphs: &[&TopologicalGraph], follows: Option<&[(&str, &str)]>| {
        merge(graphs, follows, &oracle, &options, &silent).unwrap_err()
    };
    assert_eq!(refused(&[], None), GraphError::NothingToMerge);
    assert_eq!(
        refused(&[&a, &a], None),
        GraphError::TaskTwice {
            task: "a".to_owned()
        }
    );
    assert!(matches!(
        refused(&[&a], Some(&[("a", "c")])),
        GraphError::UnknownTask { .. }
    ));
    let mut other = TopologicalGraph::new(4, D_MAX);
    add_demonstration(
        &mut other,
        &task("c", &["done"]),
        "c0",
        &[vec![0.0; 4]],
        &[0],
    );
    assert!(matches!(
        refused(&[&a, &other], None),
        GraphError::LatentLengthDiffers {
            expected: 3,
            found: 4,
            ..
        }
    ));
    let mut longer = TopologicalGraph::new(3, 7);
    let states = [vec![0.0; 3], vec![1.0; 3]];
    add_demonstration(&mut longer, &task("c", &["done"]), "c0", &states, &[1]);
    assert!(matches!(
        refused(&[&longer], None),
        GraphError::DMaxDiffers { found: 7, .. }
    ));
    let empty = TopologicalGraph::new(3, D_MAX);
    let error = refused(&[&a, &empty], None).to_string();
    assert!(
        error.contains("graph 2 of those to merge has no states"),
        "{error}"
    );
}
