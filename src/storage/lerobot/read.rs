//! An episode of a dataset to a trajectory.

use super::StorageError;
use super::dataset::{Camera, Cameras, Dataset};
use super::rows::Frames;
use crate::storage::recording::Recording;
use crate::storage::steps::Steps;
use crate::storage::view::View;
use crate::storage::{ActionReport, CameraReport, RecordingReport, TopicReport};
use crate::trajectory::{CameraSpec, Marker, Trajectory};

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
    let images = frames.images(&cameras.used, &wanted)?;
    let mut films = Vec::new();
    for camera in &cameras.used {
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

impl Frames<'_> {
    fn steps(&self, view: &View) -> Result<Steps, StorageError> {
        let shape = view.shape(&self.dataset.root, &self.space)?;
        Ok(Steps {
            chosen: view.chosen(&self.dataset.root, &shape.space, &self.times)?,
            times: self.times.clone(),
            shape,
        })
    }

    /// The rows whose images are needed.
    fn wanted_rows(&self, steps: &Steps) -> Vec<bool> {
        let mut wanted = vec![false; self.times.len()];
        for row in &steps.chosen {
            wanted[*row] = true;
        }
        wanted
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

    fn report(&self, steps: &Steps, cameras: &Cameras<'_>, view: &View) -> RecordingReport {
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
        let mut remarks = steps.remarks(std::iter::empty());
        if let Some(ranges) = view.ranges() {
            remarks.extend(steps.values_beyond(&ranges, &self.actions, 0));
        }
        remarks.extend(unread_topics(view));
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
            cameras: cameras.used.iter().map(camera).collect(),
            markers: self.markers(&steps.chosen_times()),
            topics: topics.collect(),
            texts: Vec::new(),
            metadata,
            losses: self.losses.clone(),
            notes: cameras.left_out.clone(),
            remarks,
            left_out: None,
        }
    }
}

/// The topics of texts that the mapping file names, which count for other recordings alone.
fn unread_topics(view: &View) -> impl Iterator<Item = String> {
    let mapping = view.mapping.as_ref();
    let task = mapping.and_then(|m| m.task_topic()).map(|topic| {
        format!(
            "{topic}, the topic of the task by the mapping file, is not read: the metadata of a dataset tell its tasks"
        )
    });
    let subgoal = mapping.and_then(|m| m.subgoal_topic()).map(|topic| {
        format!(
            "{topic}, the topic of subgoals by the mapping file, is not read: of a dataset meta/catena.json alone tells them"
        )
    });
    task.into_iter().chain(subgoal)
}
