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
    use crate::trajectory::Trajectory;

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
    fn a_recording_of_which_nothing_is_left_is_left_out_like_other_damaged_ones() {
        let root = tempfile::tempdir().unwrap();
        write(root.path(), "a.mcap", 4, None);
        write(root.path(), "b.mcap", 4, None);
        let cut = root.path().join("b.mcap");
        let bytes = fs::read(&cut).unwrap();
        fs::write(&cut, &bytes[..60]).unwrap();
        let mapping = root.path().join("sock.yaml");
        let topics =
            "topics: {cameras: {head: /camera/head/image_raw/compressed}, action: /action}";
        let sizes = "image_sizes: {head: {height: 9, width: 16}}";
        fs::write(&mapping, format!("recordings: .\n{topics}\n{sizes}\n")).unwrap();
        for path in [root.path(), &mapping] {
            let recordings = Recordings::open(&[path.to_owned()], &ReadOptions::default());
            let recordings = recordings.unwrap();
            let (set, reports) = recordings.demonstrations("sock").unwrap();
            assert_eq!(set.trajectories().len(), 1);
            let reason = reports[1].left_out.clone().unwrap();
            for part in ["it is damaged", "no topic carries images", "cut off"] {
                assert!(reason.contains(part), "{reason}");
            }
            let looked = recordings.inspect().into_iter();
            let looked: Vec<_> = looked.map(Result::unwrap).collect();
            assert!(looked[0].left_out.is_none() && looked[1].left_out.is_some());
            let read: Vec<_> = recordings.read().map(Result::unwrap).collect();
            assert!(read[1].trajectory.steps.is_empty());
            assert_eq!(read[1].report.left_out, Some(reason));
        }
        let alone = load_demonstrations(&[cut], "sock").unwrap_err().to_string();
        assert!(
            alone.contains("b.mcap: it is damaged") && alone.contains("cut off"),
            "{alone}"
        );
    }

    #[test]
    #[cfg(unix)]
    fn a_recording_to_which_several_paths_lead_counts_once() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(folder.path()).unwrap();
        write(&root, "run_1/000.mcap", 3, None);
        write(&root, "run_2/000.mcap", 4, None);
        symlink("run_2", root.join("latest")).unwrap();
        symlink("..", root.join("run_1/all")).unwrap();
        let files = |paths: &[&str]| {
            let paths: Vec<PathBuf> = paths.iter().map(|path| root.join(path)).collect();
            recording_files(&paths).unwrap()
        };
        let [first, second] = ["run_1/000.mcap", "run_2/000.mcap"].map(|file| root.join(file));
        assert_eq!(files(&[""]), [first.clone(), second.clone()]);
        assert_eq!(files(&["run_1/../run_1", "run_1/000.mcap"]), [first]);
        assert_eq!(files(&["latest", "run_2"]), [second]);
        assert_eq!(files(&["latest"]), [root.join("latest/000.mcap")]);
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
    fn a_folder_of_another_format_is_told_what_it_holds() {
        let root = tempfile::tempdir().unwrap();
        fs::write(root.path().join("metadata.yaml"), "a: 1").unwrap();
        fs::write(root.path().join("bag_0.db3"), "SQLite format 3").unwrap();
        let told = || {
            let read = load_demonstrations(&[root.path().to_owned()], "sock");
            read.unwrap_err().to_string()
        };
        let error = told();
        assert!(
            error.contains("bag_0.db3 is no MCAP") && error.contains("ros2 bag convert"),
            "{error}"
        );
        fs::write(
            root.path().join("a.mcap.zstd"),
            [0x28, 0xb5, 0x2f, 0xfd, 0, 0, 0, 0],
        )
        .unwrap();
        let error = told();
        assert!(
            error.contains("a.mcap.zstd") && error.contains("zstd -d"),
            "{error}"
        );
        write(root.path(), "b.mcap", 3, None);
        load_demonstrations(&[root.path().to_owned()], "sock").unwrap();
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

    /// Writes a trajectory of twelve steps as a bag of three files.
    fn write_bag(bag: &Path) -> Trajectory {
        let whole = trajectory(12);
        for (number, range) in [0..5, 5..9, 9..12].into_iter().enumerate() {
            let mut part = whole.clone();
            part.steps = whole.steps[range.clone()].to_vec();
            part.markers.retain(|m| range.contains(&m.step));
            for marker in &mut part.markers {
                marker.step -= range.start;
            }
            let file = bag.join(format!("run_{number}.mcap"));
            write_trajectory(&file, &part, &RecordingMetadata::default()).unwrap();
        }
        let metadata = "rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n    - run_0.mcap\n    \
                        - run_1.mcap\n    - run_2.mcap\n";
        fs::write(bag.join("metadata.yaml"), metadata).unwrap();
        whole
    }

    #[test]
    fn the_files_of_a_bag_are_one_demonstration() {
        let root = tempfile::tempdir().unwrap();
        let bag = root.path().join("run");
        let whole = write_bag(&bag);
        write(root.path(), "other.mcap", 4, None);
        let paths = [root.path().to_owned()];
        let (set, reports) = load_demonstrations(&paths, "sock").unwrap();
        let [other, joined] = set.trajectories() else {
            panic!("{} demonstrations", set.trajectories().len())
        };
        assert_eq!((other.steps.len(), joined.id.as_str()), (4, "run"));
        assert_eq!(joined.steps.len(), 12);
        assert_eq!(joined.markers, whole.markers);
        let actions =
            |t: &Trajectory| -> Vec<_> { t.steps.iter().map(|s| s.action.clone()).collect() };
        assert_eq!(actions(joined), actions(&whole));
        let told = reports[1].to_string();
        assert!(told.contains("3 files of one bag"), "{told}");
        assert_eq!(recording_files(&paths).unwrap().len(), 5);
        let twice = [bag.join("run_1.mcap"), bag.clone()];
        let (set, _) = load_demonstrations(&twice, "sock").unwrap();
        assert_eq!(set.trajectories().len(), 1);

        fs::remove_file(bag.join("run_1.mcap")).unwrap();
        let error = load_demonstrations(&paths, "sock").unwrap_err().to_string();
        assert!(
            error.contains("metadata.yaml: the bag holds") && error.contains("run_1.mcap"),
            "{error}"
        );
        // Files of that name are not only ROS's, and a bag of one file is a file.
        for text in [
            "title: my data\n",
            "rosbag2_bagfile_information: {relative_file_paths: [run_0.mcap]}\n",
        ] {
            fs::write(bag.join("metadata.yaml"), text).unwrap();
            let (set, _) = load_demonstrations(&paths, "sock").unwrap();
            assert_eq!(set.trajectories().len(), 3, "{text}");
        }
    }

    #[test]
    fn a_file_of_a_bag_that_is_named_stands_for_the_bag() {
        let root = tempfile::tempdir().unwrap();
        let bag = root.path().join("run");
        write_bag(&bag);
        write(&bag, "beside.mcap", 4, None);
        let parts = ["run_2.mcap", "run_0.mcap", "run_1.mcap"].map(|name| bag.join(name));
        for count in 1..=3 {
            let (set, reports) = load_demonstrations(&parts[..count], "sock").unwrap();
            let [whole] = set.trajectories() else {
                panic!("{} demonstrations", set.trajectories().len())
            };
            assert_eq!((whole.id.as_str(), whole.steps.len()), ("run", 12));
            let told = reports[0].to_string();
            assert!(told.contains("whichever of them is named"), "{told}");
        }
        fs::remove_file(&parts[2]).unwrap();
        let error = load_demonstrations(&parts[..1], "sock").unwrap_err();
        assert!(error.to_string().contains("the bag holds"), "{error}");
        let beside = [bag.join("beside.mcap")];
        let (set, _) = load_demonstrations(&beside, "sock").unwrap();
        assert_eq!(set.step_count(), 4, "it is no part of the bag");
    }

    #[test]
    fn the_metadata_of_a_bag_stands_for_it_and_is_no_mapping_file() {
        let root = tempfile::tempdir().unwrap();
        let bag = root.path().join("run");
        write_bag(&bag);
        let metadata = bag.join("metadata.yaml");
        let ids = |paths: &[PathBuf]| -> Vec<String> {
            let recordings = Recordings::open(paths, &ReadOptions::default()).unwrap();
            let (set, _) = recordings.demonstrations("sock").unwrap();
            set.trajectories().iter().map(|t| t.id.clone()).collect()
        };
        // As a shell gives `run/*`, before its other files or behind them.
        let parts = ["run_0.mcap", "run_1.mcap", "run_2.mcap"].map(|name| bag.join(name));
        let before = [std::slice::from_ref(&metadata), &parts].concat();
        let behind = [&parts[..], std::slice::from_ref(&metadata)].concat();
        for paths in [&before[..], &behind[..], std::slice::from_ref(&metadata)] {
            assert_eq!(ids(paths), ["run"]);
        }
        let named = Recordings::open(&before, &ReadOptions::default()).unwrap();
        assert_eq!(named.tasks(), ["run"]);
        let mapping = root.path().join("sock.yaml");
        fs::write(&mapping, "recordings: run/metadata.yaml\n").unwrap();
        assert_eq!(ids(&[mapping]), ["run"]);

        // A bag of one file is that file, whatever lies beside it.
        let one = "# mine\nrosbag2_bagfile_information:\n  relative_file_paths: [run_0.mcap]\n";
        fs::write(&metadata, one).unwrap();
        assert_eq!(ids(std::slice::from_ref(&metadata)), ["run_0"]);
        assert_eq!(ids(&before[..2]), ["run_0"]);
        fs::remove_file(&parts[1]).unwrap();
        fs::remove_file(&parts[2]).unwrap();
        let of_nothing = "rosbag2_bagfile_information: {}\n";
        fs::write(&metadata, of_nothing).unwrap();
        assert_eq!(ids(std::slice::from_ref(&metadata)), ["run_0"]);
        assert_eq!(ids(&before[..2]), ["run_0"]);
    }

    #[test]
    fn a_bag_without_its_files_is_named_with_what_is_missing() {
        let root = tempfile::tempdir().unwrap();
        let bag = root.path().join("run");
        fs::create_dir(&bag).unwrap();
        let metadata = bag.join("metadata.yaml");
        for (text, told) in [
            (
                "rosbag2_bagfile_information:\n  relative_file_paths: [run_0.mcap]\n",
                "names run_0.mcap, which is not there",
            ),
            ("rosbag2_bagfile_information: {}\n", "cannot be read"),
            ("", "empty, 0 bytes"),
        ] {
            fs::write(&metadata, text).unwrap();
            for path in [root.path(), &bag, &metadata] {
                let error = recording_files(&[path.to_owned()]).unwrap_err();
                let said = error.to_string();
                assert!(
                    matches!(error, StorageError::BagWithoutFiles { .. })
                        && said.contains(&metadata.display().to_string())
                        && said.contains(told),
                    "{said}"
                );
            }
        }
        // A file that was called otherwise since is still a recording.
        write(&bag, "cup.mcap", 4, None);
        let named = "rosbag2_bagfile_information: {relative_file_paths: [run_0.mcap]}\n";
        fs::write(&metadata, named).unwrap();
        assert_eq!(recording_files(&[bag]).unwrap().len(), 1);
    }

    #[test]
    fn empty_metadata_of_a_bag_is_no_mapping_file() {
        let root = tempfile::tempdir().unwrap();
        let bag = root.path().join("run");
        write_bag(&bag);
        let metadata = bag.join("metadata.yaml");
        fs::write(&metadata, "").unwrap();
        let parts = ["run_0.mcap", "run_1.mcap", "run_2.mcap"].map(|name| bag.join(name));
        // As a shell gives `run/*`.
        let all = [std::slice::from_ref(&metadata), &parts].concat();
        for paths in [&all[..], &all[..1], &all[1..2], std::slice::from_ref(&bag)] {
            let error = recording_files(paths).unwrap_err();
            let said = error.to_string();
            assert!(
                matches!(error, StorageError::BagDamaged { files: 3, .. })
                    && said.contains("empty, 0 bytes"),
                "{said}"
            );
        }
        // With one file beside it there is nothing to tell apart.
        fs::remove_file(&parts[1]).unwrap();
        fs::remove_file(&parts[2]).unwrap();
        assert_eq!(recording_files(&all[..2]).unwrap(), all[1..2]);
        // Any other empty YAML file is a mapping file.
        let mapping = root.path().join("sock.yaml");
        fs::write(&mapping, "").unwrap();
        let error = recording_files(&[mapping]).unwrap_err();
        assert!(matches!(error, StorageError::Mapping { .. }), "{error}");
    }

    #[test]
    fn files_beside_damaged_metadata_of_a_bag_are_not_taken_one_by_one() {
        let root = tempfile::tempdir().unwrap();
        let bag = root.path().join("run");
        write_bag(&bag);
        let metadata = bag.join("metadata.yaml");
        let whole = fs::read_to_string(&metadata).unwrap();
        let cut = whole.find("relative_file_paths").unwrap();
        let part = bag.join("run_1.mcap");
        for damaged in [&whole[..cut], "rosbag2_bagfile_information: [\n"] {
            fs::write(&metadata, damaged).unwrap();
            for path in [root.path(), &bag, &metadata, &part] {
                let error = recording_files(&[path.to_owned()]).unwrap_err();
                assert!(
                    matches!(error, StorageError::BagDamaged { files: 3, .. }),
                    "{}: {error}",
                    path.display()
                );
            }
        }
        fs::remove_file(metadata).unwrap();
        assert_eq!(recording_files(&[bag]).unwrap().len(), 3);
    }

    #[test]
    fn damage_in_a_bag_is_told_with_the_name_of_its_file() {
        let root = tempfile::tempdir().unwrap();
        let bag = root.path().join("run");
        write_bag(&bag);
        let part = bag.join("run_1.mcap");
        let bytes = fs::read(&part).unwrap();
        fs::write(&part, &bytes[..bytes.len() / 2]).unwrap();
        let recordings = Recordings::open(&[bag], &ReadOptions::default()).unwrap();
        let looked = recordings.inspect().remove(0).unwrap();
        let told = looked.to_string();
        let line = "LOST      run_1.mcap: the file is cut off";
        assert!(told.contains(line), "{told}");
        let read = recordings.read().next().unwrap().unwrap();
        assert!(read.report.left_out.is_some() && looked.left_out.is_some());
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
