//! Tables of frames, and what is in their columns.

use std::fs::File;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use arrow::array::{
    Array, ArrayRef, AsArray, BinaryArray, FixedSizeListArray, Float64Array, Int64Array,
    LargeBinaryArray, ListArray, StructArray,
};
use arrow::compute::cast;
use arrow::datatypes::DataType;
use arrow::record_batch::RecordBatch;
use parquet::arrow::ProjectionMask;
use parquet::arrow::arrow_reader::{
    ArrowReaderMetadata, ArrowReaderOptions, ParquetRecordBatchReaderBuilder, RowSelection,
    RowSelector,
};

use super::{StorageError, fault};

/// Rows that are decoded at once.
const BATCH_ROWS: usize = 256;
/// The same with images, which can have megabytes: what one batch holds of a column must be less than 2 GiB.
const IMAGE_BATCH_ROWS: usize = 4;
/// A row group whose columns claim more is damaged; writers make groups of some hundred MiB.
const MAX_GROUP_BYTES: i64 = 8 << 30;
/// 155 hours at 30 Hz in one file; a few bytes can claim any number of equal rows.
const MAX_ROWS: i64 = 1 << 24;

/// A Parquet file that is open.
pub(super) struct Table {
    path: PathBuf,
    file: File,
    metadata: ArrowReaderMetadata,
}

impl Table {
    pub fn open(path: &Path) -> Result<Self, StorageError> {
        let file = File::open(path).map_err(|e| missing(path, e))?;
        let length = file
            .metadata()
            .map_err(StorageError::io("read", path))?
            .len();
        if length == 0 {
            return Err(StorageError::EmptyFile {
                path: path.to_owned(),
            });
        }
        let metadata = guarded(path, || {
            ArrowReaderMetadata::load(&file, ArrowReaderOptions::default())
        })?;
        let metadata = metadata.map_err(|e| unreadable(path, &e))?;
        let table = Self {
            path: path.to_owned(),
            file,
            metadata,
        };
        table.check_sizes(length)?;
        Ok(table)
    }

    /// Refuses a footer that claims what the file cannot hold.
    fn check_sizes(&self, length: u64) -> Result<(), StorageError> {
        let metadata = self.metadata.metadata();
        let said = metadata.file_metadata().num_rows();
        // The rows of the groups are what is read, whatever the sum of them is said to be.
        let groups = metadata.row_groups().iter().map(|g| g.num_rows().max(0));
        let summed = groups.fold(0, i64::saturating_add);
        let is_too_many = |rows: &i64| !(0..=MAX_ROWS).contains(rows);
        if let Some(rows) = [said, summed].into_iter().find(is_too_many) {
            let reason = format!(
                "its footer is damaged: it claims {rows} rows. Fetch or write the file again, or split a table of more \
                 than {MAX_ROWS} rows"
            );
            return Err(fault(&self.path, reason));
        }
        for (number, group) in metadata.row_groups().iter().enumerate() {
            let stored: i64 = group
                .columns()
                .iter()
                .map(|c| c.compressed_size().max(0))
                .fold(0, i64::saturating_add);
            let claims = group.total_byte_size();
            if group.num_rows() < 0
                || stored as u64 > length
                || !(0..=MAX_GROUP_BYTES).contains(&claims)
            {
                let reason = format!(
                    "its footer is damaged: row group {number} claims {} rows in {stored} bytes, {claims} unpacked, \
                     in a file of {length} bytes. Fetch or write the file again",
                    group.num_rows()
                );
                return Err(fault(&self.path, reason));
            }
        }
        Ok(())
    }

    /// How many rows there are.
    pub fn rows(&self) -> usize {
        let rows = self.metadata.metadata().file_metadata().num_rows();
        usize::try_from(rows).unwrap_or(0)
    }

    /// Names of the columns.
    pub fn columns(&self) -> Vec<String> {
        let fields = self.metadata.schema().fields();
        fields.iter().map(|f| f.name().clone()).collect()
    }

