//! One recording, wherever it lies.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::storage::left_out::why_left_out;
use crate::storage::lerobot::{Dataset, inspect_episode, read_episode};
use crate::storage::recording::{inspect_mcap, read_mcap};
use crate::storage::view::View;
use crate::storage::{Loss, Recording, RecordingReport, StorageError, bag};
use crate::trajectory::{ActionSpace, Trajectory};

/// One recording.
#[derive(Clone, Debug)]
pub(super) struct Source {
    /// The file, or the dataset with the name of the episode.
    pub(super) place: PathBuf,
    pub(super) container: Container,
    pub(super) view: View,
    /// What its mapping file says that the task is called; none where it does not, or where datasets tell of several
    /// tasks, which keep their names.
    pub(super) task_by_mapping: Option<String>,
}

#[derive(Clone, Debug)]
pub(super) enum Container {
    /// One after another.
    Mcap { files: Vec<PathBuf> },
    Episode {
        dataset: Arc<Dataset>,
        number: usize,
    },
}

impl Source {
    pub(super) fn read(&self) -> Result<Recording, StorageError> {
        let read = match &self.container {
            Container::Mcap { files } => read_mcap(&self.place, files, &self.view),
            Container::Episode { dataset, number } => read_episode(dataset, *number, &self.view),
        };
        let mut recording = match read {
            Err(error) if error.tells_of_too_little() => self.remains(error)?,
            read => read?,
        };
        self.check_cameras(&recording.report)?;
        if let Some(task) = &self.task_by_mapping {
            recording.trajectory.task.clone_from(task);
            recording.report.task.clone_from(task);
        }
        Ok(recording)
    }

    /// A recording that is so damaged that no step is left of it, to be left out with what was to be said of it; where
    /// nothing is lost that is an error.
    fn remains(&self, error: StorageError) -> Result<Recording, StorageError> {
        let inspected = self.inspect().ok();
        let damaged = inspected.filter(|r| r.losses.iter().any(Loss::takes_messages));
        let Some(mut report) = damaged else {
            return Err(error);
        };
        let told = error.to_string();
        let place = format!("{}: ", report.path.display());
        let told = told.strip_prefix(&place).unwrap_or(&told);
        report.left_out = Some(format!(
            "it is damaged, and what is left makes no step: {told}"
        ));
        let trajectory = Trajectory {
            id: self.place.display().to_string(),
            task: report.task.clone(),
            action_space: ActionSpace::Continuous { names: Vec::new() },
            steps: Vec::new(),
            markers: Vec::new(),
        };
        Ok(Recording { trajectory, report })
    }

    pub(super) fn inspect(&self) -> Result<RecordingReport, StorageError> {
        let mut report = match &self.container {
            Container::Mcap { files } => inspect_mcap(&self.place, files, &self.view),
            Container::Episode { dataset, number } => inspect_episode(dataset, *number, &self.view),
        }?;
        self.check_cameras(&report)?;
        report.left_out = why_left_out(&report);
        if let Some(task) = &self.task_by_mapping {
            report.task.clone_from(task);
        }
        Ok(report)
    }

    /// Refuses a mapping file that gives a size to a camera that is not there, unless it may be what was lost.
    fn check_cameras(&self, report: &RecordingReport) -> Result<(), StorageError> {
        let mapping = self.view.mapping.as_ref();
        let is_whole = !report.losses.iter().any(Loss::takes_messages);
        let Some(mapping) = mapping.filter(|_| is_whole) else {
            return Ok(());
        };
        let cameras = report.cameras.iter().map(|c| c.spec.name.as_str());
        mapping.check_sizes(&self.place, &cameras.collect::<Vec<_>>())
    }

    /// Files by their paths, episodes by their dataset and number.
    pub(super) fn order(&self) -> (&Path, usize) {
        match &self.container {
            Container::Mcap { .. } => (&self.place, 0),
            Container::Episode { dataset, number } => (&dataset.root, *number),
        }
    }

    /// What is the same whichever path leads there; and whether this one does without links.
    pub(super) fn identity(&self) -> ((PathBuf, usize), bool) {
        let (path, number) = self.order();
        let real = real(path);
        let is_own_path = real.ends_with(path.strip_prefix(".").unwrap_or(path));
        ((real, number), is_own_path)
    }

    /// The files of a bag of several; none of other recordings.
    pub(super) fn parts(&self) -> &[PathBuf] {
        match &self.container {
            Container::Mcap { files } if files.len() > 1 => files,
            _ => &[],
        }
    }

    /// The files of a recording in MCAP, with the one that names those of a bag; none of an episode.
    pub(super) fn mcap_files(&self) -> Vec<PathBuf> {
        let Container::Mcap { files } = &self.container else {
            return Vec::new();
        };
        let mut files = files.clone();
        if files.len() > 1 {
            files.push(self.place.join(bag::METADATA_FILE));
        }
        files
    }

    /// What the task is called where the container says so without being read.
    pub(super) fn task(&self) -> Option<String> {
        match &self.container {
            Container::Mcap { .. } => None,
            Container::Episode { dataset, number } => {
                let task = dataset.task(&dataset.episodes[*number]);
                (!task.is_empty()).then_some(task)
            }
        }
    }
}

/// A path from the root on without links; the path itself where nothing is there.
pub(super) fn real(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}
