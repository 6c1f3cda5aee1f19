//! A dataset of version 3.0 from recordings, episode by episode. Images are files within the tables, so that
//! nothing is needed to read them.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{
    ArrayRef, BinaryArray, FixedSizeListArray, Float32Array, Int64Array, ListBuilder, StringArray,
    StringBuilder, StructArray,
};
use arrow::datatypes::{DataType, Field, Fields, Schema, SchemaRef};
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use serde_json::{Value, json};

use super::info::ACTION;
use super::restored::{FILE, Restored, RestoredEpisode};
use super::statistics::Statistics;
use super::{INFO, StorageError, fault};
use crate::storage::RecordingReport;
use crate::storage::pixels::{encode_jpeg, encode_png};
use crate::trajectory::{Action, ActionSpace, CameraSpec, Image, Trajectory};

/// How images are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PictureFormat {
    /// Every pixel as it is, in several times the space.
    #[default]
    Png,
    /// JPEG of quality 92.
    Jpeg,
}

const JPEG_QUALITY: u8 = 92;
/// A table is ended when it is larger, as the package lerobot does.
const FILE_BYTES: u64 = 100 << 20;
const CHUNK_FILES: u64 = 1000;
/// Regular times may be off by so much.
const TIME_TOLERANCE_SECS: f64 = 1e-4;

/// A dataset that is being written.
pub(in crate::storage) struct DatasetWriter {
    folder: PathBuf,
    pictures: PictureFormat,
    fps: u32,
    cameras: Vec<CameraSpec>,
    space: ActionSpace,
    robot: Option<String>,
    schema: SchemaRef,
    table: Option<ArrowWriter<File>>,
    file: u64,
    tasks: Vec<String>,
    episodes: Vec<EpisodeRow>,
    frames: u64,
    statistics: BTreeMap<String, Statistics>,
    restored: Restored,
}

struct EpisodeRow {
    task: usize,
    length: u64,
    file: u64,
    from: u64,
}

impl DatasetWriter {
    /// A dataset in an empty folder, with the cameras, actions and rate of its first recording.
    pub fn new(
        folder: &Path,
        first: &Trajectory,
        robot: Option<String>,
        pictures: PictureFormat,
    ) -> Self {
        let space = match &first.action_space {
            ActionSpace::Binned { dimensions } => ActionSpace::Continuous {
                names: dimensions.iter().map(|d| d.name.clone()).collect(),
            },
            other => other.clone(),
        };
        let cameras = first.cameras();
        Self {
            schema: Arc::new(Schema::new(fields(&cameras, width(&space)))),
            folder: folder.to_owned(),
            pictures,
            fps: rate(first),
            restored: Restored::new(space.clone()),
            cameras,
            space,
            robot,
            table: None,
            file: 0,
            tasks: Vec::new(),
            episodes: Vec::new(),
            frames: 0,
            statistics: BTreeMap::new(),
        }
    }

    /// Steps a second that the dataset has.
    pub fn fps(&self) -> u32 {
        self.fps
    }

    /// Why a recording cannot be part of the dataset, if it cannot.
    pub fn misfit(&self, trajectory: &Trajectory) -> Option<String> {
        if trajectory.cameras() != self.cameras {
            return Some(format!(
                "it has cameras {}, the first recording has {}; give all the same size with --image-size, or convert \
                 them apart",
                camera_list(&trajectory.cameras()),
                camera_list(&self.cameras)
            ));
        }
        let space = match &trajectory.action_space {
            ActionSpace::Binned { dimensions } => ActionSpace::Continuous {
                names: dimensions.iter().map(|d| d.name.clone()).collect(),
            },
            other => other.clone(),
        };
        (space != self.space).then(|| {
            format!(
                "its actions are {space}, those of the first recording {}, or are called otherwise; convert them apart",
                self.space
            )
        })
    }

    /// Adds a recording as the next episode.
    pub fn add(
        &mut self,
        trajectory: &Trajectory,
        report: &RecordingReport,
        id: &str,
    ) -> Result<(), StorageError> {
        let task = self.task(&trajectory.task);
        let columns = self.columns(trajectory, task)?;
        let path = self.data_path();
        let wrong = |e: &dyn std::fmt::Display| fault(&path, format!("cannot be written: {e}"));
        let batch =
            RecordBatch::try_new(Arc::clone(&self.schema), columns).map_err(|e| wrong(&e))?;
        if self.table.is_none() {
            make_parent(&path)?;
            let file = File::create(&path).map_err(StorageError::io("create", &path))?;
            let writer =
                ArrowWriter::try_new(file, Arc::clone(&self.schema), Some(properties(None)));
            self.table = Some(writer.map_err(|e| wrong(&e))?);
        }
        let mut bytes = 0;
        if let Some(table) = &mut self.table {
            // An episode is a row group, so that one can be read without the others.
            table
                .write(&batch)
                .and_then(|()| table.flush())
                .map_err(|e| wrong(&e))?;
            bytes = table.bytes_written() as u64;
        }
        let index = self.episodes.len() as u64;
        let length = trajectory.steps.len() as u64;
        self.restored
            .episodes
            .insert(index, self.restored_episode(trajectory, report, id));
        self.episodes.push(EpisodeRow {
            task,
            length,
            file: self.file,
            from: self.frames,
        });
        self.frames += length;
        if bytes >= FILE_BYTES {
            self.end_table()?;
        }
        Ok(())
    }