    /// The named columns, batch by batch, of all rows or of a stretch of them.
    pub fn read(
        &self,
        columns: &[String],
        rows: Option<Range<usize>>,
    ) -> Result<impl Iterator<Item = Result<RecordBatch, StorageError>> + use<>, StorageError> {
        let has = self.columns();
        if let Some(missing) = columns.iter().find(|c| !has.contains(c)) {
            let reason = format!(
                "the column '{missing}' is missing; the columns are {}",
                super::info::listed(has.iter())
            );
            return Err(fault(&self.path, reason));
        }
        let file = self
            .file
            .try_clone()
            .map_err(StorageError::io("read", &self.path))?;
        let builder =
            ParquetRecordBatchReaderBuilder::new_with_metadata(file, self.metadata.clone());
        let roots = has
            .iter()
            .enumerate()
            .filter(|(_, name)| columns.contains(name))
            .map(|(i, _)| i);
        let mask = ProjectionMask::roots(builder.parquet_schema(), roots);
        let batch_rows = self.batch_rows(columns);
        let mut builder = builder.with_projection(mask).with_batch_size(batch_rows);
        if let Some(rows) = rows {
            builder = builder.with_row_selection(RowSelection::from(vec![
                RowSelector::skip(rows.start),
                RowSelector::select(rows.len()),
            ]));
        }
        let path = self.path.clone();
        let reader = guarded(&path, || builder.build())?;
        let mut reader = reader.map_err(|e| unreadable(&path, &e))?;
        let mut is_broken = false;
        Ok(std::iter::from_fn(move || {
            if is_broken {
                return None;
            }
            let next = guarded(&path, || reader.next())
                .and_then(|batch| batch.transpose().map_err(|e| unreadable(&path, &e)));
            is_broken = next.is_err();
            next.transpose()
        }))
    }

    /// How many rows of these columns are decoded at once.
    fn batch_rows(&self, columns: &[String]) -> usize {
        let fields = self.metadata.schema().fields().iter();
        let mut read = fields.filter(|field| columns.contains(field.name()));
        let can_hold_images = |kind: &DataType| {
            matches!(
                kind,
                DataType::Binary | DataType::LargeBinary | DataType::Struct(_)
            )
        };
        if read.any(|field| can_hold_images(field.data_type())) {
            IMAGE_BATCH_ROWS
        } else {
            BATCH_ROWS
        }
    }
}

/// A file that the metadata names and that is not there, or cannot be read.
pub(super) fn missing(path: &Path, error: std::io::Error) -> StorageError {
    if error.kind() == std::io::ErrorKind::NotFound {
        return fault(
            path,
            "the metadata names this file, but it is not there: is the dataset complete?",
        );
    }
    StorageError::io("read", path)(error)
}

fn unreadable(path: &Path, error: &dyn std::fmt::Display) -> StorageError {
    let reason = format!("the table cannot be read ({error}): fetch or write the file again");
    fault(path, reason)
}

/// What the decoder of Parquet gives. It takes some kinds of damage for bugs of its own and panics; here that
/// is a damaged file like any other.
fn guarded<T>(path: &Path, decode: impl FnOnce() -> T) -> Result<T, StorageError> {
    // What was half decoded is dropped and not looked at again.
    catch_unwind(AssertUnwindSafe(decode)).map_err(|_| {
        let reason =
            "its data is damaged, so that the decoder gave up: fetch or write the file again";
        fault(path, reason)
    })
}

/// Whole numbers without nulls.
pub(super) fn integers(array: &ArrayRef) -> Option<Vec<i64>> {
    let array = cast(array, &DataType::Int64).ok()?;
    let array = array.as_any().downcast_ref::<Int64Array>()?;
    (array.null_count() == 0).then(|| array.values().to_vec())
}

/// Numbers without nulls.
pub(super) fn numbers(array: &ArrayRef) -> Option<Vec<f64>> {
    let array = cast(array, &DataType::Float64).ok()?;
    let array = array.as_any().downcast_ref::<Float64Array>()?;
    (array.null_count() == 0).then(|| array.values().to_vec())
}

/// The vector of each row: a list, or a single number.
pub(super) fn vectors(array: &ArrayRef) -> Result<Vec<Vec<f64>>, String> {
    let row = |row: usize| -> Result<Vec<f64>, String> {
        let wrong = || format!("row {row} is no list of numbers but {}", array.data_type());
        if array.is_null(row) {
            return Err(format!("row {row} is null"));
        }
        let any = array.as_any();
        let list = if let Some(list) = any.downcast_ref::<ListArray>() {
            list.value(row)
        } else if let Some(list) = any.downcast_ref::<FixedSizeListArray>() {
            list.value(row)
        } else if let Some(list) = array.as_list_opt::<i64>() {
            list.value(row)
        } else {
            array.slice(row, 1)
        };
        numbers(&list).ok_or_else(wrong)
    };
    (0..array.len()).map(row).collect()
}

