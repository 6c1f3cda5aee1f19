use std::fs;

use super::*;
use crate::graph::NodeId;
use crate::storage::fixtures::{graph, picture};
use crate::storage::{GraphImages, ensure_same_model};
use crate::task::{Subgoal, Task};

fn manifest() -> GraphManifest {
    let subgoal = |name: &str| Subgoal {
        task: "sock".to_owned(),
        name: name.to_owned(),
    };
    let task = Task {
        name: "sock".to_owned(),
        subgoals: vec![subgoal("grasped"), subgoal("stowed")],
    };
    let options = serde_json::json!({ "encode_batch": 64 });
    GraphManifest::new(&[task], "aa11", "bb22", options)
}

fn assert_same(a: &TopologicalGraph, b: &TopologicalGraph) {
    assert!(a.nodes().eq(b.nodes()));
    assert!(a.edges().eq(b.edges()));
    assert_eq!(a.latents(), b.latents());
    assert_eq!(a.d_max(), b.d_max());
}

#[test]
fn graph_comes_back_as_it_was_saved() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("graphs/sock");
    let saved = save_graph(&folder, &graph(), &manifest()).unwrap();
    let (loaded, manifest) = load_graph(&folder).unwrap();
    assert_same(&loaded, &graph());
    assert_eq!(manifest, saved);
    assert_eq!((manifest.node_count, manifest.edge_count), (20, 20));
    assert_eq!((manifest.latent_dim, manifest.d_max), (6, 5));
    assert_eq!(Task::from(&manifest.tasks[0]).subgoals[1].name, "stowed");
    assert!(GraphImages::open(&folder).unwrap().is_empty());
    let again = save_graph(&root.path().join("again"), &graph(), &manifest).unwrap();
    assert_eq!(
        again.files, saved.files,
        "the same graph gives the same bytes"
    );
}

#[test]
fn empty_graph_is_saved_too() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("empty");
    save_graph(&folder, &TopologicalGraph::new(3, 5), &manifest()).unwrap();
    assert_eq!(load_graph(&folder).unwrap().0.node_count(), 0);
}

#[test]
fn goal_images_are_found_by_demonstration_and_step() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("sock");
    let images = (0..3).map(|step| GraphImage {
        node: NodeId(step),
        camera: "head".to_owned(),
        image: picture(90, 160, step as usize),
    });
    let saved = save_graph_with_images(&folder, &graph(), &manifest(), images).unwrap();
    assert_eq!(saved.files.len(), 3);
    let images = GraphImages::open(&folder).unwrap();
    assert_eq!(images.len(), 3);
    let found = images.image("sock_003", 2, "head").unwrap().unwrap();
    assert_eq!((found.height(), found.width()), (90, 160));
    assert!(images.image("sock_003", 3, "head").unwrap().is_none());
    assert!(images.image("sock_003", 2, "wrist").unwrap().is_none());
}

#[test]
fn leftovers_of_a_killed_process_do_not_matter() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("sock");
    let draft = root.path().join(".sock.tmp");
    fs::create_dir(&draft).unwrap();
    fs::write(draft.join("nodes.parquet"), "half").unwrap();
    assert!(matches!(
        load_graph(&folder),
        Err(StorageError::NoGraph { .. })
    ));
    save_graph(&folder, &graph(), &manifest()).unwrap();
    assert!(!draft.exists());
    // Killed after the old folder was moved away.
    fs::rename(&folder, root.path().join(".sock.previous")).unwrap();
    assert_same(&load_graph(&folder).unwrap().0, &graph());
}

#[test]
fn changed_table_is_refused_with_both_digests() {
    let root = tempfile::tempdir().unwrap();
    let saved = save_graph(root.path(), &graph(), &manifest()).unwrap();
    let path = root.path().join("edges.parquet");
    let mut bytes = fs::read(&path).unwrap();
    bytes[100] ^= 1;
    fs::write(&path, bytes).unwrap();
    let error = load_graph(root.path()).unwrap_err();
    assert!(
        error
            .to_string()
            .contains(&saved.files["edges.parquet"].sha256)
    );
    assert!(
        error
            .to_string()
            .contains(&crate::storage::sha256_file(&path).unwrap())
    );
}

#[test]
fn manifests_that_cannot_be_used_say_why() {
    let root = tempfile::tempdir().unwrap();
    save_graph(root.path(), &graph(), &manifest()).unwrap();
    let path = root.path().join("manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    let error_of = |text: String| {
        fs::write(&path, text).unwrap();
        load_graph(root.path()).unwrap_err().to_string()
    };
    let newer = text.replace("\"format_version\": 1", "\"format_version\": 2");
    assert!(error_of(newer).contains("version 2"));
    assert!(error_of(text.replace("\"d_max\": 5,", "\"d_max\": ,")).contains("at line "));
    let error = load_graph(root.path()).unwrap_err();
    let cause = std::error::Error::source(&error).expect("what serde said");
    assert!(cause.is::<serde_json::Error>(), "{cause}");
    assert!(error_of(text.replace("\"node_count\": 20", "\"node_count\": 21")).contains("says 21"));
    assert!(error_of(text.replace("\"d_max\": 5", "\"d_max\": 6")).contains("'probabilities'"));
}

#[test]
fn model_of_another_graph_is_refused_with_both_digests() {
    let folder = Path::new("graphs/sock");
    ensure_same_model(folder, "aa11", "aa11").unwrap();
    let error = ensure_same_model(folder, "aa11", "cc33").unwrap_err();
    let error = error.to_string();
    for part in ["graphs/sock", "aa11", "cc33", "graph build"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn nothing_but_a_graph_is_replaced() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("graph");
    let save = || save_graph(&folder, &graph(), &manifest());
    save().unwrap();
    save().unwrap();
    let precious = folder.join("thesis.tex");
    fs::write(&precious, "years").unwrap();
    let refused = save().unwrap_err().to_string();
    assert!(refused.contains("holds thesis.tex"), "{refused}");
    assert_eq!(fs::read_to_string(&precious).unwrap(), "years");
    let refused = save_graph(&precious, &graph(), &manifest()).unwrap_err();
    assert!(refused.to_string().contains("is a file"), "{refused}");
    let refused = check_graph_place(std::path::Path::new("..")).unwrap_err();
    assert!(refused.to_string().contains("other things"), "{refused}");
    let empty = root.path().join("empty");
    fs::create_dir(&empty).unwrap();
    check_graph_place(&empty).unwrap();
}

#[test]
fn a_graph_of_other_tasks_is_not_replaced() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().join("graph");
    let task = |name: &str| Task {
        name: name.to_owned(),
        subgoals: Vec::new(),
    };
    check_same_tasks(&folder, &[task("trash")]).unwrap();
    save_graph(&folder, &graph(), &manifest()).unwrap();
    check_same_tasks(&folder, &[task("sock")]).unwrap();
    for wanted in [vec![task("trash")], vec![task("trash"), task("sock")]] {
        let refused = check_same_tasks(&folder, &wanted).unwrap_err().to_string();
        assert!(
            refused.contains("holds the graph of sock, and that of"),
            "{refused}"
        );
        assert!(refused.contains("trash would replace it"), "{refused}");
    }
}
