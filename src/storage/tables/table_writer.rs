use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, FixedSizeListArray, Float32Array};
use arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::file::properties::WriterProperties;
use parquet::schema::types::ColumnPath;

use super::super::StorageError;
use super::super::replace::Draft;
use super::{GROUP_ROWS, table_error};

/// A table of columns without nulls, compressed with zstd, that grows batch by batch beside its place
/// and takes it when it is finished. Dropped before that, it leaves nothing.
pub(in crate::storage) struct TableWriter {
    path: PathBuf,
    schema: SchemaRef,
    writer: ArrowWriter<BufWriter<File>>,
    draft: Draft,
}

impl TableWriter {
    /// An empty table with these columns.
    pub fn create(path: &Path, columns: Vec<(&str, DataType)>) -> Result<Self, StorageError> {
        let fields: Vec<Field> = columns
            .into_iter()
            .map(|(name, data_type)| Field::new(name, data_type, false))
            .collect();
        let schema = Arc::new(Schema::new(fields));
        let properties = properties().map_err(|e| table_error(path, e.to_string()))?;
        let draft = Draft::create(path)?;
        let file = BufWriter::new(draft.file()?);
        let writer = ArrowWriter::try_new(file, Arc::clone(&schema), Some(properties))
            .map_err(|e| table_error(path, e.to_string()))?;
        Ok(Self {
            path: path.to_owned(),
            schema,
            writer,
            draft,
        })
    }

    /// Adds rows: an array a column, all of one length. The bytes depend on how rows are cut into batches.
    pub fn write(&mut self, columns: Vec<ArrayRef>) -> Result<(), StorageError> {
        let fault = |reason: String| table_error(&self.path, reason);
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), columns)
            .map_err(|e| fault(e.to_string()))?;
        self.writer.write(&batch).map_err(|e| fault(e.to_string()))
    }

    /// Ends the table and puts it in its place.
    pub fn finish(self) -> Result<(), StorageError> {
        let file = self.writer.into_inner();
        let mut file = file.map_err(|e| table_error(&self.path, e.to_string()))?;
        file.flush()
            .map_err(StorageError::io("write", &self.path))?;
        drop(file);
        self.draft.commit()
    }
}

fn properties() -> parquet::errors::Result<WriterProperties> {
    // Level 9 takes a third longer for 1 % fewer bytes.
    const ZSTD_LEVEL: i32 = 3;
    let mut properties = WriterProperties::builder()
        .set_created_by(concat!("catena ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::try_new(ZSTD_LEVEL)?))
        .set_max_row_group_row_count(Some(GROUP_ROWS));
    // What a network gives hardly repeats; bytes of equal weight do, so they are kept together.
    for column in ["latent", "probabilities"] {
        let values = ColumnPath::from(vec![column.into(), "list".into(), "item".into()]);
        properties = properties
            .set_column_dictionary_enabled(values.clone(), false)
            .set_column_encoding(values, Encoding::BYTE_STREAM_SPLIT);
    }
    Ok(properties.build())
}

/// The type of a column of vectors of one length.
pub(super) fn vectors(length: usize) -> DataType {
    DataType::FixedSizeList(Arc::new(item()), length as i32)
}

/// A column of vectors of one length, which lie one after another in `values`.
pub(super) fn vector_column(
    path: &Path,
    length: usize,
    values: Vec<f32>,
) -> Result<ArrayRef, StorageError> {
    let values = Arc::new(Float32Array::from(values));
    FixedSizeListArray::try_new(Arc::new(item()), length as i32, values, None)
        .map(|array| Arc::new(array) as ArrayRef)
        .map_err(|e| table_error(path, e.to_string()))
}

fn item() -> Field {
    Field::new("item", DataType::Float32, false)
}