    fn data_path(&self) -> PathBuf {
        let (chunk, file) = (self.file / CHUNK_FILES, self.file % CHUNK_FILES);
        self.folder
            .join(format!("data/chunk-{chunk:03}/file-{file:03}.parquet"))
    }

    fn end_table(&mut self) -> Result<(), StorageError> {
        if let Some(table) = self.table.take() {
            let path = self.data_path();
            table
                .close()
                .map_err(|e| fault(&path, format!("cannot be written: {e}")))?;
            self.file += 1;
        }
        Ok(())
    }

    fn task(&mut self, task: &str) -> usize {
        let known = self.tasks.iter().position(|t| t == task);
        known.unwrap_or_else(|| {
            self.tasks.push(task.to_owned());
            self.tasks.len() - 1
        })
    }

    fn restored_episode(
        &self,
        trajectory: &Trajectory,
        report: &RecordingReport,
        id: &str,
    ) -> RestoredEpisode {
        let times: Vec<f64> = trajectory.steps.iter().map(|s| s.time_secs).collect();
        let is_regular = times
            .iter()
            .enumerate()
            .all(|(i, secs)| (secs - i as f64 / f64::from(self.fps)).abs() < TIME_TOLERANCE_SECS);
        RestoredEpisode {
            id: id.to_owned(),
            task: trajectory.task.clone(),
            times_secs: (!is_regular).then_some(times),
            markers: trajectory.markers.clone(),
            metadata: report.metadata.clone(),
        }
    }

    /// The columns of an episode, in the order of the schema.
    fn columns(
        &mut self,
        trajectory: &Trajectory,
        task: usize,
    ) -> Result<Vec<ArrayRef>, StorageError> {
        let path = self.data_path();
        let mut columns = Vec::new();
        for camera in &self.cameras {
            let images: Vec<&Image> = trajectory
                .steps
                .iter()
                .filter_map(|s| s.observation.image(&camera.name).ok())
                .collect();
            let key = image_key(&camera.name);
            let statistics = self.statistics.entry(key.clone()).or_default();
            for image in &images {
                statistics.add_image(image);
            }
            let files = self.pictures.encoded(&images);
            let files = files.map_err(|e| fault(&path, format!("column '{key}': {e}")))?;
            columns.push(picture_column(&files, self.pictures.ending()));
        }
        let width = width(&self.space);
        let mut values = Vec::with_capacity(width * trajectory.steps.len());
        for step in &trajectory.steps {
            let row = row(&step.action, width);
            self.note(ACTION, &row);
            values.extend(row.iter().map(|v| *v as f32));
        }
        columns.push(action_column(width, values).map_err(|e| fault(&path, e))?);
        let count = trajectory.steps.len() as i64;
        let episode = self.episodes.len() as i64;
        let first = self.frames as i64;
        let secs: Vec<f32> = (0..count).map(|i| i as f32 / self.fps as f32).collect();
        for value in &secs {
            self.note("timestamp", &[f64::from(*value)]);
        }
        columns.push(Arc::new(Float32Array::from(secs)));
        for (name, value) in [
            ("frame_index", (0..count).collect::<Vec<i64>>()),
            ("episode_index", vec![episode; count as usize]),
            ("index", (first..first + count).collect()),
            ("task_index", vec![task as i64; count as usize]),
        ] {
            for value in &value {
                self.note(name, &[*value as f64]);
            }
            columns.push(Arc::new(Int64Array::from(value)));
        }
        Ok(columns)
    }

    fn note(&mut self, key: &str, values: &[f64]) {
        if let Some(statistics) = self.statistics.get_mut(key) {
            return statistics.add(values);
        }
        self.statistics
            .entry(key.to_owned())
            .or_default()
            .add(values);
    }

    /// Writes the metadata, which makes the folder a dataset.
    pub fn finish(mut self) -> Result<(), StorageError> {
        self.end_table()?;
        self.write_tasks()?;
        self.write_episodes()?;
        let statistics: BTreeMap<&String, Value> = self
            .statistics
            .iter()
            .map(|(key, s)| (key, s.to_json(key.starts_with(IMAGES))))
            .collect();
        write_json(&self.folder.join("meta/stats.json"), &json!(statistics))?;
        write_json(&self.folder.join(FILE), &json!(self.restored))?;
        write_json(&self.folder.join(INFO), &self.info())
    }

