//! Recordings that an experiment is given.

use std::fs;
use std::path::{Path, PathBuf};

use crate::cli::error::CliError;
use crate::storage::{ReadOptions, RecordingReport, Recordings};

/// The MCAP recordings of a folder.
pub(super) struct Given {
    /// Those that count as demonstrations, sorted by name.
    pub(super) files: Vec<PathBuf>,
    /// What is to be said of those that a training leaves out. It leaves out one more where images that cannot be decoded
    /// make a camera stop early; that is not noticed here, where they are not decoded.
    pub(super) left_out: Vec<RecordingReport>,
}

impl Given {
    /// Looks at the recordings of a folder. What cannot be looked at counts, for the training to refuse.
    pub(super) fn of(folder: &Path) -> Result<Self, CliError> {
        let mut files = recordings_in(folder);
        let mut left_out: Vec<RecordingReport> = Vec::new();
        if !files.is_empty() {
            let inspected = Recordings::open(&files, &ReadOptions::default())?.inspect();
            let reports = inspected.into_iter().filter_map(Result::ok);
            left_out.extend(reports.filter(|report| report.left_out.is_some()));
        }
        files.retain(|file| left_out.iter().all(|report| report.path != *file));
        Ok(Self { files, left_out })
    }
}

/// The MCAP files of a folder, sorted by name.
pub(super) fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "mcap"))
        .collect();
    files.sort_unstable();
    files
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::storage::{RecordingMetadata, write_trajectory};
    use crate::trajectory::{Action, ActionSpace, Image, Observation, Step, Trajectory};

    fn write(file: &Path, success: Option<bool>) {
        let image = || Image::new(8, 8, vec![90_u8; 8 * 8 * 3]).unwrap();
        let step = |step: usize| Step {
            time_secs: step as f64,
            observation: Arc::new(Observation::new([("head".to_owned(), image())])),
            action: Action::Primitive(0),
        };
        let trajectory = Trajectory {
            id: "demo".to_owned(),
            task: "sock".to_owned(),
            action_space: ActionSpace::Primitives {
                names: vec!["ahead".to_owned()],
            },
            steps: (0..9).map(step).collect(),
            markers: Vec::new(),
        };
        let metadata = RecordingMetadata {
            success,
            ..RecordingMetadata::default()
        };
        write_trajectory(file, &trajectory, &metadata).unwrap();
    }

    #[test]
    fn what_a_training_leaves_out_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write(&at("c.mcap"), None);
        write(&at("a.mcap"), Some(true));
        write(&at("b.mcap"), Some(false));
        fs::write(at("notes.txt"), "").unwrap();
        let bytes = fs::read(at("c.mcap")).unwrap();
        fs::write(at("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
        fs::write(at("empty.mcap"), "").unwrap();
        let given = Given::of(folder.path()).unwrap();
        assert_eq!(given.files, ["a.mcap", "c.mcap", "empty.mcap"].map(at));
        let reasons = given.left_out.iter().map(|report| {
            let reason = report.left_out.clone().unwrap_or_default();
            (report.path.clone(), reason)
        });
        let reasons: Vec<(PathBuf, String)> = reasons.collect();
        let [(failed, why_failed), (cut, why_cut)] = &reasons[..] else {
            panic!("{reasons:?}");
        };
        assert_eq!([failed, cut], [&at("b.mcap"), &at("cut.mcap")]);
        assert!(why_failed.contains("not done"), "{why_failed}");
        assert!(why_cut.contains("steps may be missing"), "{why_cut}");
        assert!(Given::of(&at("nowhere")).unwrap().files.is_empty());
    }
}
