//! Recordings in several files: what `ros2 bag record` makes where the size or the time of a file is limited.

use std::fs;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::StorageError;

/// What lies beside the files of a bag.
pub(super) const METADATA_FILE: &str = "metadata.yaml";

#[derive(Deserialize)]
struct Metadata {
    rosbag2_bagfile_information: Information,
}

#[derive(Deserialize)]
struct Information {
    #[serde(default)]
    relative_file_paths: Vec<PathBuf>,
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
    let parent = file.parent()?;
    // A recording is called as its folder, and `.` is no name.
    let folder = match parent.file_name() {
        Some(_) => parent.to_owned(),
        None => fs::canonicalize(Path::new(".").join(parent)).ok()?,
    };
    let part = folder.join(file.file_name()?);
    listed(&folder)?.contains(&part).then_some(folder)
}

/// The files that make a folder a bag of several, whether they are there or not.
fn listed(folder: &Path) -> Option<Vec<PathBuf>> {
    let text = fs::read_to_string(folder.join(METADATA_FILE)).ok()?;
    // Others name their files so, too.
    let metadata: Metadata = serde_yaml::from_str(&text).ok()?;
    let named = metadata.rosbag2_bagfile_information.relative_file_paths;
    let is_ours = |path: &PathBuf| {
        let lies_below = path.components().all(|c| matches!(c, Component::Normal(_)));
        lies_below && path.extension().is_some_and(|e| e == "mcap")
    };
    let is_bag = named.len() > 1 && named.iter().all(is_ours);
    is_bag.then(|| named.iter().map(|name| folder.join(name)).collect())
}
