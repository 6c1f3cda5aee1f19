//! An episode of a dataset to a trajectory.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

use super::dataset::{Camera, Dataset};
use super::episodes::Episode;
use super::frames::{Picture, Table, integers, numbers, pictures, vectors};
use super::template::inside;
use super::video::{Wanted, read_frames};
use super::{StorageError, fault};
use crate::storage::decode::decode_image;
use crate::storage::film::Film;
use crate::storage::recording::Recording;
use crate::storage::steps::Steps;
use crate::storage::topic::ImageFormat;
use crate::storage::view::View;
use crate::storage::{ActionReport, CameraReport, Loss, RecordingReport, TopicReport};
use crate::trajectory::{Action, ActionSpace, CameraSpec, Marker, Trajectory};

const TIMESTAMP: &str = "timestamp";
const FRAME_INDEX: &str = "frame_index";
/// Times as 32-bit floats are off by less.
const TIME_TOLERANCE_SECS: f64 = 1e-3;

/// The frames of an episode without their images.
struct Frames<'a> {
    dataset: &'a Dataset,
    episode: &'a Episode,
    path: PathBuf,
    table: Table,
    rows: Range<usize>,
    bytes: u64,
    /// The number of each frame within the episode.
    numbers: Vec<u64>,
    /// In nanoseconds, in order.
    times: Vec<u64>,
    action_key: String,
    space: ActionSpace,
    actions: Vec<Action>,
    losses: Vec<Loss>,
}

/// Reads an episode as a mapping file and options say.
pub(in crate::storage) fn read_episode(
    dataset: &Dataset,
    place: usize,
    view: &View,
) -> Result<Recording, StorageError> {
    let frames = Frames::load(dataset, place, view)?;
    let steps = frames.steps(view)?;
    let cameras = dataset.cameras(view)?;
    let chosen: Vec<u64> = steps.chosen_times();
    let mut report = frames.report(&steps, &cameras, view);
    let wanted = frames.wanted_rows(&steps);
    let images = frames.images(&cameras, &wanted)?;
    let mut films = Vec::new();
    for camera in &cameras {
        films.push(frames.film(camera, images.get(camera.key), &wanted, view)?);
    }
    let all = steps.trajectory_steps(&frames.path, &frames.actions, films, &mut report)?;
    let kept = &chosen[chosen.len() - all.len()..];
    let trajectory = Trajectory {
        id: dataset.episode_name(place),
        task: report.task.clone(),
        action_space: steps.shape.space,
        markers: frames.markers(kept),
        steps: all,
    };
    Ok(Recording { trajectory, report })
}

/// Says what is in an episode without reading its images.
pub(in crate::storage) fn inspect_episode(
    dataset: &Dataset,
    place: usize,
    view: &View,
) -> Result<RecordingReport, StorageError> {
    let frames = Frames::load(dataset, place, view)?;
    let steps = frames.steps(view)?;
    Ok(frames.report(&steps, &dataset.cameras(view)?, view))
}

impl<'a> Frames<'a> {
    fn load(dataset: &'a Dataset, place: usize, view: &View) -> Result<Self, StorageError> {
        let episode = &dataset.episodes[place];
        let path = dataset.root.join(&episode.data);
        let (action_key, feature) = dataset.action(view)?;
        let width = feature.shape[0] as usize;
        let table = Table::open(&path)?;
        let rows = table.rows_of(episode.index)?;
        let columns = [action_key, TIMESTAMP, FRAME_INDEX].map(str::to_owned);
        let (mut actions, mut secs, mut indices) = (Vec::new(), Vec::new(), Vec::new());
        for batch in table.read(&columns, Some(rows.clone()))? {
            let batch = batch?;
            let column = |name: &str| batch.column_by_name(name).cloned();
            let wrong = |name: &str, reason: &str| {
                let from = rows.start + actions.len();
                fault(
                    &path,
                    format!("column '{name}', rows from {from} on: {reason}"),
                )
            };
            let array = column(action_key).ok_or_else(|| wrong(action_key, "is missing"))?;
            let values = vectors(&array).map_err(|reason| wrong(action_key, &reason))?;
            let times = column(TIMESTAMP).as_ref().and_then(numbers);
            let times = times.ok_or_else(|| wrong(TIMESTAMP, "no numbers"))?;
            let numbers = column(FRAME_INDEX).as_ref().and_then(integers);
            let numbers = numbers.ok_or_else(|| wrong(FRAME_INDEX, "no whole numbers"))?;
            actions.extend(values);
            secs.extend(times);
            indices.extend(numbers);
        }
        let action_key = action_key.to_owned();
        let mut frames = Self {
            dataset,
            episode,
            bytes: std::fs::metadata(&path).map_or(0, |m| m.len()),
            path,
            table,
            rows,
            numbers: Vec::new(),
            times: Vec::new(),
            action_key,
            space: ActionSpace::Continuous {
                names: feature.action_names(),
            },
            actions: Vec::new(),
            losses: Vec::new(),
        };
        frames.number(&indices)?;
        frames.time(&secs)?;
        frames.act(&actions, width)?;
        Ok(frames)
    }

