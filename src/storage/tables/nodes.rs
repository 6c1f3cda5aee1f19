use std::path::Path;
use std::sync::Arc;

use arrow::array::{
    Array, ArrayRef, BooleanArray, ListArray, ListBuilder, StringArray, StringBuilder, UInt32Array,
};
use arrow::datatypes::{DataType, Field};

use super::super::StorageError;
use super::columns::{Columns, TableReader};
use super::table_writer::{TableWriter, vector_column, vectors};
use super::{BATCH_ROWS, table_error};
use crate::graph::{Node, NodeId, TopologicalGraph};
use crate::task::Subgoal;

/// Between a subgoal's task and its name in the column `reached`.
const SUBGOAL_SEPARATOR: char = '/';

/// Writes a row a node.
pub(in crate::storage) fn write_nodes(
    path: &Path,
    graph: &TopologicalGraph,
) -> Result<(), StorageError> {
    let subgoals = Arc::new(Field::new_list_field(DataType::Utf8, true));
    let mut table = TableWriter::create(
        path,
        vec![
            ("id", DataType::UInt32),
            ("task", DataType::Utf8),
            ("trajectory", DataType::Utf8),
            ("step", DataType::UInt32),
            ("progress", DataType::UInt32),
            ("reached", DataType::List(subgoals)),
            ("is_end", DataType::Boolean),
            ("latent", vectors(graph.latents().dim())),
        ],
    )?;
    let count = graph.node_count() as u32;
    for first in (0..count).step_by(BATCH_ROWS) {
        let ids = first..count.min(first + BATCH_ROWS as u32);
        table.write(columns(path, graph, ids)?)?;
    }
    table.finish()
}

/// The columns of some nodes.
fn columns(
    path: &Path,
    graph: &TopologicalGraph,
    ids: std::ops::Range<u32>,
) -> Result<Vec<ArrayRef>, StorageError> {
    let nodes: Vec<&Node> = ids.clone().map(|id| graph.node(NodeId(id))).collect();
    let strings = |of: fn(&Node) -> &str| -> ArrayRef {
        Arc::new(StringArray::from_iter_values(nodes.iter().map(|n| of(n))))
    };
    let numbers = |of: fn(&Node) -> u32| -> ArrayRef {
        Arc::new(UInt32Array::from_iter_values(nodes.iter().map(|n| of(n))))
    };
    let mut reached = ListBuilder::new(StringBuilder::new());
    for node in &nodes {
        for Subgoal { task, name } in &node.reached {
            if name.contains(SUBGOAL_SEPARATOR) {
                let reason = format!("the name of subgoal '{name}' may not contain '/'");
                return Err(table_error(path, reason));
            }
            reached
                .values()
                .append_value(format!("{task}{SUBGOAL_SEPARATOR}{name}"));
        }
        reached.append(true);
    }
    let ends: BooleanArray = nodes.iter().map(|n| Some(n.is_end)).collect();
    let dim = graph.latents().dim();
    let values = &graph.latents().values()[ids.start as usize * dim..ids.end as usize * dim];
    Ok(vec![
        Arc::new(UInt32Array::from_iter_values(ids)),
        strings(|n| &n.task),
        strings(|n| &n.trajectory),
        numbers(|n| n.step),
        numbers(|n| n.progress),
        Arc::new(reached.finish()),
        Arc::new(ends),
        vector_column(path, dim, values.to_vec())?,
    ])
}

/// Adds the rows of a table of nodes to an empty graph.
pub(in crate::storage) fn read_nodes(
    path: &Path,
    graph: &mut TopologicalGraph,
) -> Result<(), StorageError> {
    for batch in TableReader::open(path)? {
        let batch = batch?;
        let ids: &UInt32Array = batch.column("id")?;
        let tasks: &StringArray = batch.column("task")?;
        let trajectories: &StringArray = batch.column("trajectory")?;
        let steps: &UInt32Array = batch.column("step")?;
        let progress: &UInt32Array = batch.column("progress")?;
        let reached: &ListArray = batch.column("reached")?;
        let ends: &BooleanArray = batch.column("is_end")?;
        let latents = batch.vectors("latent", graph.latents().dim())?;
        for row in 0..batch.rows() {
            let (id, expected) = (ids.value(row), graph.node_count());
            if id as usize != expected {
                let reason = format!("{id} instead of {expected}; ids count up from 0");
                return Err(batch.fault_at(row, "id", reason));
            }
            let node = Node {
                task: tasks.value(row).to_owned(),
                trajectory: trajectories.value(row).to_owned(),
                step: steps.value(row),
                reached: subgoals(&batch, row, &reached.value(row))?,
                progress: progress.value(row),
                is_end: ends.value(row),
            };
            let latent = latents.row(row);
            if let Some(place) = latent.iter().position(|v| !v.is_finite()) {
                let reason = format!(
                    "value {place} is {}, in the latent of {}: a state like that can be compared with \
                     nothing. Build the graph again with `catena graph build`; if it comes back, the \
                     model is broken, so train or export it again",
                    latent[place],
                    node.place()
                );
                return Err(batch.fault_at(row, "latent", reason));
            }
            graph.add_node(node, latent);
        }
    }
    Ok(())
}

fn subgoals(batch: &Columns, row: usize, list: &ArrayRef) -> Result<Vec<Subgoal>, StorageError> {
    let names = list.as_any().downcast_ref::<StringArray>();
    let names = names.ok_or_else(|| batch.fault("reached", "does not hold strings"))?;
    names
        .iter()
        .flatten()
        .map(|text| {
            let (task, name) = text.rsplit_once(SUBGOAL_SEPARATOR).ok_or_else(|| {
                batch.fault_at(row, "reached", format!("'{text}' is not TASK/SUBGOAL"))
            })?;
            Ok(Subgoal {
                task: task.to_owned(),
                name: name.to_owned(),
            })
        })
        .collect()
}
