//! Demonstrations as commands read them.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use super::arguments::ReadArguments;
use super::error::CliError;
use crate::inference::Model;
use crate::loading::in_folder;
use crate::storage::{ReadOptions, RecordingReport, Recordings, load_manifest};
use crate::trajectory::{ActionSpace, Binning, CameraSpec, DemonstrationSet, Trajectory};
use crate::wording::{counted, listed};

/// How recordings are to be read.
pub(super) fn read_options(arguments: &ReadArguments) -> ReadOptions {
    ReadOptions {
        every: arguments.every.map(|every| every as usize),
        image_size: arguments.image_size,
    }
}

/// Recordings of one task, and what is in each.
pub(super) type ReadSet = (DemonstrationSet, Vec<RecordingReport>);

/// The demonstrations of a task, and what is to be said of each recording; which of them are left out, and what was
/// lost of a damaged one, is told.
pub(super) fn read_demonstrations(
    recordings: &Recordings,
    task: &str,
) -> Result<ReadSet, CliError> {
    let read = recordings.demonstrations(task)?;
    warn(task, &read.1);
    for note in values_beyond(&read.0, &recordings.binning(1)) {
        eprintln!("note: {note}");
    }
    Ok(read)
}

/// The same of practice with the gripper.
pub(super) fn read_practice(recordings: &Recordings, task: &str) -> Result<ReadSet, CliError> {
    let read = recordings.practice(task)?;
    warn(task, &read.1);
    Ok(read)
}

fn warn(task: &str, reports: &[RecordingReport]) {
    for report in reports {
        match &report.left_out {
            _ if !report.losses.is_empty() => eprintln!("warning: {report}"),
            Some(reason) => eprintln!("warning: {} is left out: {reason}", report.place()),
            None => {}
        }
    }
    tell_unused(task, reports);
    let kept = reports.iter().filter(|r| r.left_out.is_none());
    let told: BTreeSet<&str> = kept.map(|r| r.task.as_str()).collect();
    if told.len() > 1 {
        const SHOWN: usize = 4;
        let told = listed(told.iter().map(|told| format!("'{told}'")), SHOWN);
        eprintln!(
            "warning: the recordings of '{task}' call their task {told}; all of them are taken as one task"
        );
    }
}

/// Which values of continuous actions lie beyond the ranges that a mapping file gives, once for all recordings.
fn values_beyond(set: &DemonstrationSet, binning: &Binning) -> Vec<String> {
    let among = |trajectories: &[Trajectory]| {
        let steps = trajectories.iter().flat_map(|t| &t.steps);
        binning.beyond(set.action_space(), steps.map(|s| &s.action))
    };
    let all = among(set.trajectories());
    let notes = all.iter().map(|beyond| {
        let has_some = |t: &&Trajectory| {
            let own = among(std::slice::from_ref(*t));
            own.iter().any(|own| own.dimension == beyond.dimension)
        };
        let recordings = set.trajectories().iter().filter(has_some).count();
        let recordings = counted(recordings, "recording");
        format!("in {recordings} of '{}': {beyond}", set.task())
    });
    notes.collect()
}

/// What is there and not used, such as depth cameras, once for all recordings.
fn tell_unused(task: &str, reports: &[RecordingReport]) {
    const SHOWN: usize = 8;
    let notes: BTreeSet<&String> = reports.iter().flat_map(|r| &r.notes).collect();
    for note in notes.iter().take(SHOWN) {
        eprintln!("note: not used in the recordings of '{task}': {note}");
    }
    if notes.len() > SHOWN {
        let more = notes.len() - SHOWN;
        eprintln!("note: and {more} more, which `catena demos` shows");
    }
}

/// Warns where what is to be judged by recordings that are not in a graph is judged by those that it was built from.
pub(super) fn warn_of_own(recordings: &Recordings, graph: &Path) {
    let own = load_manifest(graph).ok().map(|m| m.demonstrations_digest);
    if own.is_some_and(|own| recordings.digest().is_ok_and(|digest| digest == own)) {
        eprintln!(
            "warning: {} was built from these recordings; others of the task say how well it does",
            in_folder(graph)
        );
    }
}

/// Refuses demonstrations whose actions mean something else in the action space of a model.
fn ensure_same_actions(set: &DemonstrationSet, space: &ActionSpace) -> Result<(), CliError> {
    let recorded = set.action_space();
    if space.takes_actions_of(recorded) {
        return Ok(());
    }
    let are_values = |space: &ActionSpace| !matches!(space, ActionSpace::Primitives { .. });
    let way_out = if are_values(space) && are_values(recorded) {
        "list the model's names in its order under 'keep' of the 'actions' in a mapping file (under 'names' where the \
         same values are only called otherwise)"
    } else {
        "record with the actions of the model, primitives in its order"
    };
    let first = set.trajectories().first();
    Err(CliError::ActionsDiffer {
        task: set.task().to_owned(),
        trajectory: first.map(|t| t.id.clone()).unwrap_or_default(),
        found: recorded.with_names(),
        expected: space.with_names(),
        way_out,
    })
}