    fn at(&self, row: usize, column: &str, reason: &str) -> StorageError {
        let reason = format!(
            "row {} (frame {row} of episode {}), column '{column}': {reason}",
            self.rows.start + row,
            self.episode.index
        );
        fault(&self.path, reason)
    }

    /// Takes the numbers of the frames, which must rise; what is missing is a loss.
    fn number(&mut self, indices: &[i64]) -> Result<(), StorageError> {
        for (row, index) in indices.iter().enumerate() {
            let is_next = row == 0 || *index > indices[row - 1];
            match u64::try_from(*index) {
                Ok(number) if is_next => self.numbers.push(number),
                _ => {
                    let reason = format!("{index} does not come after the frame before it");
                    return Err(self.at(row, FRAME_INDEX, &reason));
                }
            }
        }
        let (found, said) = (indices.len() as u64, self.episode.length);
        if found > said {
            let reason = format!(
                "{found} rows are of episode {}, whose metadata says {said}: the two do not belong together",
                self.episode.index
            );
            return Err(fault(&self.path, reason));
        }
        let last = self.numbers.last().map_or(0, |n| n + 1);
        let missing = said.max(last) - found;
        if missing > 0 {
            self.losses.push(Loss::MissingFrames { frames: missing });
        }
        Ok(())
    }

    /// Times: those that were restored, else those of the frames' numbers, which the column must not
    /// contradict by going back.
    fn time(&mut self, secs: &[f64]) -> Result<(), StorageError> {
        if let Some(bad) = secs.iter().position(|s| !s.is_finite()) {
            return Err(self.at(bad, TIMESTAMP, &format!("{} is no time", secs[bad])));
        }
        let restored = self.dataset.restored.as_ref();
        let restored = restored.and_then(|r| r.episode(self.episode.index)?.times_secs.as_ref());
        let rises = |times: &[f64]| times.windows(2).all(|w| w[0] <= w[1]);
        if let Some(times) = restored.filter(|t| t.len() == secs.len() && rises(t)) {
            self.times = times.iter().map(|s| nanos(*s)).collect();
            return Ok(());
        }
        let fps = self.dataset.info.fps;
        let counted: Vec<f64> = self.numbers.iter().map(|n| *n as f64 / fps).collect();
        let late = |w: &&[f64]| w[1] < w[0];
        let back: Vec<f64> = secs.windows(2).filter(late).map(|w| w[0] - w[1]).collect();
        let is_regular = secs
            .iter()
            .zip(&counted)
            .all(|(a, b)| (a - secs[0] - (b - counted[0])).abs() < TIME_TOLERANCE_SECS);
        if !back.is_empty() {
            self.losses.push(Loss::TimesGoBack {
                topic: format!("column '{TIMESTAMP}'"),
                messages: back.len(),
                by_millis: (back.iter().fold(0.0, |a: f64, b| a.max(*b)) * 1e3) as u64,
            });
        }
        let times = if is_regular || !back.is_empty() {
            &counted
        } else {
            secs
        };
        self.times = times.iter().map(|s| nanos(*s)).collect();
        Ok(())
    }

