use std::collections::BTreeMap;
use std::path::Path;

use super::episode::{EPISODE_RECORD, HEADER_RECORD, keys};
use super::film::Film;
use super::layout::{ActionTopic, CameraTopic, Layout};
use super::scan::{Keep, Scan, TopicScan, seconds_between};
use super::steps::Steps;
use super::topic::Role;
use super::view::View;
use super::{Loss, RecordingReport, StorageError};
use crate::trajectory::Trajectory;

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
    read_mcap(path, &[path], &View::default())
}

/// Reads the MCAP files of a recording as a mapping file and options say. It goes by the name `path`.
pub(super) fn read_mcap(
    path: &Path,
    files: &[impl AsRef<Path>],
    view: &View,
) -> Result<Recording, StorageError> {
    let scan = Scan::of(files, Keep::AllImages, view)?;
    check_topics(path, &scan, view)?;
    let layout = Layout::of(&scan, view);
    let topic = layout.check(path, &scan)?;
    check_times(path, topic)?;
    let actions = topic.actions(path)?;
    let steps = layout.steps(path)?;
    let mut report = report(path, files.len(), &scan, &layout, steps.as_ref());
    let steps = steps.ok_or_else(|| StorageError::NoSteps {
        path: path.to_owned(),
        actions: actions.len(),
        cameras: layout.camera_names(),
    })?;
    let films = layout.cameras.iter().map(|c| Film::new(c, view)).collect();
    let trajectory_steps = steps.trajectory_steps(path, &actions, films, &mut report)?;
    // Undecodable images can take the first steps away, and their markers with them.
    let kept = &steps.chosen_times()[steps.chosen.len() - trajectory_steps.len()..];
    let trajectory = Trajectory {
        id: stem(path),
        task: report.task.clone(),
        action_space: steps.shape.space,
        markers: Layout::markers(&scan, kept),
        steps: trajectory_steps,
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
    inspect_mcap(path, &[path], &View::default())
}

/// Says what is in the MCAP files of a recording as a mapping file and options have them read.
pub(super) fn inspect_mcap(
    path: &Path,
    files: &[impl AsRef<Path>],
    view: &View,
) -> Result<RecordingReport, StorageError> {
    let scan = Scan::of(files, Keep::FirstImages, view)?;
    check_topics(path, &scan, view)?;
    let layout = Layout::of(&scan, view);
    let steps = layout.steps(path)?;
    Ok(report(path, files.len(), &scan, &layout, steps.as_ref()))
}

fn check_topics(path: &Path, scan: &Scan, view: &View) -> Result<(), StorageError> {
    let Some(mapping) = &view.mapping else {
        return Ok(());
    };
    for topic in scan.topics.values() {
        if let Role::Depth(how_told) = &topic.role {
            mapping.check_camera(path, &topic.channel.topic, how_told)?;
        }
    }
    // Of a damaged file they may be what is gone.
    if scan.salvage.losses.iter().any(Loss::takes_messages) {
        return Ok(());
    }
    let topics: Vec<&str> = scan.topics.keys().map(String::as_str).collect();
    mapping.check_topics(path, "topic", &topics)
}

/// Refuses actions that all have one time, as a recorder gives them that writes none: each would get the last image.
fn check_times(path: &Path, actions: &ActionTopic) -> Result<(), StorageError> {
    let scan = actions.scan;
    if scan.messages > 1 && scan.first_nanos == scan.last_nanos {
        return Err(StorageError::NoTimes {
            path: path.to_owned(),
            topic: scan.channel.topic.clone(),
            messages: scan.messages,
            secs: seconds_between(0, scan.first_nanos),
        });
    }
    Ok(())
}

fn report(
    path: &Path,
    files: usize,
    scan: &Scan,
    layout: &Layout,
    steps: Option<&Steps>,
) -> RecordingReport {
    let unseen = steps.map_or(0, |s| layout.unseen(s));
    let step_times = steps.map(Steps::chosen_times).unwrap_or_default();
    let step_times = &step_times[unseen..];
    let mut remarks = layout.remarks(steps);
    remarks.extend(layout.silent_topics(scan));
    remarks.extend(Layout::late_subgoals(scan, step_times));
    remarks.extend(layout.values_beyond(path, steps));
    if files > 1 {
        remarks.push(format!(
            "{files} files of one bag, read as one recording whichever of them is named"
        ));
    }
    let mut losses = scan.salvage.losses.clone();
    losses.extend(layout.losses(step_times));
    if unseen > 0 {
        losses.push(Loss::ActionsWithoutImages { actions: unseen });
    }
    RecordingReport {
        path: path.to_owned(),
        episode: None,
        bytes: scan.salvage.bytes,
        profile: scan.salvage.profile.clone(),
        library: scan.salvage.library.clone(),
        task: task_name(path, scan),
        duration_secs: scan.duration_secs(),
        steps: step_times.len(),
        actions: layout.actions.as_ref().map(|a| a.report(steps)),
        cameras: layout.cameras.iter().map(CameraTopic::report).collect(),
        markers: Layout::markers(scan, step_times),
        topics: scan.topics.values().map(TopicScan::report).collect(),
        texts: scan.text_topics(),
        metadata: flat_metadata(scan),
        losses,
        notes: layout.notes(),
        remarks,
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