/// An image of a row: the bytes of its file, or where that lies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Picture {
    Bytes(Vec<u8>),
    Path(String),
    None,
}

/// The images of a column: a struct of `bytes` and `path`, or bytes alone.
pub(super) fn pictures(array: &ArrayRef) -> Result<Vec<Picture>, String> {
    if let Some(all) = binary(array) {
        return Ok(all
            .into_iter()
            .map(|b| b.map_or(Picture::None, Picture::Bytes))
            .collect());
    }
    let Some(fields) = array.as_any().downcast_ref::<StructArray>() else {
        return Err(format!(
            "holds {}, not images (a struct of 'bytes' and 'path')",
            array.data_type()
        ));
    };
    let bytes = fields.column_by_name("bytes").and_then(binary);
    let bytes = bytes.ok_or("has no field 'bytes' with the bytes of files")?;
    let paths = fields
        .column_by_name("path")
        .and_then(|p| cast(p, &DataType::Utf8).ok());
    let path = |row: usize| {
        let paths = paths.as_ref()?.as_string_opt::<i32>()?;
        (!paths.is_null(row)).then(|| paths.value(row).to_owned())
    };
    let picture = |(row, bytes): (usize, Option<Vec<u8>>)| match bytes {
        Some(bytes) if !fields.is_null(row) => Picture::Bytes(bytes),
        _ => path(row).map_or(Picture::None, Picture::Path),
    };
    Ok(bytes.into_iter().enumerate().map(picture).collect())
}

fn binary(array: &ArrayRef) -> Option<Vec<Option<Vec<u8>>>> {
    let any = array.as_any();
    let owned = |bytes: Option<&[u8]>| bytes.map(<[u8]>::to_vec);
    if let Some(bytes) = any.downcast_ref::<BinaryArray>() {
        return Some(bytes.iter().map(owned).collect());
    }
    let bytes = any.downcast_ref::<LargeBinaryArray>()?;
    Some(bytes.iter().map(owned).collect())
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::sync::Arc;

    use parquet::arrow::ArrowWriter;
    use parquet::file::metadata::ParquetMetaData;

    use super::*;

    #[test]
    fn few_rows_are_decoded_at_once_where_images_can_be_among_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.parquet");
        let numbers: ArrayRef = Arc::new(Int64Array::from_iter_values(0..10));
        let bytes = vec![b"image".as_slice(); 10];
        let images: ArrayRef = Arc::new(BinaryArray::from_vec(bytes));
        let columns = [("frame_index", numbers), ("image", images)];
        let batch = RecordBatch::try_from_iter(columns).unwrap();
        let file = File::create(&path).unwrap();
        let mut writer = ArrowWriter::try_new(file, batch.schema(), None).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        let table = Table::open(&path).unwrap();
        let rows = |columns: &[&str], rows| -> Vec<usize> {
            let columns: Vec<String> = columns.iter().map(|c| (*c).to_owned()).collect();
            let batches = table.read(&columns, rows).unwrap();
            batches.map(|batch| batch.unwrap().num_rows()).collect()
        };
        assert_eq!(rows(&["frame_index"], None), [10]);
        assert_eq!(rows(&["image"], None), [4, 4, 2]);
        assert_eq!(rows(&["frame_index", "image"], Some(3..8)), [4, 1]);
    }

    #[test]
    fn groups_that_claim_more_rows_than_a_table_may_have_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.parquet");
        let episodes: ArrayRef = Arc::new(Int64Array::from(vec![0; 3]));
        let batch = RecordBatch::try_from_iter([("episode_index", episodes)]).unwrap();
        let file = File::create(&path).unwrap();
        let mut writer = ArrowWriter::try_new(file, batch.schema(), None).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
        let bytes = fs::metadata(&path).unwrap().len();
        let mut table = Table::open(&path).unwrap();
        table.check_sizes(bytes).unwrap();
        // The footer still says that there are three.
        let sound = table.metadata.metadata();
        let group = sound.row_group(0).clone().into_builder();
        let group = group.set_num_rows(MAX_ROWS + 1).build().unwrap();
        let lying = ParquetMetaData::new(sound.file_metadata().clone(), vec![group]);
        let options = ArrowReaderOptions::default();
        table.metadata = ArrowReaderMetadata::try_new(Arc::new(lying), options).unwrap();
        let told = table.check_sizes(bytes).unwrap_err().to_string();
        assert!(told.contains("it claims 16777217 rows"), "{told}");
    }
}
