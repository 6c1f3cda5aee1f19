//! A dataset of version 3.0 from recordings, episode by episode. Images are files within the tables, so that
//! nothing is needed to read them.

mod columns;
mod metadata;
mod tables;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use arrow::array::{ArrayRef, Float32Array, Int64Array};
use arrow::datatypes::{Schema, SchemaRef};
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use serde_json::{Value, json};

use self::columns::{IMAGES, action_column, fields, image_key, picture_column, row, width};
use self::tables::{make_parent, properties, write_json};
use super::info::{ACTION, MAX_FPS};
use super::restored::{FILE, Restored, RestoredEpisode};
use super::statistics::Statistics;
use super::{INFO, StorageError, fault};
use crate::storage::RecordingReport;
use crate::storage::pixels::{encode_jpeg, encode_png};
use crate::trajectory::{ActionSpace, CameraSpec, Image, Step, Trajectory};

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
/// Steps that are written at once. An array of pictures holds less than 2 GiB, which some thousands of them exceed.
const BATCH_STEPS: usize = 32;
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
        let path = self.data_path();
        let wrong = |e: &dyn std::fmt::Display| fault(&path, format!("cannot be written: {e}"));
        for (number, steps) in trajectory.steps.chunks(BATCH_STEPS).enumerate() {
            let columns = self.columns(steps, number * BATCH_STEPS, task)?;
            let batch =
                RecordBatch::try_new(Arc::clone(&self.schema), columns).map_err(|e| wrong(&e))?;
            let table = self.open_table(&path)?;
            table.write(&batch).map_err(|e| wrong(&e))?;
            // What is not flushed is in memory.
            if table.in_progress_size() as u64 >= FILE_BYTES {
                table.flush().map_err(|e| wrong(&e))?;
            }
        }
        let mut bytes = 0;
        if let Some(table) = &mut self.table {
            // An episode is a row group, or several, so that one can be read without the others.
            table.flush().map_err(|e| wrong(&e))?;
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

    /// The table that is written to; a new one at this path where the last was ended.
    fn open_table(&mut self, path: &Path) -> Result<&mut ArrowWriter<File>, StorageError> {
        let table = if let Some(table) = self.table.take() {
            table
        } else {
            make_parent(path)?;
            let file = File::create(path).map_err(StorageError::io("create", path))?;
            ArrowWriter::try_new(file, Arc::clone(&self.schema), Some(properties(None)))
                .map_err(|e| fault(path, format!("cannot be written: {e}")))?
        };
        Ok(self.table.insert(table))
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

    /// The columns of some steps of an episode, the first of which is step `first`, in the order of the schema.
    fn columns(
        &mut self,
        steps: &[Step],
        first: usize,
        task: usize,
    ) -> Result<Vec<ArrayRef>, StorageError> {
        let path = self.data_path();
        let mut columns = Vec::new();
        for camera in &self.cameras {
            let images: Vec<&Image> = steps
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
            columns.push(picture_column(&files, first, self.pictures.ending()));
        }
        let width = width(&self.space);
        let mut values = Vec::with_capacity(width * steps.len());
        for step in steps {
            let row = row(&step.action, width);
            self.note(ACTION, &row);
            values.extend(row.iter().map(|v| *v as f32));
        }
        columns.push(action_column(width, values).map_err(|e| fault(&path, e))?);
        let numbers = first as i64..(first + steps.len()) as i64;
        let episode = self.episodes.len() as i64;
        let before = self.frames as i64;
        let fps = self.fps as f32;
        let secs: Vec<f32> = numbers.clone().map(|i| i as f32 / fps).collect();
        for value in &secs {
            self.note("timestamp", &[f64::from(*value)]);
        }
        columns.push(Arc::new(Float32Array::from(secs)));
        for (name, value) in [
            ("frame_index", numbers.clone().collect::<Vec<i64>>()),
            ("episode_index", vec![episode; steps.len()]),
            ("index", numbers.map(|i| before + i).collect()),
            ("task_index", vec![task as i64; steps.len()]),
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

/// Steps a second: the inverse of the median time between two, to the next whole number that a dataset may have.
fn rate(trajectory: &Trajectory) -> u32 {
    const DEFAULT: u32 = 5;
    let times: Vec<f64> = trajectory.steps.iter().map(|s| s.time_secs).collect();
    let mut gaps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    gaps.sort_by(f64::total_cmp);
    match gaps.get(gaps.len() / 2) {
        Some(gap) if *gap > 0.0 => (1.0 / gap).round().clamp(1.0, MAX_FPS) as u32,
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