    fn act(&mut self, rows: &[Vec<f64>], width: usize) -> Result<(), StorageError> {
        let restored = self.dataset.restored.as_ref().map(|r| &r.action_space);
        let restored = restored.filter(|_| self.action_key == super::info::ACTION);
        match restored {
            Some(ActionSpace::Primitives { names }) if names.len() == width => {
                self.space = ActionSpace::Primitives {
                    names: names.clone(),
                };
            }
            Some(ActionSpace::Continuous { names }) if names.len() == width => {
                self.space = ActionSpace::Continuous {
                    names: names.clone(),
                };
            }
            _ => {}
        }
        for (row, values) in rows.iter().enumerate() {
            let wrong = |reason: &str| self.at(row, &self.action_key, reason);
            if values.len() != width {
                let reason = format!("{} values, but info.json says {width}", values.len());
                return Err(wrong(&reason));
            }
            if let Some(bad) = values.iter().position(|v| !(*v as f32).is_finite()) {
                let reason = format!(
                    "value {bad} is {}: a robot cannot be told that. Leave the episode out, or mend the recording",
                    values[bad]
                );
                return Err(wrong(&reason));
            }
            let action = match &self.space {
                ActionSpace::Primitives { .. } => {
                    let ones = values.iter().filter(|v| **v == 1.0).count();
                    let zeros = values.iter().filter(|v| **v == 0.0).count();
                    let index = values.iter().position(|v| *v == 1.0);
                    let index = index.filter(|_| ones == 1 && ones + zeros == width);
                    Action::Primitive(index.ok_or_else(|| {
                        wrong("a motion primitive is a one among zeros, as meta/catena.json says")
                    })?)
                }
                _ => Action::Continuous(values.iter().map(|v| *v as f32).collect()),
            };
            self.actions.push(action);
        }
        Ok(())
    }

    fn steps(&self, view: &View) -> Result<Steps, StorageError> {
        let shape = view.shape(&self.dataset.root, &self.space)?;
        Ok(Steps {
            chosen: view.chosen(&self.dataset.root, &shape.space, &self.times)?,
            times: self.times.clone(),
            shape,
        })
    }

    /// The rows whose images are needed, and for each camera that lacks one of them the rows before.
    fn wanted_rows(&self, steps: &Steps) -> Vec<bool> {
        let mut wanted = vec![false; self.times.len()];
        for row in &steps.chosen {
            wanted[*row] = true;
        }
        wanted
    }

