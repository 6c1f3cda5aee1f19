//! Nodes and edges as Parquet tables that any data tool reads.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, BooleanArray, FixedSizeListArray, Float32Array, ListArray, ListBuilder,
    StringArray, StringBuilder, UInt32Array,
};
use arrow::datatypes::{DataType, Field, Schema};
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;

use super::StorageError;
use super::replace::write_file;
use crate::graph::{Edge, EdgeKind, Node, NodeId, TopologicalGraph};
use crate::task::Subgoal;

/// Between a subgoal's task and its name in the column `reached`.
const SUBGOAL_SEPARATOR: char = '/';

/// Writes a row a node.
pub(super) fn write_nodes(path: &Path, graph: &TopologicalGraph) -> Result<(), StorageError> {
    let nodes: Vec<&Node> = graph.nodes().map(|(_, node)| node).collect();
    let strings = |of: fn(&Node) -> &str| -> ArrayRef {
        Arc::new(StringArray::from_iter_values(nodes.iter().map(|n| of(n))))
    };
    let numbers = |of: fn(&Node) -> u32| -> ArrayRef {
        Arc::new(UInt32Array::from_iter_values(nodes.iter().map(|n| of(n))))
    };
    let mut reached = ListBuilder::new(StringBuilder::new());
    for node in &nodes {
        for subgoal in &node.reached {
            let Subgoal { task, name } = subgoal;
            if name.contains(SUBGOAL_SEPARATOR) {
                let reason = format!("the name of subgoal '{name}' may not contain '/'");
                return Err(table_error(path, &reason));
            }
            reached
                .values()
                .append_value(format!("{task}{SUBGOAL_SEPARATOR}{name}"));
        }
        reached.append(true);
    }
    let ends: BooleanArray = nodes.iter().map(|n| Some(n.is_end)).collect();
    let ids = UInt32Array::from_iter_values(graph.nodes().map(|(id, _)| id.0));
    let latents = rows(
        path,
        graph.latents().dim(),
        graph.latents().values().to_vec(),
    )?;
    write_table(
        path,
        vec![
            ("id", Arc::new(ids)),
            ("task", strings(|n| &n.task)),
            ("trajectory", strings(|n| &n.trajectory)),
            ("step", numbers(|n| n.step)),
            ("progress", numbers(|n| n.progress)),
            ("reached", Arc::new(reached.finish())),
            ("is_end", Arc::new(ends)),
            ("latent", latents),
        ],
    )
}

/// Writes a row an edge, in the graph's order.
pub(super) fn write_edges(path: &Path, graph: &TopologicalGraph) -> Result<(), StorageError> {
    let edges: Vec<_> = graph.edges().collect();
    let numbers = |of: fn(&(NodeId, NodeId, &Edge)) -> u32| -> ArrayRef {
        Arc::new(UInt32Array::from_iter_values(edges.iter().map(of)))
    };
    let kinds = StringArray::from_iter_values(edges.iter().map(|(_, _, e)| kind_name(e.kind)));
    let probabilities = edges
        .iter()
        .flat_map(|(_, _, e)| e.probabilities.iter().copied());
    let probabilities = rows(path, graph.d_max(), probabilities.collect())?;
    write_table(
        path,
        vec![
            ("from", numbers(|(from, _, _)| from.0)),
            ("to", numbers(|(_, to, _)| to.0)),
            ("kind", Arc::new(kinds)),
            ("steps", numbers(|(_, _, edge)| edge.steps)),
            ("probabilities", probabilities),
        ],
    )
}

