//! What a person is told of a graph folder that nothing can be done with: the file, the place, the value
//! and the way out; never a panic.

use std::fs::{self, File};
use std::path::PathBuf;
use std::sync::Arc;

use arrow::array::{Array, ArrayRef, FixedSizeListArray, Float32Array, StringArray, UInt32Array};
use arrow::compute::{concat_batches, take_record_batch};
use arrow::datatypes::DataType;
use arrow::record_batch::RecordBatch;
use catena::graph::{Edge, EdgeKind, NodeId, TopologicalGraph};
use catena::storage::{GraphManifest, load_graph, load_manifest, save_graph, sha256_file};
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use serde_json::Value;
use tempfile::TempDir;

use crate::command::{catena, json_of, path, root, text};

/// Values of a latent in the shipped graphs.
const LATENT_DIM: usize = 246;

/// A copy of the graph of `sock`, and a task that uses it.
struct Folder {
    _root: TempDir,
    graph: PathBuf,
    task: PathBuf,
}

impl Folder {
    fn new() -> Self {
        let temporary = tempfile::tempdir().expect("a folder");
        let graph = temporary.path().join("sock");
        fs::create_dir(&graph).expect("made");
        let shipped = root().join("graphs/bedroom/sock");
        for name in [
            "nodes.parquet",
            "edges.parquet",
            "images.parquet",
            "manifest.json",
        ] {
            fs::copy(shipped.join(name), graph.join(name)).expect("copied");
        }
        let task = temporary.path().join("sock.yaml");
        let yaml = fs::read_to_string(root().join("tasks/sock.yaml"))
            .expect("the task")
            .replace(
                "graph: graphs/bedroom/sock",
                &format!("graph: {}", path(&graph)),
            );
        fs::write(&task, yaml).expect("written");
        Self {
            _root: temporary,
            graph,
            task,
        }
    }

    /// Changes the manifest.
    fn change_manifest(&self, change: impl FnOnce(&mut Value)) {
        let file = self.graph.join("manifest.json");
        let mut manifest = json_of(&file);
        change(&mut manifest);
        fs::write(&file, manifest.to_string()).expect("written");
    }

    /// Changes a table, and gives the manifest its new digest, so that only what is in it is wrong.
    fn change_table(&self, name: &str, change: impl FnOnce(RecordBatch) -> RecordBatch) {
        let file = self.graph.join(name);
        let reader = ParquetRecordBatchReaderBuilder::try_new(File::open(&file).expect("a table"))
            .and_then(ParquetRecordBatchReaderBuilder::build)
            .expect("a Parquet table");
        let batches: Vec<RecordBatch> = reader.collect::<Result<_, _>>().expect("sound rows");
        let changed = change(concat_batches(&batches[0].schema(), &batches).expect("one schema"));
        let out = File::create(&file).expect("made");
        let mut writer = ArrowWriter::try_new(out, changed.schema(), None).expect("a writer");
        writer.write(&changed).expect("written");
        writer.close().expect("closed");
        let digest = sha256_file(&file).expect("a digest");
        self.change_manifest(|m| m["files"][name]["sha256"] = digest.into());
    }

    /// Saves another graph in its place.
    fn replace(&self, graph: &TopologicalGraph, change: impl FnOnce(&mut GraphManifest)) {
        let mut manifest = load_manifest(&self.graph).expect("the manifest");
        change(&mut manifest);
        save_graph(&self.graph, graph, &manifest).expect("saved");
    }

    /// What commands say on standard error that show the graph, plan on it and localise on it.
    fn told(&self) -> Vec<String> {
        let (graph, task) = (path(&self.graph), path(&self.task));
        let compose = ["compose", task];
        let localise = ["graph", "localise", task, "--demos", "demos/nowhere"];
        let commands: [&[&str]; 3] = [&["graph", "show", graph], &compose, &localise];
        commands.map(refused).to_vec()
    }

    fn told_by_compose(&self) -> String {
        refused(&["compose", path(&self.task)])
    }
}

fn refused(arguments: &[&str]) -> String {
    let output = catena(arguments);
    let said = text(&output.stderr);
    assert!(!output.status.success(), "catena {arguments:?} succeeded");
    assert!(!said.contains("panicked"), "catena {arguments:?}: {said}");
    said
}

fn assert_names(said: &str, parts: &[&str]) {
    for part in parts {
        assert!(said.contains(part), "'{part}' is not in: {said}");
    }
}

