use std::fmt::Display;
use std::fs::File;
use std::path::{Path, PathBuf};

use arrow::array::{Array, FixedSizeListArray, Float32Array};
use arrow::record_batch::RecordBatch;
use parquet::arrow::arrow_reader::{ParquetRecordBatchReader, ParquetRecordBatchReaderBuilder};

use super::super::StorageError;
use super::{BATCH_ROWS, table_error};

/// The parts of a table, in order.
pub(in crate::storage) struct TableReader {
    path: PathBuf,
    reader: ParquetRecordBatchReader,
    rows_read: usize,
}

/// A part of a table whose columns are asked for by name and type.
pub(in crate::storage) struct Columns {
    path: PathBuf,
    /// Which row of the table the first one is.
    first_row: usize,
    batch: RecordBatch,
}

/// Vectors of one length, a row each.
pub(super) struct Vectors<'a> {
    length: usize,
    values: &'a [f32],
}

impl Vectors<'_> {
    pub(super) fn row(&self, row: usize) -> &[f32] {
        &self.values[row * self.length..(row + 1) * self.length]
    }
}

impl TableReader {
    pub fn open(path: &Path) -> Result<Self, StorageError> {
        let file = File::open(path).map_err(StorageError::io("read", path))?;
        let reader = ParquetRecordBatchReaderBuilder::try_new(file)
            .and_then(|builder| builder.with_batch_size(BATCH_ROWS).build())
            .map_err(|e| table_error(path, e.to_string()))?;
        Ok(Self {
            path: path.to_owned(),
            reader,
            rows_read: 0,
        })
    }
}

impl Iterator for TableReader {
    type Item = Result<Columns, StorageError>;

    fn next(&mut self) -> Option<Self::Item> {
        let batch = match self.reader.next()? {
            Ok(batch) => batch,
            Err(e) => return Some(Err(table_error(&self.path, e.to_string()))),
        };
        let first_row = self.rows_read;
        self.rows_read += batch.num_rows();
        Some(Ok(Columns {
            path: self.path.clone(),
            first_row,
            batch,
        }))
    }
}

impl Columns {
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
            return Err(self.fault(name, format_args!("{} rows are null", array.null_count())));
        }
        array
            .as_any()
            .downcast_ref::<T>()
            .ok_or_else(|| self.fault(name, format_args!("has type {}", array.data_type())))
    }

    /// A column of vectors of this length.
    pub(super) fn vectors(&self, name: &str, length: usize) -> Result<Vectors<'_>, StorageError> {
        let list: &FixedSizeListArray = self.column(name)?;
        if list.value_length() as usize != length {
            let found = list.value_length();
            return Err(self.fault(name, format_args!("has {found} values a row, not {length}")));
        }
        let values = list.values().as_any().downcast_ref::<Float32Array>();
        let values = values.ok_or_else(|| self.fault(name, "does not hold 32-bit floats"))?;
        if values.null_count() > 0 {
            return Err(self.fault(
                name,
                format_args!("{} values are null", values.null_count()),
            ));
        }
        Ok(Vectors {
            length,
            values: values.values(),
        })
    }

    /// What is wrong with a column.
    pub(super) fn fault(&self, column: &str, reason: impl Display) -> StorageError {
        table_error(&self.path, format!("column '{column}' {reason}"))
    }

    /// What is wrong with a column at a row of this part.
    pub(super) fn fault_at(&self, row: usize, column: &str, reason: impl Display) -> StorageError {
        let row = self.first_row + row;
        table_error(
            &self.path,
            format!("row {row}, column '{column}': {reason}"),
        )
    }
}