    fn info(&self) -> Value {
        let mut features = serde_json::Map::new();
        let number = |dtype: &str| json!({ "dtype": dtype, "shape": [1], "names": null });
        for camera in &self.cameras {
            let feature = json!({
                "dtype": "image",
                "shape": [camera.height, camera.width, 3],
                "names": ["height", "width", "channels"],
            });
            features.insert(image_key(&camera.name), feature);
        }
        let names = match &self.space {
            ActionSpace::Primitives { names } | ActionSpace::Continuous { names } => names.clone(),
            ActionSpace::Binned { .. } => Vec::new(),
        };
        let action = json!({ "dtype": "float32", "shape": [width(&self.space)], "names": names });
        features.insert(ACTION.to_owned(), action);
        features.insert("timestamp".to_owned(), number("float32"));
        for key in ["frame_index", "episode_index", "index", "task_index"] {
            features.insert(key.to_owned(), number("int64"));
        }
        json!({
            "codebase_version": "v3.0",
            "robot_type": self.robot,
            "total_episodes": self.episodes.len(),
            "total_frames": self.frames,
            "total_tasks": self.tasks.len(),
            "chunks_size": CHUNK_FILES,
            "data_files_size_in_mb": FILE_BYTES >> 20,
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": { "train": format!("0:{}", self.episodes.len()) },
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": null,
            "features": features,
        })
    }

    /// Tasks as pandas writes a table that is indexed by them.
    fn write_tasks(&self) -> Result<(), StorageError> {
        let index = "__index_level_0__";
        let pandas = json!({
            "index_columns": [index],
            "column_indexes": [{
                "name": null, "field_name": null, "pandas_type": "unicode", "numpy_type": "object",
                "metadata": { "encoding": "UTF-8" },
            }],
            "columns": [
                { "name": "task_index", "field_name": "task_index", "pandas_type": "int64",
                  "numpy_type": "int64", "metadata": null },
                { "name": null, "field_name": index, "pandas_type": "unicode", "numpy_type": "object",
                  "metadata": null },
            ],
            "creator": { "library": "catena", "version": env!("CARGO_PKG_VERSION") },
            "pandas_version": "2.0.0",
        });
        let schema = Schema::new(vec![
            Field::new("task_index", DataType::Int64, true),
            Field::new(index, DataType::Utf8, true),
        ]);
        let numbers: Vec<i64> = (0..self.tasks.len() as i64).collect();
        let columns: Vec<ArrayRef> = vec![
            Arc::new(Int64Array::from(numbers)),
            Arc::new(StringArray::from_iter_values(&self.tasks)),
        ];
        // pyarrow looks for it in the schema that Arrow keeps, others among the notes of the file.
        let schema = schema.with_metadata([("pandas".to_owned(), pandas.to_string())].into());
        let note = KeyValue::new("pandas".to_owned(), pandas.to_string());
        write_table(
            &self.folder.join("meta/tasks.parquet"),
            schema,
            columns,
            Some(note),
        )
    }

    fn write_episodes(&self) -> Result<(), StorageError> {
        let text = Arc::new(Field::new_list_field(DataType::Utf8, true));
        let mut tasks = ListBuilder::new(StringBuilder::new());
        for episode in &self.episodes {
            tasks.values().append_value(&self.tasks[episode.task]);
            tasks.append(true);
        }
        let numbers = |of: fn(&EpisodeRow) -> u64| -> ArrayRef {
            Arc::new(
                self.episodes
                    .iter()
                    .map(|e| Some(of(e) as i64))
                    .collect::<Int64Array>(),
            )
        };
        let indices: Int64Array = (0..self.episodes.len() as i64).map(Some).collect();
        let columns: Vec<(&str, ArrayRef)> = vec![
            ("episode_index", Arc::new(indices)),
            ("tasks", Arc::new(tasks.finish())),
            ("length", numbers(|e| e.length)),
            ("data/chunk_index", numbers(|e| e.file / CHUNK_FILES)),
            ("data/file_index", numbers(|e| e.file % CHUNK_FILES)),
            ("dataset_from_index", numbers(|e| e.from)),
            ("dataset_to_index", numbers(|e| e.from + e.length)),
            ("meta/episodes/chunk_index", numbers(|_| 0)),
            ("meta/episodes/file_index", numbers(|_| 0)),
        ];
        let field = |name: &str| match name {
            "tasks" => Field::new(name, DataType::List(Arc::clone(&text)), true),
            _ => Field::new(name, DataType::Int64, true),
        };
        let schema = Schema::new(columns.iter().map(|(n, _)| field(n)).collect::<Vec<_>>());
        let columns = columns.into_iter().map(|(_, c)| c).collect();
        let path = self.folder.join("meta/episodes/chunk-000/file-000.parquet");
        write_table(&path, schema, columns, None)
    }
}

