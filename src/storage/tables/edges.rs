use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{StringArray, UInt32Array};
use arrow::datatypes::DataType;

use super::super::StorageError;
use super::columns::{Columns, TableReader};
use super::table_writer::{TableWriter, vector_column, vectors};
use super::{BATCH_ROWS, table_error};
use crate::graph::{Edge, EdgeKind, NodeId};

/// What to do about a table of edges that is none.
pub(in crate::storage) const ADVICE: &str =
    "Build the graph again with `catena graph build` or `catena graph merge`";

/// A table of edges (`from`, `to`, `kind`, `steps`, `probabilities`) that grows edge by edge beside its
/// place and takes it when it is finished. Dropped before that, it leaves nothing.
///
/// It holds one group of rows, however many are written. The same edges in the same order give the same
/// bytes, however they are handed over.
pub(in crate::storage) struct EdgeWriter {
    path: PathBuf,
    d_max: usize,
    table: TableWriter,
    rows: Rows,
}

/// Rows that wait until there is a batch of them.
#[derive(Default)]
struct Rows {
    from: Vec<u32>,
    to: Vec<u32>,
    kinds: Vec<&'static str>,
    steps: Vec<u32>,
    probabilities: Vec<f32>,
}

impl EdgeWriter {
    /// An empty table of edges with `d_max` probabilities each.
    pub fn create(path: &Path, d_max: usize) -> Result<Self, StorageError> {
        let table = TableWriter::create(
            path,
            vec![
                ("from", DataType::UInt32),
                ("to", DataType::UInt32),
                ("kind", DataType::Utf8),
                ("steps", DataType::UInt32),
                ("probabilities", vectors(d_max)),
            ],
        )?;
        Ok(Self {
            path: path.to_owned(),
            d_max,
            table,
            rows: Rows::default(),
        })
    }

    /// Adds a row an edge, in this order.
    pub fn write<'a>(
        &mut self,
        edges: impl IntoIterator<Item = (NodeId, NodeId, &'a Edge)>,
    ) -> Result<(), StorageError> {
        for (from, to, edge) in edges {
            if edge.probabilities.len() != self.d_max {
                let (found, d_max) = (edge.probabilities.len(), self.d_max);
                let reason = format!(
                    "edge {} -> {} has {found} probabilities, not {d_max}",
                    from.0, to.0
                );
                return Err(table_error(&self.path, reason));
            }
            self.rows.from.push(from.0);
            self.rows.to.push(to.0);
            self.rows.kinds.push(kind_name(edge.kind));
            self.rows.steps.push(edge.steps);
            self.rows.probabilities.extend(&edge.probabilities);
            if self.rows.from.len() == BATCH_ROWS {
                self.flush()?;
            }
        }
        Ok(())
    }

    /// Ends the table and puts it in its place.
    pub fn finish(mut self) -> Result<(), StorageError> {
        self.flush()?;
        self.table.finish()
    }

    fn flush(&mut self) -> Result<(), StorageError> {
        let rows = std::mem::take(&mut self.rows);
        self.table.write(vec![
            Arc::new(UInt32Array::from(rows.from)),
            Arc::new(UInt32Array::from(rows.to)),
            Arc::new(StringArray::from(rows.kinds)),
            Arc::new(UInt32Array::from(rows.steps)),
            vector_column(&self.path, self.d_max, rows.probabilities)?,
        ])
    }
}

/// The edges of a table, some thousands at a time, in order. The nodes that they join exist, their steps
/// are `1..d_max` and their probabilities 0..=1; whether an edge comes twice is not looked at.
pub(in crate::storage) struct EdgeReader {
    table: TableReader,
    node_count: usize,
    d_max: usize,
}

impl EdgeReader {
    /// The edges between `node_count` nodes, with `d_max` probabilities each.
    pub fn open(path: &Path, node_count: usize, d_max: usize) -> Result<Self, StorageError> {
        Ok(Self {
            table: TableReader::open(path)?,
            node_count,
            d_max,
        })
    }