/// Refuses demonstrations that a camera of a model did not see.
fn ensure_cameras(set: &DemonstrationSet, cameras: &[CameraSpec]) -> Result<(), CliError> {
    let present = set.cameras();
    let is_missing = |camera: &&CameraSpec| present.iter().all(|c| c.name != camera.name);
    let Some(missing) = cameras.iter().find(is_missing) else {
        return Ok(());
    };
    let first = set.trajectories().first();
    Err(CliError::CameraMissing {
        task: set.task().to_owned(),
        trajectory: first.map(|t| t.id.clone()).unwrap_or_default(),
        wanted: missing.name.clone(),
        present: listed(present.iter().map(|c| &c.name), present.len()),
    })
}

/// The demonstrations as a model takes them: with its action space, which has bins where the recordings have
/// none, and with the images of its cameras in their size. Demonstrations with other actions, or without one of the
/// cameras, are refused.
pub(super) fn in_model_space(
    set: &DemonstrationSet,
    model: &Model,
) -> Result<DemonstrationSet, CliError> {
    let spec = &model.manifest().spec;
    ensure_same_actions(set, &spec.action_space)?;
    ensure_cameras(set, &spec.cameras)?;
    let mut trajectories = set.trajectories().to_vec();
    for trajectory in &mut trajectories {
        trajectory.action_space = spec.action_space.clone();
        for step in &mut trajectory.steps {
            step.observation = Arc::new(step.observation.fitted(&spec.cameras)?);
        }
    }
    Ok(DemonstrationSet::new(set.task(), trajectories)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{Action, ActionDimension, DimensionBinning, Image, Observation, Step};

    /// One demonstration of one step, seen by the camera `head`, with actions of these names.
    fn recorded(names: &[&str]) -> DemonstrationSet {
        let image = Image::new(1, 1, vec![0; 3]).expect("one pixel");
        let trajectory = Trajectory {
            id: "demo".to_owned(),
            task: "cup".to_owned(),
            action_space: ActionSpace::Continuous {
                names: names.iter().map(|n| (*n).to_owned()).collect(),
            },
            steps: vec![Step {
                time_secs: 0.0,
                observation: Arc::new(Observation::new([("head".to_owned(), image)])),
                action: Action::Continuous(vec![0.0; names.len()]),
            }],
            markers: Vec::new(),
        };
        DemonstrationSet::new("cup", vec![trajectory]).expect("one trajectory")
    }

    #[test]
    fn values_beyond_a_given_range_are_told_once_for_all_recordings() {
        let one = recorded(&["x", "y"]).trajectories()[0].clone();
        let set = DemonstrationSet::new("cup", vec![one.clone(), one]).expect("two alike");
        let mut binning = Binning::uniform(3);
        assert!(values_beyond(&set, &binning).is_empty());
        let range = DimensionBinning {
            low: Some(0.5),
            ..DimensionBinning::uniform(3)
        };
        binning.dimensions.insert("x".to_owned(), range);
        assert_eq!(
            values_beyond(&set, &binning),
            [
                "in 2 recordings of 'cup': 2 of 2 values of 'x' beyond the range that is given (below 0.5), and so in \
                 its outermost bins"
            ]
        );
    }

    #[test]
    fn recordings_without_a_camera_of_the_model_are_refused_with_the_way_out() {
        let told = |camera: &str| {
            let spec = CameraSpec {
                name: camera.to_owned(),
                height: 9,
                width: 16,
            };
            let checked = ensure_cameras(&recorded(&["x"]), &[spec]);
            checked.err().map(|e| e.to_string())
        };
        assert_eq!(told("head"), None);
        assert_eq!(
            told("wrist").as_deref(),
            Some(
                "the recordings of task 'cup', such as 'demo', have no camera 'wrist', which the model sees; they have \
                 head: name the topic of its images 'wrist' under 'cameras' of the 'topics' in a mapping file, or train \
                 a model with these recordings"
            )
        );
    }

    #[test]
    fn recordings_with_other_actions_than_the_model_are_refused_with_both_lists() {
        let told = |names: &[&str], of_model: &[&str]| {
            let set = recorded(names);
            let dimension = |name: &&str| ActionDimension::uniform(*name, 0.0, 1.0, 2);
            let dimensions = of_model.iter().map(dimension).collect();
            let checked = ensure_same_actions(&set, &ActionSpace::Binned { dimensions });
            checked.err().map(|e| e.to_string())
        };
        assert_eq!(told(&["x", "gripper"], &["x", "gripper"]), None);
        assert_eq!(told(&["action_0", "action_1"], &["x", "gripper"]), None);
        assert_eq!(told(&["x", "gripper"], &["action_0", "action_1"]), None);
        assert_eq!(
            told(&["gripper", "x"], &["x", "gripper"]).as_deref(),
            Some(
                "the recordings of task 'cup', such as 'demo', have 2 continuous dimensions (gripper, x), but the \
                 model has 2 binned dimensions (x, gripper): list the model's names in its order under 'keep' of the \
                 'actions' in a mapping file (under 'names' where the same values are only called otherwise), or train \
                 a model with these recordings"
            )
        );
    }
}
