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
    let Ok(text) = fs::read_to_string(folder.join(METADATA_FILE)) else {
        return Ok(None);
    };
    // Others name their files so, too.
    let Ok(metadata) = serde_yaml::from_str::<Metadata>(&text) else {
        return Ok(None);
    };
    let named = metadata.rosbag2_bagfile_information.relative_file_paths;
    let is_ours = |path: &PathBuf| {
        let lies_below = path.components().all(|c| matches!(c, Component::Normal(_)));
        lies_below && path.extension().is_some_and(|e| e == "mcap")
    };
    if named.len() < 2 || !named.iter().all(is_ours) {
        return Ok(None);
    }
    let parts: Vec<PathBuf> = named.iter().map(|name| folder.join(name)).collect();
    match parts.iter().find(|part| !part.is_file()) {
        None => Ok(Some(parts)),
        Some(part) => Err(StorageError::PartMissing {
            path: folder.join(METADATA_FILE),
            part: part.clone(),
        }),
    }
}