    fn edges(&self, batch: &Columns) -> Result<Vec<(NodeId, NodeId, Edge)>, StorageError> {
        let from: &UInt32Array = batch.column("from")?;
        let to: &UInt32Array = batch.column("to")?;
        let kinds: &StringArray = batch.column("kind")?;
        let steps: &UInt32Array = batch.column("steps")?;
        let probabilities = batch.vectors("probabilities", self.d_max)?;
        (0..batch.rows())
            .map(|row| {
                let node =
                    |column: &str, values: &UInt32Array| self.node(batch, row, column, values);
                let kind = kinds.value(row);
                let kind = kind_of(kind).ok_or_else(|| {
                    let reason = format!("'{kind}' is no kind of edge. {ADVICE}");
                    batch.fault_at(row, "kind", reason)
                })?;
                let edge = Edge {
                    kind,
                    steps: self.steps(batch, row, steps.value(row))?,
                    probabilities: probabilities.row(row).to_vec(),
                };
                if let Some(p) = edge.probabilities.iter().find(|p| !is_probability(**p)) {
                    let reason = format!("{p} is no probability. {ADVICE}");
                    return Err(batch.fault_at(row, "probabilities", reason));
                }
                Ok((node("from", from)?, node("to", to)?, edge))
            })
            .collect()
    }

    fn node(
        &self,
        batch: &Columns,
        row: usize,
        column: &str,
        ids: &UInt32Array,
    ) -> Result<NodeId, StorageError> {
        let (id, count) = (ids.value(row), self.node_count);
        if (id as usize) < count {
            return Ok(NodeId(id));
        }
        let reason = format!("there is no node {id}, the graph has {count} nodes. {ADVICE}");
        Err(batch.fault_at(row, column, reason))
    }

    fn steps(&self, batch: &Columns, row: usize, steps: u32) -> Result<u32, StorageError> {
        if (1..self.d_max as u32).contains(&steps) {
            return Ok(steps);
        }
        let d_max = self.d_max;
        let reason = format!(
            "{steps} steps, an edge has at least 1 and fewer than {d_max} (d_max). {ADVICE}"
        );
        Err(batch.fault_at(row, "steps", reason))
    }
}

impl Iterator for EdgeReader {
    type Item = Result<Vec<(NodeId, NodeId, Edge)>, StorageError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = self.table.next()?;
        Some(batch.and_then(|batch| self.edges(&batch)))
    }
}

/// Whether a value lies in 0..=1, give or take the rounding of a softmax.
fn is_probability(value: f32) -> bool {
    const SLACK: f32 = 1e-4;
    (0.0..=1.0 + SLACK).contains(&value)
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

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const D_MAX: usize = 4;

    /// More than a group of rows, and no whole number of batches.
    fn edges() -> Vec<(NodeId, NodeId, Edge)> {
        (0..70_000_u32)
            .map(|i| {
                let share = 0.5 / (i + 1) as f32;
                let edge = Edge::predicted(EdgeKind::Learned, &[share, 0.5 - share, 0.2, 0.3]);
                (NodeId(i / 7), NodeId(i % 7), edge)
            })
            .collect()
    }

    fn written(path: &Path, parts: &[&[(NodeId, NodeId, Edge)]]) -> Vec<u8> {
        let mut writer = EdgeWriter::create(path, D_MAX).unwrap();
        for part in parts {
            writer
                .write(part.iter().map(|(a, b, e)| (*a, *b, e)))
                .unwrap();
        }
        writer.finish().unwrap();
        fs::read(path).unwrap()
    }

    #[test]
    fn edges_come_back_in_order_and_the_same_bytes_come_of_any_parts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("edges.parquet");
        let edges = edges();
        let whole = written(&path, &[&edges]);
        let (first, rest) = edges.split_at(9_999);
        assert!(whole == written(&path, &[first, &[], rest]));
        let batches: Vec<_> = EdgeReader::open(&path, 10_000, D_MAX)
            .unwrap()
            .collect::<Result<_, _>>()
            .unwrap();
        assert!(batches.iter().all(|batch| batch.len() <= BATCH_ROWS));
        assert!(batches.concat() == edges);
    }

    #[test]
    fn a_writer_that_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("edges.parquet");
        let mut writer = EdgeWriter::create(&path, D_MAX).unwrap();
        let short = Edge::temporal(3);
        let refused = writer.write([(NodeId(4), NodeId(5), &short)]).unwrap_err();
        assert!(
            refused
                .to_string()
                .contains("edge 4 -> 5 has 3 probabilities, not 4")
        );
        drop(writer);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
