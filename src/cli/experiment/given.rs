//! Recordings that an experiment is given.

use std::fs;
use std::path::{Path, PathBuf};

use crate::cli::error::CliError;
use crate::storage::{ReadOptions, RecordingReport, Recordings, bag_in, is_mcap};

/// The MCAP recordings of a folder: files, and bags, which are whole whether their files lie there or in a folder of
/// their own.
#[derive(Default)]
pub(super) struct Given {
    /// The files of each one that counts as a demonstration, sorted by its place; of a bag of several with the one that
    /// names them.
    pub(super) recordings: Vec<Vec<PathBuf>>,
    /// What is to be said of those that a training leaves out. It leaves out one more where images that cannot be decoded
    /// make a camera stop early; that is not noticed here, where they are not decoded.
    pub(super) left_out: Vec<RecordingReport>,
    /// How many of all are bags.
    pub(super) bags: usize,
}

impl Given {
    /// Looks at the recordings of a folder. What cannot be looked at counts, for the training to refuse.
    pub(super) fn of(folder: &Path) -> Result<Self, CliError> {
        let paths = [recordings_in(folder), bags_in(folder)].concat();
        if paths.is_empty() {
            return Ok(Self::default());
        }
        let found = Recordings::open(&paths, &ReadOptions::default())?;
        let inspected = found.inspect().into_iter().filter_map(Result::ok);
        let left_out = inspected.filter(|report| report.left_out.is_some());
        let left_out: Vec<RecordingReport> = left_out.collect();
        let all = found.mcap_recordings();
        let is_bag = |(place, files): &&(&Path, Vec<PathBuf>)| {
            files.len() > 1 || place.parent() != Some(folder)
        };
        let bags = all.iter().filter(is_bag).count();
        let counts = |place: &Path| left_out.iter().all(|report| report.path != place);
        let counting = all.into_iter().filter(|(place, _)| counts(place));
        let recordings = counting.map(|(_, files)| files).collect();
        Ok(Self {
            recordings,
            left_out,
            bags,
        })
    }
}

/// What stands for the bags that lie in a folder, each in one of its own.
fn bags_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let seen = entries.filter(|entry| !entry.file_name().to_string_lossy().starts_with('.'));
    seen.filter_map(|entry| bag_in(&entry.path())).collect()
}

/// The MCAP files of a folder, sorted by name.
pub(super) fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| is_mcap(path))
        .collect();
    files.sort_unstable();
    files
}

#[cfg(test)]
mod tests {
    use std::ops::Range;
    use std::sync::Arc;

    use super::*;
    use crate::storage::{RecordingMetadata, write_trajectory};
    use crate::trajectory::{Action, ActionSpace, Image, Observation, Step, Trajectory};

    fn write(file: &Path, success: Option<bool>) {
        write_steps(file, 0..9, success);
    }

    fn write_steps(file: &Path, steps: Range<usize>, success: Option<bool>) {
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
            steps: steps.map(step).collect(),
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
        let counting = ["a.mcap", "c.mcap", "empty.mcap"].map(|name| vec![at(name)]);
        assert_eq!((given.recordings, given.bags), (counting.to_vec(), 0));
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
        assert!(Given::of(&at("nowhere")).unwrap().recordings.is_empty());
    }

    /// Writes the metadata of a bag of these files.
    fn name_files(bag: &Path, names: &[&str]) {
        let names = names.join(", ");
        let metadata = format!("rosbag2_bagfile_information:\n  relative_file_paths: [{names}]\n");
        fs::write(bag.join("metadata.yaml"), metadata).unwrap();
    }

    #[test]
    fn a_bag_counts_once_and_whole_wherever_its_files_lie() {
        let folder = tempfile::tempdir().unwrap();
        let at = |names: &[&str]| -> Vec<PathBuf> {
            names.iter().map(|name| folder.path().join(name)).collect()
        };
        let parts = ["split/split_0.mcap", "split/split_1.mcap"];
        for (name, steps) in [("a.mcap", 0..9), (parts[0], 0..5), (parts[1], 5..9)] {
            write_steps(&folder.path().join(name), steps, None);
        }
        let named = ["split_0.mcap", "split_1.mcap"];
        name_files(&folder.path().join("split"), &named);
        write(&folder.path().join("one/one_0.mcap"), None);
        name_files(&folder.path().join("one"), &["one_0.mcap"]);
        // What lies in a folder that is no bag is not given, nor what a bag does not name.
        write(&folder.path().join("apart/b.mcap"), None);
        write(&folder.path().join("one/beside.mcap"), None);
        let given = Given::of(folder.path()).unwrap();
        let split = [&parts[..], &["split/metadata.yaml"]].concat();
        let counting = vec![at(&["a.mcap"]), at(&["one/one_0.mcap"]), at(&split)];
        assert_eq!((given.recordings, given.bags), (counting, 2));

        // The folder of the task may be the bag.
        let given = Given::of(&folder.path().join("split")).unwrap();
        assert_eq!((given.recordings, given.bags), (vec![at(&split)], 1));
    }
}