/// The batch with one column changed.
fn with_column(
    batch: &RecordBatch,
    name: &str,
    change: impl FnOnce(&ArrayRef) -> ArrayRef,
) -> RecordBatch {
    let place = batch.schema().index_of(name).expect("the column");
    let mut columns = batch.columns().to_vec();
    columns[place] = change(&columns[place]);
    RecordBatch::try_new(batch.schema(), columns).expect("the same types")
}

/// A column of vectors with one value changed.
fn with_value(column: &ArrayRef, row: usize, place: usize, value: f32) -> ArrayRef {
    let list: &FixedSizeListArray = column.as_any().downcast_ref().expect("vectors");
    let DataType::FixedSizeList(item, length) = list.data_type().clone() else {
        unreachable!("a list of one length")
    };
    let values: &Float32Array = list.values().as_any().downcast_ref().expect("floats");
    let mut values = values.values().to_vec();
    values[row * length as usize + place] = value;
    let values = Arc::new(Float32Array::from(values));
    Arc::new(FixedSizeListArray::new(item, length, values, None))
}

/// A column of numbers with one changed.
fn with_number(column: &ArrayRef, row: usize, number: u32) -> ArrayRef {
    let numbers: &UInt32Array = column.as_any().downcast_ref().expect("numbers");
    let mut numbers = numbers.values().to_vec();
    numbers[row] = number;
    Arc::new(UInt32Array::from(numbers))
}

