use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::episode::{EPISODE_RECORD, HEADER_RECORD, keys};
use super::film::Film;
use super::layout::{ActionTopic, CameraTopic, Layout};
use super::scan::{Keep, Scan, TopicScan, seconds_between};
use super::{RecordingReport, StorageError};
use crate::trajectory::{Observation, Step, Trajectory};

/// A trajectory as recorded, and what the file holds besides.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// All steps that have an action and an image of every camera.
    pub trajectory: Trajectory,
    /// What is in the file and what was lost.
    pub report: RecordingReport,
}

/// Reads a recording of ours or of somebody else's robot.
///
/// Cameras are all topics with images (`sensor_msgs` `CompressedImage` and `Image` as CDR,
/// `foxglove.CompressedImage` and `foxglove.RawImage` as protobuf), named for their topic:
/// `/camera/head/image_raw/compressed` is `head`. Actions are those of the topic `/action`, or else of
/// the shortest topic that ends in it. Every action makes a step, with the latest image of each camera
/// at or before it by log time; actions before the first image of every camera are left out. A marker
/// of the topic `/subgoal` belongs to the first step at or after it.
///
/// Damage does not stop it: chunks with a wrong checksum are left out, a file that is cut off yields
/// its complete messages, and [`RecordingReport::losses`] says what is missing.
///
/// # Errors
/// [`StorageError`] when the file cannot be read, is no MCAP file, or has no usable camera, no
/// actions, or actions or images that do not fit together. It names the file, the topic and the
/// reason.
pub fn read_trajectory(path: &Path) -> Result<Recording, StorageError> {
    let scan = Scan::of(path, Keep::AllImages)?;
    let layout = Layout::of(&scan);
    let topic = layout.check(path, &scan)?;
    let actions = topic.actions(path)?;
    let mut films: Vec<Film> = layout.cameras.iter().map(Film::new).collect();
    let alignment = Film::develop(&mut films, &topic.scan.times());
    let first = alignment.first_action;
    if first == actions.len() {
        return Err(StorageError::NoSteps {
            path: path.to_owned(),
            actions: actions.len(),
            cameras: layout.camera_names(),
        });
    }
    let times = &topic.scan.times()[first..];
    let mut report = report(path, &scan, &layout);
    for film in &films {
        film.check_sizes(path, times[0])?;
        report.losses.extend(film.loss());
    }
    let observation = |step: usize| {
        Observation::new(
            films
                .iter()
                .zip(&alignment.images)
                .map(|(film, images)| (film.name().to_owned(), film.image(images[step]).clone())),
        )
    };
    let steps = actions
        .into_iter()
        .skip(first)
        .enumerate()
        .map(|(step, action)| Step {
            time_secs: seconds_between(times[0], times[step]),
            observation: Arc::new(observation(step)),
            action,
        })
        .collect();
    let trajectory = Trajectory {
        id: stem(path),
        task: report.task.clone(),
        action_space: topic.space.clone(),
        steps,
        markers: report.markers.clone(),
    };
    Ok(Recording { trajectory, report })
}

/// Says what is in a recording without decoding more than the first image of each camera.
///
/// A file without images or actions is no error here: its topics are listed.
///
/// # Errors
/// [`StorageError::Io`], [`StorageError::EmptyFile`] or [`StorageError::NotMcap`].
pub fn inspect(path: &Path) -> Result<RecordingReport, StorageError> {
    let scan = Scan::of(path, Keep::FirstImages)?;
    Ok(report(path, &scan, &Layout::of(&scan)))
}

fn report(path: &Path, scan: &Scan, layout: &Layout) -> RecordingReport {
    let (steps, unseen) = layout.steps();
    let mut losses = scan.salvage.losses.clone();
    losses.extend(unseen);
    RecordingReport {
        path: path.to_owned(),
        bytes: scan.salvage.bytes,
        profile: scan.salvage.profile.clone(),
        library: scan.salvage.library.clone(),
        task: task_name(path, scan),
        duration_secs: scan.duration_secs(),
        steps,
        actions: layout.actions.as_ref().map(ActionTopic::report),
        cameras: layout.cameras.iter().map(CameraTopic::report).collect(),
        markers: layout.markers(scan, steps),
        topics: scan.topics.values().map(TopicScan::report).collect(),
        metadata: flat_metadata(scan),
        losses,
        notes: layout.notes(),
        left_out: None,
    }
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map(|s| s.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// The metadata's task, else the text on `/task`, else the folder's name.
fn task_name(path: &Path, scan: &Scan) -> String {
    let header = scan.salvage.metadata.get(HEADER_RECORD);
    header
        .and_then(|m| m.get(keys::TASK).cloned())
        .or_else(|| scan.task())
        .or_else(|| Some(path.parent()?.file_name()?.to_string_lossy().into_owned()))
        .unwrap_or_default()
}

/// Our own records key by key, those of others with the record's name before the key.
fn flat_metadata(scan: &Scan) -> BTreeMap<String, String> {
    let mut flat = BTreeMap::new();
    for (record, entries) in &scan.salvage.metadata {
        let is_ours = record == HEADER_RECORD || record == EPISODE_RECORD;
        for (key, value) in entries {
            if !is_ours {
                flat.insert(format!("{record}.{key}"), value.clone());
            } else if key != keys::TASK && key != keys::ACTION_SPACE {
                flat.insert(key.clone(), value.clone());
            }
        }
    }
    flat
}

#[cfg(test)]
mod tests;
