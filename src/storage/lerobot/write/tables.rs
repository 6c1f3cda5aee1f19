//! Files of a dataset that is written.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use arrow::array::ArrayRef;
use arrow::datatypes::Schema;
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::Value;

use crate::storage::StorageError;
use crate::storage::lerobot::fault;

/// Snappy, which every reader of Parquet knows; images are compressed already.
pub(super) fn properties(note: Option<KeyValue>) -> WriterProperties {
    WriterProperties::builder()
        .set_created_by(concat!("catena ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(note.map(|n| vec![n]))
        .build()
}

pub(super) fn write_table(
    path: &Path,
    schema: Schema,
    columns: Vec<ArrayRef>,
    note: Option<KeyValue>,
) -> Result<(), StorageError> {
    make_parent(path)?;
    let file = File::create(path).map_err(StorageError::io("create", path))?;
    let schema = Arc::new(schema);
    let wrong = |e: &dyn std::fmt::Display| fault(path, format!("cannot be written: {e}"));
    let batch = RecordBatch::try_new(Arc::clone(&schema), columns).map_err(|e| wrong(&e))?;
    let mut writer =
        ArrowWriter::try_new(file, schema, Some(properties(note))).map_err(|e| wrong(&e))?;
    writer.write(&batch).map_err(|e| wrong(&e))?;
    writer.close().map_err(|e| wrong(&e))?;
    Ok(())
}

pub(super) fn write_json(path: &Path, value: &Value) -> Result<(), StorageError> {
    make_parent(path)?;
    let text = format!("{value:#}\n");
    fs::write(path, text).map_err(StorageError::io("write", path))
}

pub(super) fn make_parent(path: &Path) -> Result<(), StorageError> {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder).map_err(StorageError::io("create", folder))
}
