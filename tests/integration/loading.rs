//! Compositions that are loaded through the library, with the shipped model and graphs.

use std::path::Path;

use catena::composer::{Calibration, Composition, FoundBy, TaskSpec, load_task};
use catena::graph::{CrossTaskCandidates, EdgeKind, MergeOptions, TopologicalGraph};
use catena::inference::EngineChoice;
use catena::loading::{LoadError, LoadedComposition};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Sock and trash, merged at a narrow seam.
fn loaded(calibration: Calibration) -> LoadedComposition {
    let task = |name: &str| {
        let file = root().join(format!("tasks/{name}.yaml"));
        load_task(&file, root()).expect("a shipped task")
    };
    let composition = Composition::builder("sock_then_trash")
        .task(task("sock"))
        .task(task("trash"))
        .calibration(calibration)
        .build()
        .expect("a sound composition");
    let options = MergeOptions {
        candidates: CrossTaskCandidates::Seam { window_steps: 1 },
        ..MergeOptions::default()
    };
    LoadedComposition::load_with(composition, EngineChoice::Auto, &options, &|_| {})
        .expect("the shipped model and graphs")
}

#[test]
fn a_composition_without_calibration_has_none_in_model_and_graph() {
    let calibrated = loaded(Calibration::Temperature);
    let plain = loaded(Calibration::None);
    let temperature = calibrated.model.temperature();
    assert!(temperature > 1.1, "the shipped model's is {temperature}");
    assert_eq!(plain.model.temperature(), 1.0);

    // Edges within tasks are those that were saved, without the temperature that they were built with.
    let undone = calibrated.graph.tempered(temperature);
    let within = |graph: &TopologicalGraph| {
        let edges = graph
            .edges()
            .filter(|(.., e)| e.kind != EdgeKind::CrossTask);
        let edges = edges.map(|(from, to, edge)| (from, to, edge.clone()));
        edges.collect::<Vec<_>>()
    };
    let edges = within(&plain.graph);
    assert!(edges == within(&undone));
    assert!(edges != within(&calibrated.graph));

    // Edges between tasks are predicted without it; they are the same to rounding.
    let mut compared = 0;
    for (from, to, edge) in plain.graph.edges() {
        let Some(other) = undone.edge(from, to) else {
            continue;
        };
        for (p, q) in edge.probabilities.iter().zip(&other.probabilities) {
            assert!((p - q).abs() < 1e-3, "{edge:?} and {other:?}");
        }
        compared += usize::from(edge.kind == EdgeKind::CrossTask);
    }
    assert!(compared > 0, "no cross-task edge to compare");
}

#[test]
fn a_loaded_composition_has_the_pictures_of_its_tasks_and_plans() {
    let loaded = loaded(Calibration::Temperature);
    for task in ["sock", "trash"] {
        assert!(loaded.images_of(task).is_some_and(|i| !i.is_empty()));
    }
    assert!(loaded.images_of("wine").is_none());
    let seams = loaded.merge_report.seams.iter();
    let seams: Vec<_> = seams.map(|s| (&s.from_task[..], &s.to_task[..])).collect();
    assert_eq!(seams, [("sock", "trash")]);
    let planner = loaded.own_planner().expect("a planner");
    assert_eq!(planner.graph().node_count(), loaded.graph.node_count());
}

#[test]
fn a_graph_of_other_subgoals_is_refused() {
    let task = TaskSpec::new("trash", "graphs/bedroom/trash")
        .model("graphs/bedroom/model")
        .subgoal("can_in_bin", FoundBy::Marker(None))
        .resolve(root())
        .expect("a sound task");
    let composition = Composition::single(task).expect("a sound composition");
    let error = LoadedComposition::load(composition, EngineChoice::Auto)
        .expect_err("the graph counts another subgoal");
    assert!(
        matches!(&error, LoadError::SubgoalsDiffer { task, built, .. }
            if task == "trash" && built == "can_grasped, can_in_bin"),
        "{error}"
    );
}

#[test]
fn folders_that_are_not_there_are_told_before_anything_is_loaded() {
    let task = TaskSpec::new("cup", "graphs/nowhere/cup")
        .model("graphs/nowhere/model")
        .subgoal("cup_in_sink", FoundBy::End)
        .resolve(root())
        .expect("a sound task");
    let composition = Composition::single(task).expect("a sound composition");
    let error = LoadedComposition::load(composition, EngineChoice::Auto)
        .expect_err("there are no such folders");
    assert!(
        matches!(&error, LoadError::Composer(faults) if faults.len() == 2),
        "{error}"
    );
}
