use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::digest::hexadecimal;
use super::episode::keys;
use super::{Recording, RecordingReport, StorageError, read_trajectory, sha256_file};
use crate::trajectory::DemonstrationSet;

/// All recordings among files and folders, sorted: a file is taken as it is, of a folder every `*.mcap`
/// at any depth except hidden ones.
///
/// # Errors
/// [`StorageError::Io`] when a path cannot be read, [`StorageError::NoRecordings`] when there are none.
pub fn recording_files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, StorageError> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() {
            collect_recordings(path, &mut files)?;
        } else {
            fs::metadata(path).map_err(StorageError::io("read", path))?;
            files.push(path.clone());
        }
    }
    files.sort();
    files.dedup();
    if files.is_empty() {
        return Err(StorageError::NoRecordings {
            paths: list(paths.iter().map(|p| p.display().to_string())),
        });
    }
    Ok(files)
}

fn collect_recordings(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), StorageError> {
    let entries = fs::read_dir(folder).map_err(StorageError::io("read", folder))?;
    for entry in entries {
        let path = entry.map_err(StorageError::io("read", folder))?.path();
        let is_hidden = path
            .file_name()
            .is_some_and(|n| n.to_string_lossy().starts_with('.'));
        if is_hidden {
            continue;
        }
        if path.is_dir() {
            collect_recordings(&path, files)?;
        } else if path.extension().is_some_and(|e| e == "mcap") {
            files.push(path);
        }
    }
    Ok(())
}

/// Reads the demonstrations of one task, in the order of their sorted paths, and says of every
/// recording what is in it.
///
/// The trajectories carry the name `task`, whatever the files call it. Their ids are the files' stems,
/// with the folder before them where stems repeat. Left out, and marked so in their reports, are
/// recordings that say that they failed, and damaged ones: where steps are missing, neighbours need
/// not follow each other and the last step need not be the end of the task.
///
/// # Errors
/// [`StorageError`] of the first file in order that cannot be read; [`StorageError::NoDemonstrations`]
/// when every recording was left out; [`StorageError::Set`] when cameras or action spaces differ.
pub fn load_demonstrations(
    paths: &[PathBuf],
    task: &str,
) -> Result<(DemonstrationSet, Vec<RecordingReport>), StorageError> {
    let files = recording_files(paths)?;
    let read: Vec<Result<Recording, StorageError>> =
        files.par_iter().map(|path| read_trajectory(path)).collect();
    // Collected apart, so that of several errors always the first one is reported.
    let recordings = read.into_iter().collect::<Result<Vec<_>, _>>()?;
    let ids = unique_ids(&files);
    let mut trajectories = Vec::new();
    let mut reports = Vec::new();
    for (recording, id) in recordings.into_iter().zip(ids) {
        let mut report = recording.report;
        report.left_out = why_left_out(&report);
        if report.left_out.is_none() {
            let mut trajectory = recording.trajectory;
            task.clone_into(&mut trajectory.task);
            trajectory.id = id;
            trajectories.push(trajectory);
        }
        reports.push(report);
    }
    if trajectories.is_empty() {
        return Err(StorageError::NoDemonstrations {
            task: task.to_owned(),
            count: reports.len(),
            reasons: list(reports.iter().map(|r| {
                let reason = r.left_out.as_deref().unwrap_or_default();
                format!("{}: {reason}", r.path.display())
            })),
        });
    }
    let set = DemonstrationSet::new(task, trajectories).map_err(|source| StorageError::Set {
        task: task.to_owned(),
        source,
    })?;
    Ok((set, reports))
}

fn why_left_out(report: &RecordingReport) -> Option<String> {
    if report
        .metadata
        .get(keys::SUCCESS)
        .is_some_and(|s| s == "false")
    {
        return Some("its metadata says that the task was not done".to_owned());
    }
    let damage = report.losses.iter().find(|l| l.breaks_the_sequence())?;
    Some(format!("steps may be missing: {damage}"))
}

/// The stem of each file, with its folder where the stem alone is not unique, or the whole path where
/// that is not either.
fn unique_ids(files: &[PathBuf]) -> Vec<String> {
    let stem = |p: &Path| p.with_extension("").file_name().map(PathBuf::from);
    let with_folder = |p: &Path| Some(Path::new(p.parent()?.file_name()?).join(stem(p)?));
    let candidates = |p: &Path| [stem(p), with_folder(p), Some(p.with_extension(""))];
    let mut uses: BTreeMap<PathBuf, usize> = BTreeMap::new();
    for candidate in files.iter().flat_map(|p| candidates(p)).flatten() {
        *uses.entry(candidate).or_default() += 1;
    }
    files
        .iter()
        .map(|p| {
            let id = candidates(p).into_iter().flatten().find(|c| uses[c] == 1);
            id.unwrap_or_else(|| p.clone())
                .to_string_lossy()
                .into_owned()
        })
        .collect()
}

/// A digest of the bytes of all recordings among `paths`, in sorted order and whatever their names:
/// 64 hexadecimal digits.
///
/// # Errors
/// Those of [`recording_files`], and [`StorageError::Io`] when a file cannot be read.
pub fn demonstrations_digest(paths: &[PathBuf]) -> Result<String, StorageError> {
    let digests: Vec<Result<String, StorageError>> = recording_files(paths)?
        .par_iter()
        .map(|path| sha256_file(path))
        .collect();
    let digests = digests.into_iter().collect::<Result<Vec<_>, _>>()?;
    Ok(hexadecimal(&Sha256::digest(digests.concat())))
}

fn list(items: impl Iterator<Item = String>) -> String {
    const SHOWN: usize = 5;
    let items: Vec<_> = items.collect();
    let mut shown = items[..items.len().min(SHOWN)].join("; ");
    if items.len() > SHOWN {
        shown = format!("{shown}; and {} more", items.len() - SHOWN);
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::super::fixtures::trajectory;
    use super::super::{RecordingMetadata, write_trajectory};
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