/// Adds the rows of a table of nodes to an empty graph.
pub(super) fn read_nodes(path: &Path, graph: &mut TopologicalGraph) -> Result<(), StorageError> {
    for batch in Columns::read(path)? {
        let batch = batch?;
        let ids: &UInt32Array = batch.column("id")?;
        let tasks: &StringArray = batch.column("task")?;
        let trajectories: &StringArray = batch.column("trajectory")?;
        let steps: &UInt32Array = batch.column("step")?;
        let progress: &UInt32Array = batch.column("progress")?;
        let reached: &ListArray = batch.column("reached")?;
        let ends: &BooleanArray = batch.column("is_end")?;
        let latents = batch.rows_of("latent", graph.latents().dim())?;
        for row in 0..batch.rows() {
            if ids.value(row) as usize != graph.node_count() {
                return Err(batch.fault("id", "ids do not count up from 0"));
            }
            let node = Node {
                task: tasks.value(row).to_owned(),
                trajectory: trajectories.value(row).to_owned(),
                step: steps.value(row),
                reached: batch.subgoals(&reached.value(row))?,
                progress: progress.value(row),
                is_end: ends.value(row),
            };
            graph.add_node(node, latents.row(row));
        }
    }
    Ok(())
}

/// Adds the rows of a table of edges to a graph that has all its nodes.
pub(super) fn read_edges(path: &Path, graph: &mut TopologicalGraph) -> Result<(), StorageError> {
    for batch in Columns::read(path)? {
        let batch = batch?;
        let from: &UInt32Array = batch.column("from")?;
        let to: &UInt32Array = batch.column("to")?;
        let kinds: &StringArray = batch.column("kind")?;
        let steps: &UInt32Array = batch.column("steps")?;
        let probabilities = batch.rows_of("probabilities", graph.d_max())?;
        for row in 0..batch.rows() {
            let (from, to) = (from.value(row), to.value(row));
            if from.max(to) as usize >= graph.node_count() {
                let reason = format!("{from} -> {to} of only {} nodes", graph.node_count());
                return Err(batch.fault("from", &reason));
            }
            let kind = kind_of(kinds.value(row)).ok_or_else(|| {
                batch.fault(
                    "kind",
                    &format!("'{}' is no kind of edge", kinds.value(row)),
                )
            })?;
            let edge = Edge {
                kind,
                steps: steps.value(row),
                probabilities: probabilities.row(row).to_vec(),
            };
            graph.add_edge(NodeId(from), NodeId(to), edge);
        }
    }
    Ok(())
}

fn kind_name(kind: EdgeKind) -> &'static str {
    match kind {
        EdgeKind::Temporal => "temporal",
        EdgeKind::Learned => "learned",
        EdgeKind::CrossTask => "cross_task",
    }
}

fn kind_of(name: &str) -> Option<EdgeKind> {
    [EdgeKind::Temporal, EdgeKind::Learned, EdgeKind::CrossTask]
        .into_iter()
        .find(|kind| kind_name(*kind) == name)
}

/// A column of vectors of one length.
fn rows(path: &Path, length: usize, values: Vec<f32>) -> Result<ArrayRef, StorageError> {
    let field = Arc::new(Field::new("item", DataType::Float32, false));
    FixedSizeListArray::try_new(
        field,
        length as i32,
        Arc::new(Float32Array::from(values)),
        None,
    )
    .map(|array| Arc::new(array) as ArrayRef)
    .map_err(|e| table_error(path, &e.to_string()))
}

/// Writes a table of columns without nulls, compressed with zstd.
pub(super) fn write_table(path: &Path, columns: Vec<(&str, ArrayRef)>) -> Result<(), StorageError> {
    const ZSTD_LEVEL: i32 = 9;
    let fields: Vec<Field> = columns
        .iter()
        .map(|(name, array)| Field::new(*name, array.data_type().clone(), false))
        .collect();
    let arrays = columns.into_iter().map(|(_, array)| array).collect();
    let fault = |e: &dyn std::fmt::Display| table_error(path, &e.to_string());
    let batch =
        RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays).map_err(|e| fault(&e))?;
    let latent = ColumnPath::from(vec!["latent".into(), "list".into(), "item".into()]);
    let properties = WriterProperties::builder()
        .set_created_by(concat!("catena ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(
            ZstdLevel::try_new(ZSTD_LEVEL).map_err(|e| fault(&e))?,
        ))
        // Latents hardly repeat; bytes of equal weight do, so they are kept together.
        .set_column_dictionary_enabled(latent.clone(), false)
        .set_column_encoding(latent, Encoding::BYTE_STREAM_SPLIT)
        .build();
    let mut bytes = Vec::new();
    ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties))
        .and_then(|mut writer| {
            writer.write(&batch)?;
            writer.close()
        })
        .map_err(|e| fault(&e))?;
    write_file(path, |file| std::io::Write::write_all(file, &bytes))
}