impl PictureFormat {
    fn ending(self) -> &'static str {
        match self {
            Self::Png => "png",
            Self::Jpeg => "jpg",
        }
    }

    fn encoded(self, images: &[&Image]) -> Result<Vec<Vec<u8>>, String> {
        use rayon::prelude::*;
        images
            .par_iter()
            .map(|image| match self {
                Self::Png => encode_png(image),
                Self::Jpeg => encode_jpeg(image, JPEG_QUALITY),
            })
            .collect()
    }
}

const IMAGES: &str = "observation.images.";

fn image_key(camera: &str) -> String {
    format!("{IMAGES}{camera}")
}

/// Numbers in an action: one a dimension, or one a motion primitive.
fn width(space: &ActionSpace) -> usize {
    match space {
        ActionSpace::Primitives { names } | ActionSpace::Continuous { names } => names.len(),
        ActionSpace::Binned { dimensions } => dimensions.len(),
    }
}

/// An action as numbers: a motion primitive is a one among zeros.
fn row(action: &Action, width: usize) -> Vec<f64> {
    match action {
        Action::Primitive(index) => (0..width)
            .map(|i| f64::from(u8::from(i == *index)))
            .collect(),
        Action::Continuous(values) => values.iter().map(|v| f64::from(*v)).collect(),
    }
}

/// Steps a second: the inverse of the median time between two, to the next whole number.
fn rate(trajectory: &Trajectory) -> u32 {
    const DEFAULT: u32 = 5;
    let times: Vec<f64> = trajectory.steps.iter().map(|s| s.time_secs).collect();
    let mut gaps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_by(f64::total_cmp);
    match gaps.get(gaps.len() / 2) {
        Some(gap) if *gap > 0.0 => ((1.0 / gap).round() as u32).max(1),
        _ => DEFAULT,
    }
}

fn camera_list(cameras: &[CameraSpec]) -> String {
    let names: Vec<_> = cameras
        .iter()
        .map(|c| format!("{} {}x{}", c.name, c.height, c.width))
        .collect();
    names.join(", ")
}

fn fields(cameras: &[CameraSpec], width: usize) -> Vec<Field> {
    let mut fields: Vec<Field> = cameras
        .iter()
        .map(|c| Field::new(image_key(&c.name), DataType::Struct(picture_fields()), true))
        .collect();
    let action = match width {
        1 => DataType::Float32,
        _ => DataType::FixedSizeList(Arc::new(item()), width as i32),
    };
    fields.push(Field::new(ACTION, action, true));
    fields.push(Field::new("timestamp", DataType::Float32, true));
    for name in ["frame_index", "episode_index", "index", "task_index"] {
        fields.push(Field::new(name, DataType::Int64, true));
    }
    fields
}

fn item() -> Field {
    Field::new_list_field(DataType::Float32, true)
}

fn picture_fields() -> Fields {
    Fields::from(vec![
        Field::new("bytes", DataType::Binary, true),
        Field::new("path", DataType::Utf8, true),
    ])
}

fn picture_column(files: &[Vec<u8>], ending: &str) -> ArrayRef {
    let bytes = BinaryArray::from_iter_values(files);
    let paths = (0..files.len()).map(|i| format!("frame-{i:06}.{ending}"));
    let paths = StringArray::from_iter_values(paths);
    Arc::new(StructArray::new(
        picture_fields(),
        vec![Arc::new(bytes), Arc::new(paths)],
        None,
    ))
}

fn action_column(width: usize, values: Vec<f32>) -> Result<ArrayRef, String> {
    let values = Arc::new(Float32Array::from(values));
    if width == 1 {
        return Ok(values);
    }
    FixedSizeListArray::try_new(Arc::new(item()), width as i32, values, None)
        .map(|array| Arc::new(array) as ArrayRef)
        .map_err(|e| e.to_string())
}

/// Snappy, which every reader of Parquet knows; images are compressed already.
fn properties(note: Option<KeyValue>) -> WriterProperties {
    WriterProperties::builder()
        .set_created_by(concat!("catena ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::SNAPPY)
        .set_key_value_metadata(note.map(|n| vec![n]))
        .build()
}

fn write_table(
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

fn write_json(path: &Path, value: &Value) -> Result<(), StorageError> {
    make_parent(path)?;
    let text = format!("{value:#}\n");
    fs::write(path, text).map_err(StorageError::io("write", path))
}

fn make_parent(path: &Path) -> Result<(), StorageError> {
    let folder = path.parent().unwrap_or(path);
    fs::create_dir_all(folder).map_err(StorageError::io("create", folder))
}
