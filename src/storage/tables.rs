//! Nodes and edges as Parquet tables that any data tool reads, written and read a batch of rows at a time:
//! beside the graph itself there is memory for one group of rows, however many there are.

mod columns;
mod edges;
mod nodes;
mod table_writer;

use std::path::Path;

use super::StorageError;

pub(super) use columns::TableReader;
pub(super) use edges::{ADVICE, EdgeReader, EdgeWriter};
pub(super) use nodes::{read_nodes, write_nodes};
pub(super) use table_writer::TableWriter;

/// Rows that are in memory at once, on the way to a file and from it.
const BATCH_ROWS: usize = 8192;

/// Rows that are compressed together, and of which a reader can skip all or none. One group of a graph's
/// nodes takes 48 MiB before compression at 192 values a latent.
const GROUP_ROWS: usize = 65_536;

fn table_error(path: &Path, reason: impl Into<String>) -> StorageError {
    StorageError::Table {
        path: path.to_owned(),
        reason: reason.into(),
    }
}