    /// The images of the table, by column, of the rows that are wanted.
    fn images(
        &self,
        cameras: &[Camera<'_>],
        wanted: &[bool],
    ) -> Result<BTreeMap<String, Vec<Picture>>, StorageError> {
        let keys: Vec<String> = cameras
            .iter()
            .filter(|c| !c.is_video)
            .map(|c| c.key.to_owned())
            .collect();
        let mut images: BTreeMap<String, Vec<Picture>> = BTreeMap::new();
        if keys.is_empty() {
            return Ok(images);
        }
        for batch in self.table.read(&keys, Some(self.rows.clone()))? {
            let batch = batch?;
            for key in &keys {
                let column = batch.column_by_name(key);
                let all = column.map_or(Err("is missing".to_owned()), pictures);
                let all =
                    all.map_err(|reason| fault(&self.path, format!("column '{key}' {reason}")))?;
                let taken = images.entry(key.clone()).or_default();
                for picture in all {
                    let is_wanted = wanted.get(taken.len()).copied().unwrap_or(false);
                    taken.push(if is_wanted { picture } else { Picture::None });
                }
            }
        }
        for picture in images.values_mut().flatten() {
            if let Picture::Path(path) = picture {
                *picture = Picture::Bytes(self.picture_file(path)?);
            }
        }
        Ok(images)
    }

    /// An image that lies beside the table.
    fn picture_file(&self, path: &str) -> Result<Vec<u8>, StorageError> {
        let inside = inside(path).map_err(|reason| fault(&self.path, reason))?;
        let path = self.dataset.root.join(inside);
        std::fs::read(&path).map_err(StorageError::io("read", &path))
    }

    fn film<'f>(
        &self,
        camera: &Camera<'_>,
        pictures: Option<&'f Vec<Picture>>,
        wanted: &[bool],
        view: &'f View,
    ) -> Result<Film<'f>, StorageError> {
        let Some(pictures) = pictures else {
            return self.video_film(camera, wanted, view);
        };
        let given: Vec<(u64, &[u8])> = pictures
            .iter()
            .zip(&self.times)
            .filter_map(|(picture, nanos)| match picture {
                Picture::Bytes(bytes) => Some((*nanos, bytes.as_slice())),
                _ => None,
            })
            .collect();
        let sizes = given.iter().find_map(|(_, bytes)| {
            let image = decode_image(ImageFormat::File, bytes).ok()?;
            Some((image.height(), image.width()))
        });
        let Some(size) = sizes else {
            let reason = given.first().map_or_else(
                || "no row holds an image".to_owned(),
                |(_, bytes)| {
                    decode_image(ImageFormat::File, bytes)
                        .err()
                        .unwrap_or_default()
                },
            );
            return Err(StorageError::UnusableCameras {
                path: self.path.clone(),
                reasons: format!("column '{}': {reason}", camera.key),
            });
        };
        let packing = (ImageFormat::File, size);
        Ok(Film::of_messages(
            &camera.name,
            camera.key,
            packing,
            view,
            given.into_iter(),
        ))
    }

    fn video_film<'f>(
        &self,
        camera: &Camera<'_>,
        wanted: &[bool],
        view: &'f View,
    ) -> Result<Film<'f>, StorageError> {
        let part = self.episode.videos.get(camera.key).ok_or_else(|| {
            let reason = format!(
                "episode {} has no video of '{}'",
                self.episode.index, camera.key
            );
            fault(&self.dataset.root.join("meta"), reason)
        })?;
        let rows = (0..wanted.len()).filter(|row| wanted[*row]);
        let numbers: Vec<u64> = rows.clone().map(|row| self.numbers[row]).collect();
        let time_of: BTreeMap<u64, u64> = rows
            .map(|row| (self.numbers[row], self.times[row]))
            .collect();
        let mut images = Vec::new();
        let request = Wanted {
            root: &self.dataset.root,
            camera: &camera.name,
            part,
            fps: self.dataset.info.fps,
            frames: &numbers,
        };
        let why = read_frames(&request, |number, image| {
            if let Some(nanos) = time_of.get(&number) {
                images.push((*nanos, view.sized(&camera.name, image)));
            }
        })?;
        let missing = numbers.len() - images.len();
        let missing = why.map_or_else(Vec::new, |why| vec![why; missing]);
        Ok(Film::of_images(
            &camera.name,
            camera.key,
            view,
            images,
            missing,
        ))
    }

    /// The markers that were restored, each at the first step at or after it.
    fn markers(&self, step_times: &[u64]) -> Vec<Marker> {
        let restored = self.dataset.restored.as_ref();
        let markers = restored.and_then(|r| Some(&r.episode(self.episode.index)?.markers));
        markers
            .into_iter()
            .flatten()
            .filter_map(|marker| {
                let nanos = self.times.get(marker.step)?;
                Some(Marker {
                    step: step_times.partition_point(|t| t < nanos),
                    name: marker.name.clone(),
                })
            })
            .filter(|marker| marker.step < step_times.len())
            .collect()
    }

    fn report(&self, steps: &Steps, cameras: &[Camera<'_>], view: &View) -> RecordingReport {
        let info = &self.dataset.info;
        let restored = self.dataset.restored.as_ref();
        let restored = restored.and_then(|r| r.episode(self.episode.index));
        let mut metadata = restored.map(|r| r.metadata.clone()).unwrap_or_default();
        if let Some(robot) = &info.robot_type {
            metadata
                .entry("robot".to_owned())
                .or_insert_with(|| robot.clone());
        }
        let count = self.times.len();
        let camera = |c: &Camera<'_>| {
            let (height, width) = c.feature.image_size().unwrap_or((0, 0));
            let size = view.image_size(&c.name);
            CameraReport {
                spec: CameraSpec {
                    name: c.name.clone(),
                    height: size.map_or(height, |s| s.height),
                    width: size.map_or(width, |s| s.width),
                },
                topic: c.key.to_owned(),
                images: count,
            }
        };
        let topics = info.features.iter().map(|(key, feature)| TopicReport {
            topic: key.clone(),
            type_name: format!("{}{:?}", feature.dtype, feature.shape),
            encoding: if feature.dtype == "video" {
                "video"
            } else {
                "parquet"
            }
            .to_owned(),
            messages: count,
            bytes: 0,
            rate_hz: info.fps,
        });
        let ends = self.times.first().zip(self.times.last());
        RecordingReport {
            path: self.dataset.root.clone(),
            episode: Some(self.episode.index as usize),
            bytes: self.bytes,
            profile: "lerobot".to_owned(),
            library: format!("LeRobot {}", info.codebase_version),
            task: self.dataset.task(self.episode),
            duration_secs: ends.map_or(0.0, |(a, b)| (b - a) as f64 / 1e9),
            steps: steps.chosen.len(),
            actions: Some(ActionReport {
                topic: self.action_key.clone(),
                space: steps.shape.space.clone(),
            }),
            cameras: cameras.iter().map(camera).collect(),
            markers: self.markers(&steps.chosen_times()),
            topics: topics.collect(),
            metadata,
            losses: self.losses.clone(),
            notes: Vec::new(),
            remarks: steps.remarks(std::iter::empty()),
            left_out: None,
        }
    }
}

fn nanos(secs: f64) -> u64 {
    (secs.max(0.0) * 1e9).round() as u64
}
