//! Mapping files: which recordings, which topic is which camera and which the action, how often a step
//! is taken, how large images are, how actions are cut into bins.

mod actions;
mod read;
mod spec;

use std::path::{Path, PathBuf};

use serde_yaml::Spanned;

use super::ending::is_yaml;
use super::{StorageError, bag, nearest};
use crate::trajectory::{ActionSpace, Binning};
use crate::wording;

pub(super) use actions::ActionShape;
pub(crate) use read::MAX_BINS;
pub(super) use spec::{Combine, Size};

/// A mapping file that is sound in itself.
#[derive(Clone, Debug)]
pub(super) struct Mapping {
    path: PathBuf,
    /// Absolute or relative to the working folder.
    pub recordings: Vec<PathBuf>,
    spec: spec::MappingSpec,
}

/// What a mapping file says of a topic with images.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SaidOfTopic<'a> {
    /// It is this camera.
    Camera(&'a str),
    /// Other topics are the cameras.
    NoCamera,
    /// Cameras are found by the types of topics.
    Nothing,
}

/// Whether a path is taken for a mapping file: any YAML file but the metadata of a bag.
pub(super) fn is_mapping(path: &Path) -> bool {
    is_yaml(path) && path.is_file() && !bag::is_metadata(path)
}

impl Mapping {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the task is called: as the file says, else as the file is called.
    pub fn task(&self) -> String {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        self.said_task().unwrap_or(&stem).to_owned()
    }

    /// What the task is called, if the file says so.
    pub fn said_task(&self) -> Option<&str> {
        self.spec.task.as_ref().map(|t| t.value.as_str())
    }

    /// Every how many actions a step is taken, if that is said.
    pub fn every(&self) -> Option<usize> {
        self.spec.every.as_ref().map(|e| e.value)
    }

    /// How many steps a second are taken, if that is said.
    pub fn rate_hz(&self) -> Option<f64> {
        self.spec.rate_hz.as_ref().map(|r| r.value)
    }

    /// The size that a camera's images get, if that is said.
    pub fn image_size(&self, camera: &str) -> Option<Size> {
        let own = self.spec.image_sizes.as_ref().and_then(|s| s.get(camera));
        own.or(self.spec.image_size.as_ref()).map(|s| s.value)
    }

    /// What the file says of a topic with images.
    pub fn camera_of(&self, topic: &str) -> SaidOfTopic<'_> {
        let Some(cameras) = &self.spec.topics.cameras else {
            return SaidOfTopic::Nothing;
        };
        let found = cameras.iter().find(|(_, t)| t.value == topic);
        found.map_or(SaidOfTopic::NoCamera, |(name, _)| SaidOfTopic::Camera(name))
    }

    /// The topic of actions, if that is said.
    pub fn action_topic(&self) -> Option<&str> {
        self.spec.topics.action.as_ref().map(|t| t.value.as_str())
    }

    /// The topic of the task's text, if that is said.
    pub fn task_topic(&self) -> Option<&str> {
        self.spec.topics.task.as_ref().map(|t| t.value.as_str())
    }

    /// The topic of subgoals, if that is said.
    pub fn subgoal_topic(&self) -> Option<&str> {
        self.spec.topics.subgoal.as_ref().map(|t| t.value.as_str())
    }

    /// Refuses a recording that lacks a topic that the file names.
    pub fn check_topics(
        &self,
        recording: &Path,
        kind: &str,
        topics: &[&str],
    ) -> Result<(), StorageError> {
        let spec = &self.spec.topics;
        let cameras = spec.cameras.iter().flat_map(|c| c.values());
        let named = cameras.chain(&spec.action);
        for wanted in named {
            if !topics.contains(&wanted.value.as_str()) {
                let message = format!("{} has no {kind} '{}'", recording.display(), wanted.value);
                return Err(self.fault(wanted, message, suggestion(kind, &wanted.value, topics)));
            }
        }
        Ok(())
    }

    /// Refuses a topic or feature that gives no pictures where the file names it as a camera.
    pub fn check_camera(
        &self,
        recording: &Path,
        topic: &str,
        why_none: &str,
    ) -> Result<(), StorageError> {
        let mut cameras = self.spec.topics.cameras.iter().flatten();
        let Some((name, place)) = cameras.find(|(_, named)| named.value == topic) else {
            return Ok(());
        };
        let message = format!(
            "'{topic}' of {} cannot be camera '{name}': {why_none}",
            recording.display()
        );
        let help = "Leave it out of the cameras: pictures have colours, or grey values of 8 bits";
        Err(self.fault(place, message, help))
    }

    /// Refuses a recording that lacks a camera of which the file names the size.
    pub fn check_sizes(&self, recording: &Path, cameras: &[&str]) -> Result<(), StorageError> {
        let mut sizes = self.spec.image_sizes.iter().flatten();
        let Some((name, size)) = sizes.find(|(name, _)| !cameras.contains(&name.as_str())) else {
            return Ok(());
        };
        let message = format!(
            "image_sizes names '{name}', and {} has no such camera",
            recording.display()
        );
        Err(self.fault(size, message, suggestion("camera", name, cameras)))
    }

    /// Refuses a rate that the actions of a recording do not have.
    pub fn check_rate(&self, recording: &Path, actual_hz: f64) -> Result<(), StorageError> {
        // Clocks jitter.
        const SLACK: f64 = 1.5;
        match &self.spec.rate_hz {
            Some(rate) if actual_hz > 0.0 && rate.value > SLACK * actual_hz => {
                let message = format!(
                    "rate_hz is {}, but the actions of {} come at {actual_hz:.1} Hz",
                    rate.value,
                    recording.display()
                );
                let help = format!(
                    "Steps are chosen among the actions, never made up: give a rate of at most {actual_hz:.1}, \
                     or leave it out to take every action"
                );
                Err(self.fault(rate, message, help))
            }
            _ => Ok(()),
        }
    }

    /// How actions are cut into bins; what the file does not say is `bins` equal bins.
    pub fn binning(&self, bins: usize) -> Binning {
        self.spec.actions.binning(bins)
    }

    /// What becomes of the actions of a recording.
    pub fn shape(
        &self,
        recording: &Path,
        space: &ActionSpace,
    ) -> Result<ActionShape, StorageError> {
        actions::shape(self, recording, space)
    }

    fn fault<T>(
        &self,
        place: &Spanned<T>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> StorageError {
        let at = place.referenced;
        read::fault(&self.path, Some((at.line(), at.column())), message, help)
    }
}

/// The nearest name there is, and all of them.
fn suggestion(kind: &str, wanted: &str, known: &[&str]) -> String {
    const SHOWN: usize = 12;
    let all = wording::listed(known, SHOWN);
    if all.is_empty() {
        return format!("It has no {kind} at all");
    }
    match nearest(wanted, known.iter().copied()) {
        Some(near) => format!("Did you mean '{near}'? It has {all}"),
        None => format!("It has {all}"),
    }
}

#[cfg(test)]
mod tests;