#[test]
fn the_copy_itself_is_sound() {
    let output = catena(&["compose", path(&Folder::new().task)]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn latents_that_are_no_numbers_are_named_by_row_state_and_place() {
    for (value, printed) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
        let folder = Folder::new();
        folder.change_table("nodes.parquet", |batch| {
            with_column(&batch, "latent", |latents| {
                with_value(latents, 17, 3, value)
            })
        });
        let place = load_graph(&root().join("graphs/bedroom/sock")).expect("the shipped graph");
        let place = place.0.node(NodeId(17)).place();
        for said in folder.told() {
            assert_names(
                &said,
                &[
                    "nodes.parquet",
                    "row 17, column 'latent'",
                    &format!("value 3 is {printed}"),
                    &place,
                    "catena graph build",
                ],
            );
        }
    }
}

#[test]
fn a_graph_without_states_is_named_whatever_is_done_with_it() {
    let folder = Folder::new();
    folder.replace(&TopologicalGraph::new(LATENT_DIM, 5), |_| {});
    for said in folder.told() {
        assert_names(
            &said,
            &[path(&folder.graph), "has no states", "catena graph build"],
        );
    }
}

#[test]
fn a_final_state_out_of_reach_is_told_with_what_is_cut_off_and_what_to_record() {
    let folder = Folder::new();
    let (whole, _) = load_graph(&folder.graph).expect("the copy");
    let mut cut = TopologicalGraph::new(LATENT_DIM, 5);
    for (id, node) in whole.nodes() {
        cut.add_node(node.clone(), whole.latents().row(id.index()));
    }
    for (from, to, edge) in whole.edges() {
        // No demonstration goes on from the open drawer to the grasped sock.
        let (a, b) = (whole.node(from).progress, whole.node(to).progress);
        if edge.kind == EdgeKind::Temporal && !(a < 2 && b >= 2) {
            cut.add_edge(from, to, edge.clone());
        }
    }
    folder.replace(&cut, |_| {});
    assert_names(
        &folder.told_by_compose(),
        &[
            "no route to a final state",
            "cut off: sock.sock_grasped, sock.sock_in_box",
            "of task sock",
            "A demonstration from the first to the second would bridge it",
        ],
    );
}

#[test]
fn a_task_that_no_demonstration_ends_is_told() {
    let folder = Folder::new();
    let (whole, _) = load_graph(&folder.graph).expect("the copy");
    let mut unfinished = TopologicalGraph::new(LATENT_DIM, 5);
    for (id, node) in whole.nodes() {
        let mut node = node.clone();
        node.progress = node.progress.min(2);
        unfinished.add_node(node, whole.latents().row(id.index()));
    }
    folder.replace(&unfinished, |_| {});
    assert_names(
        &folder.told_by_compose(),
        &["'sock' has no final state", "3 subgoals", "catena demos"],
    );
}

#[test]
fn a_graph_of_another_d_max_is_told_with_both() {
    let folder = Folder::new();
    let (whole, _) = load_graph(&folder.graph).expect("the copy");
    let mut other = TopologicalGraph::new(LATENT_DIM, 4);
    for (id, node) in whole.nodes() {
        other.add_node(node.clone(), whole.latents().row(id.index()));
    }
    for (from, to, edge) in whole.edges() {
        if edge.kind == EdgeKind::Temporal {
            other.add_edge(from, to, Edge::temporal(4));
        }
    }
    folder.replace(&other, |_| {});
    assert_names(
        &folder.told_by_compose(),
        &[path(&folder.graph), "d_max 4, expected 5", "with one model"],
    );
    // The table and the manifest may differ too.
    let folder = Folder::new();
    folder.change_manifest(|manifest| manifest["d_max"] = 6.into());
    assert_names(
        &folder.told_by_compose(),
        &["edges.parquet", "'probabilities' has 5 values a row, not 6"],
    );
}

#[test]
fn a_graph_of_another_model_is_told_with_folder_and_both_digests() {
    let folder = Folder::new();
    let of_the_model = load_manifest(&folder.graph)
        .expect("the manifest")
        .model_digest;
    folder.change_manifest(|manifest| manifest["model_digest"] = "00ff00ff".into());
    assert_names(
        &folder.told_by_compose(),
        &[
            path(&folder.graph),
            "00ff00ff",
            &of_the_model,
            "catena graph build",
        ],
    );
}

#[test]
fn a_graph_of_other_subgoals_is_told_with_both_lists() {
    let folder = Folder::new();
    let before = ["sock_grasped", "drawer_open", "sock_in_box"];
    folder.change_manifest(|manifest| manifest["tasks"][0]["subgoals"] = before.to_vec().into());
    assert_names(
        &folder.told_by_compose(),
        &[
            "'sock'",
            "sock_grasped, drawer_open, sock_in_box",
            "drawer_open, sock_grasped, sock_in_box",
            "catena graph build tasks/sock.yaml",
        ],
    );
}

#[test]
fn an_edge_that_stands_twice_is_told_with_both_rows() {
    let folder = Folder::new();
    folder.change_table("edges.parquet", |batch| {
        let rows = (0..batch.num_rows() as u32).map(|row| if row == 5 { 3 } else { row });
        take_record_batch(&batch, &UInt32Array::from_iter_values(rows)).expect("rows")
    });
    let (whole, _) = load_graph(&root().join("graphs/bedroom/sock")).expect("the shipped graph");
    let (from, to, _) = whole.edges().nth(3).expect("an edge");
    for said in folder.told() {
        let edge = format!("rows 3 and 5 are the same edge {} -> {}", from.0, to.0);
        assert_names(&said, &["edges.parquet", &edge, "catena graph build"]);
    }
}

#[test]
fn an_edge_that_is_none_is_told_with_row_column_and_value() {
    type Change = fn(&ArrayRef) -> ArrayRef;
    let unknown_kind: Change = |column| {
        let kinds: &StringArray = column.as_any().downcast_ref().expect("strings");
        let kinds = kinds.iter().enumerate();
        let kinds = kinds.map(|(row, kind)| if row == 7 { Some("guessed") } else { kind });
        Arc::new(kinds.collect::<StringArray>())
    };
    let cases: [(&str, Change, &str); 6] = [
        (
            "to",
            |c| with_number(c, 7, 999_999),
            "no node 999999, the graph has 2695 nodes",
        ),
        (
            "from",
            |c| with_number(c, 7, 2695),
            "no node 2695, the graph has 2695 nodes",
        ),
        ("steps", |c| with_number(c, 7, 9), "9 steps"),
        ("kind", unknown_kind, "'guessed' is no kind of edge"),
        (
            "probabilities",
            |c| with_value(c, 7, 2, f32::NAN),
            "NaN is no probability",
        ),
        (
            "probabilities",
            |c| with_value(c, 7, 2, -0.5),
            "-0.5 is no probability",
        ),
    ];
    for (column, change, reason) in cases {
        let folder = Folder::new();
        folder.change_table("edges.parquet", |batch| with_column(&batch, column, change));
        let said = folder.told_by_compose();
        let place = format!("row 7, column '{column}'");
        assert_names(
            &said,
            &["edges.parquet", &place, reason, "catena graph build"],
        );
    }
}