/// A part of a table whose columns are asked for by name and type.
pub(super) struct Columns {
    path: PathBuf,
    batch: RecordBatch,
}

/// Vectors of one length, a row each.
struct Rows<'a> {
    length: usize,
    values: &'a [f32],
}

impl Rows<'_> {
    fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.length..(row + 1) * self.length]
    }
}

impl Columns {
    /// The parts of a table, in order.
    pub fn read(
        path: &Path,
    ) -> Result<impl Iterator<Item = Result<Self, StorageError>>, StorageError> {
        const BATCH_ROWS: usize = 8192;
        let path = path.to_owned();
        let file = File::open(&path).map_err(StorageError::io("read", &path))?;
        let reader = ParquetRecordBatchReaderBuilder::try_new(file)
            .and_then(|builder| builder.with_batch_size(BATCH_ROWS).build())
            .map_err(|e| table_error(&path, &e.to_string()))?;
        Ok(reader.map(move |batch| match batch {
            Ok(batch) => Ok(Self {
                path: path.clone(),
                batch,
            }),
            Err(e) => Err(table_error(&path, &e.to_string())),
        }))
    }

    pub fn rows(&self) -> usize {
        self.batch.num_rows()
    }

    /// A column of the type that is asked for, without nulls.
    pub fn column<T: Array + 'static>(&self, name: &str) -> Result<&T, StorageError> {
        let array = self
            .batch
            .column_by_name(name)
            .ok_or_else(|| self.fault(name, "is missing"))?;
        if array.null_count() > 0 {
            return Err(self.fault(name, &format!("{} rows are null", array.null_count())));
        }
        array
            .as_any()
            .downcast_ref::<T>()
            .ok_or_else(|| self.fault(name, &format!("has type {}", array.data_type())))
    }

    fn rows_of(&self, name: &str, length: usize) -> Result<Rows<'_>, StorageError> {
        let list: &FixedSizeListArray = self.column(name)?;
        if list.value_length() as usize != length {
            let reason = format!("has {} values a row, not {length}", list.value_length());
            return Err(self.fault(name, &reason));
        }
        let values = list.values().as_any().downcast_ref::<Float32Array>();
        let values = values.ok_or_else(|| self.fault(name, "does not hold 32-bit floats"))?;
        Ok(Rows {
            length,
            values: values.values(),
        })
    }

    fn subgoals(&self, list: &ArrayRef) -> Result<Vec<Subgoal>, StorageError> {
        let names = list.as_any().downcast_ref::<StringArray>();
        let names = names.ok_or_else(|| self.fault("reached", "does not hold strings"))?;
        names
            .iter()
            .flatten()
            .map(|text| match text.rsplit_once(SUBGOAL_SEPARATOR) {
                Some((task, name)) => Ok(Subgoal {
                    task: task.to_owned(),
                    name: name.to_owned(),
                }),
                None => Err(self.fault("reached", &format!("'{text}' is not TASK/SUBGOAL"))),
            })
            .collect()
    }

    fn fault(&self, column: &str, reason: &str) -> StorageError {
        table_error(&self.path, &format!("column '{column}' {reason}"))
    }
}

fn table_error(path: &Path, reason: &str) -> StorageError {
    StorageError::Table {
        path: path.to_owned(),
        reason: reason.to_owned(),
    }
}
