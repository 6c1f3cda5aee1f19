//! Recordings in several files: what `ros2 bag record` makes where the size or the time of a file is limited.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::StorageError;

/// What lies beside the files of a bag.
pub(super) const METADATA_FILE: &str = "metadata.yaml";
/// How the line begins below which a bag's metadata stands.
const TOP_KEY: &str = "rosbag2_bagfile_information:";
/// That line is the first one, but for what people write above it.
const HEAD_BYTES: u64 = 4096;

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    #[serde(default)]
    relative_file_paths: Vec<PathBuf>,
}

/// Whether a file is the metadata of a bag, whatever it is called.
pub(super) fn is_metadata(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default();
    if ending != "yaml" && ending != "yml" {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    let head = String::from_utf8_lossy(&head);
    read.is_ok() && head.lines().any(|line| line.starts_with(TOP_KEY))
}

/// What stands for the bag in a folder: its metadata; none where the folder is no bag, of several files or of one.
pub(crate) fn bag_in(folder: &Path) -> Option<PathBuf> {
    let metadata = folder.join(METADATA_FILE);
    is_metadata(&metadata).then_some(metadata)
}

/// The files of a bag that is one recording in several MCAP files, in order; none where the folder is no such bag.
///
/// # Errors
/// [`StorageError::PartMissing`] when one of them is not there: nothing tells what it held.
pub(super) fn parts(folder: &Path) -> Result<Option<Vec<PathBuf>>, StorageError> {
    let Some(parts) = listed(folder) else {
        return Ok(None);
    };
    match parts.iter().find(|part| !part.is_file()) {
        None => Ok(Some(parts)),
        Some(part) => Err(StorageError::PartMissing {
            path: folder.join(METADATA_FILE),
            part: part.clone(),
        }),
    }
}

/// The folder of the bag that a file is part of; none where it is part of none.
pub(super) fn around(file: &Path) -> Option<PathBuf> {
    let folder = folder_of(file)?;
    let part = folder.join(file.file_name()?);
    listed(&folder)?.contains(&part).then_some(folder)
}

/// The folder that a file lies in, by a path that ends with its name: a recording is called as its folder, and `.` is
/// no name.
pub(super) fn folder_of(file: &Path) -> Option<PathBuf> {
    let parent = file.parent()?;
    match parent.file_name() {
        Some(_) => Some(parent.to_owned()),
        None => fs::canonicalize(Path::new(".").join(parent)).ok(),
    }
}

/// The files that make a folder a bag of several, whether they are there or not.
fn listed(folder: &Path) -> Option<Vec<PathBuf>> {
    let named = named_in(folder)?;
    let is_ours =
        |name: &PathBuf| lies_below(name) && name.extension().is_some_and(|e| e == "mcap");
    let is_bag = named.len() > 1 && named.iter().all(is_ours);
    is_bag.then(|| named.iter().map(|name| folder.join(name)).collect())
}

/// The files in any format that a folder's metadata names, so far as they are there.
pub(super) fn present(folder: &Path) -> Vec<PathBuf> {
    let named = named_in(folder).unwrap_or_default().into_iter();
    let below = named.filter(|name| lies_below(name));
    let files = below.map(|name| folder.join(name));
    files.filter(|file| file.is_file()).collect()
}

/// The names of files as a folder's metadata has them; none where it is no bag's.
fn named_in(folder: &Path) -> Option<Vec<PathBuf>> {
    let text = fs::read_to_string(folder.join(METADATA_FILE)).ok()?;
    // Others name their files so, too.
    let metadata: Metadata = serde_yaml::from_str(&text).ok()?;
    Some(metadata.rosbag2_bagfile_information.relative_file_paths)
}

fn lies_below(name: &Path) -> bool {
    name.components().all(|c| matches!(c, Component::Normal(_)))
}
