use std::path::PathBuf;

use super::{ReadOptions, RecordingReport, Recordings, StorageError};
use crate::trajectory::DemonstrationSet;

/// All files of the recordings among files and folders, sorted; see [`Recordings`] for what a path can be.
///
/// # Errors
/// Those of [`Recordings::open`].
pub fn recording_files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, StorageError> {
    Ok(Recordings::open(paths, &ReadOptions::default())?.files())
}

/// Reads the demonstrations of one task, in the order of their sorted paths, and says of every
/// recording what is in it; [`Recordings::demonstrations`] says which are left out.
///
/// # Errors
/// Those of [`Recordings::open`] and [`Recordings::demonstrations`].
pub fn load_demonstrations(
    paths: &[PathBuf],
    task: &str,
) -> Result<(DemonstrationSet, Vec<RecordingReport>), StorageError> {
    Recordings::open(paths, &ReadOptions::default())?.demonstrations(task)
}

/// A digest of the bytes of all recordings among `paths`, in sorted order and whatever their names:
/// 64 hexadecimal digits.
///
/// # Errors
/// Those of [`Recordings::open`], and [`StorageError::Io`] when a file cannot be read.
pub fn demonstrations_digest(paths: &[PathBuf]) -> Result<String, StorageError> {
    Recordings::open(paths, &ReadOptions::default())?.digest()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::super::fixtures::trajectory;
    use super::super::{PRACTICE_NOTE, RecordingMetadata, write_trajectory};
    use super::*;

    fn write(folder: &Path, name: &str, steps: usize, success: Option<bool>) {
        let metadata = RecordingMetadata {
            success,
            ..RecordingMetadata::default()
        };
        write_trajectory(&folder.join(name), &trajectory(steps), &metadata).unwrap();
    }

    #[test]
    fn demonstrations_are_sorted_and_failures_left_out() {
        let root = tempfile::tempdir().unwrap();
        write(root.path(), "b/000.mcap", 4, Some(true));
        write(root.path(), "a/000.mcap", 3, None);
        write(root.path(), "a/001.mcap", 5, Some(false));
        write(root.path(), "c/002.mcap", 6, None);
        fs::write(root.path().join("a/.003.mcap.tmp"), "half").unwrap();
        let damaged = root.path().join("c/002.mcap");
        let bytes = fs::read(&damaged).unwrap();
        fs::write(&damaged, &bytes[..bytes.len() - 700]).unwrap();
        let (set, reports) = load_demonstrations(&[root.path().to_owned()], "tidy").unwrap();
        let ids: Vec<_> = set.trajectories().iter().map(|t| t.id.as_str()).collect();
        assert_eq!(ids, ["a/000", "b/000"]);
        assert!(set.trajectories().iter().all(|t| t.task == "tidy"));
        let left_out: Vec<_> = reports.iter().map(|r| r.left_out.is_some()).collect();
        assert_eq!(left_out, [false, true, false, true]);
        assert!(reports[3].to_string().contains("steps may be missing"));
    }

    #[test]
    fn practice_is_no_demonstration() {
        let root = tempfile::tempdir().unwrap();
        write(root.path(), "shown.mcap", 4, Some(true));
        let mut metadata = RecordingMetadata::default();
        let kind = "dry".to_owned();
        metadata.notes.insert(PRACTICE_NOTE.to_owned(), kind);
        write_trajectory(&root.path().join("dry.mcap"), &trajectory(5), &metadata).unwrap();
        let recordings = Recordings::open(&[root.path().to_owned()], &ReadOptions::default());
        let recordings = recordings.unwrap();
        let (set, reports) = recordings.demonstrations("sock").unwrap();
        assert_eq!(set.trajectories().len(), 1);
        let reason = reports[0].left_out.clone().unwrap();
        assert!(reason.contains("practice (dry)"), "{reason}");
        let looked = recordings.inspect().remove(0).unwrap();
        assert_eq!(looked.left_out, Some(reason));
        let (set, _) = recordings.practice("sock").unwrap();
        assert_eq!(set.trajectories().len(), 2, "all of it may be practised on");
    }

    #[test]
    fn folder_without_recordings_is_named() {
        let root = tempfile::tempdir().unwrap();
        let error = load_demonstrations(&[root.path().to_owned()], "sock").unwrap_err();
        assert!(
            error
                .to_string()
                .contains(&root.path().display().to_string()),
            "{error}"
        );
        write(root.path(), "failed.mcap", 3, Some(false));
        let error = load_demonstrations(&[root.path().to_owned()], "sock").unwrap_err();
        assert!(error.to_string().contains("failed.mcap"), "{error}");
    }

    #[test]
    fn digest_depends_on_contents_and_not_on_places() {
        let root = tempfile::tempdir().unwrap();
        write(root.path(), "a/000.mcap", 3, None);
        write(root.path(), "b/001.mcap", 3, None);
        let digest = |folder: &str| demonstrations_digest(&[root.path().join(folder)]).unwrap();
        assert_eq!(digest("a"), digest("b"));
        let before = digest("a");
        write(root.path(), "a/000.mcap", 4, None);
        assert_ne!(before, digest("a"));
        assert_eq!(digest("").len(), 64);
    }
}
