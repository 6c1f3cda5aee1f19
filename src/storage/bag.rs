//! Recordings in several files: what `ros2 bag record` makes where the size or the time of a file is limited.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::{Component, Path, PathBuf};

use serde::Deserialize;

use super::StorageError;
use super::ending::{is_mcap, is_yaml};
use super::values::fault_of;

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
    relative_file_paths: Vec<PathBuf>,
}

/// The files that a folder's metadata names.
enum Named {
    /// It is no bag's metadata, or there is none.
    NoBag,
    /// The names, as it has them.
    Files(Vec<PathBuf>),
    /// It is a bag's, and what is wrong with it.
    Damaged(String),
}

/// Whether a file is the metadata of a bag, whatever it is called; or is called as that and has no byte, as what a full
/// disk or an interrupted copy leaves of it.
pub(super) fn is_metadata(path: &Path) -> bool {
    if !is_yaml(path) {
        return false;
    }
    let mut head = Vec::new();
    let read = File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    if read.is_err() {
        return false;
    }
    if head.is_empty() {
        return path.file_name().is_some_and(|name| name == METADATA_FILE);
    }
    let head = String::from_utf8_lossy(&head);
    head.lines().any(|line| line.starts_with(TOP_KEY))
}

/// What stands for the bag in a folder: its metadata; none where the folder is no bag, of several files or of one.
pub(crate) fn bag_in(folder: &Path) -> Option<PathBuf> {
    let metadata = folder.join(METADATA_FILE);
    is_metadata(&metadata).then_some(metadata)
}

/// The files of a bag that is one recording in several MCAP files, in order; none where the folder is no such bag.
///
/// # Errors
/// [`StorageError::PartMissing`] when one of them is not there: nothing tells what it held;
/// [`StorageError::BagDamaged`] when nothing tells whether the files that are there belong together.
pub(super) fn parts(folder: &Path) -> Result<Option<Vec<PathBuf>>, StorageError> {
    let named = named_in(folder);
    if let Named::Damaged(fault) = named {
        return match mcap_files(folder).len() {
            0 | 1 => Ok(None),
            files => Err(StorageError::BagDamaged {
                path: folder.join(METADATA_FILE),
                files,
                fault,
            }),
        };
    }
    let Some(parts) = listed(folder, named) else {
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

/// Why there is nothing to read of a bag beside whose metadata no recording lies; none where the folder is no bag, or all
/// that its metadata names is there.
pub(super) fn why_without_files(folder: &Path) -> Option<StorageError> {
    let reason = match named_in(folder) {
        Named::NoBag => return None,
        Named::Damaged(fault) => {
            format!("of which it cannot be read which files it consists of ({fault})")
        }
        Named::Files(named) => {
            let missing = named.iter().find(|name| !folder.join(name).is_file())?;
            format!("which names {}, which is not there", missing.display())
        }
    };
    Some(StorageError::BagWithoutFiles {
        path: folder.join(METADATA_FILE),
        reason,
    })
}

/// The folder of the bag that a file is part of, or may be; none where it is part of none.
pub(super) fn around(file: &Path) -> Option<PathBuf> {
    let folder = folder_of(file)?;
    let part = folder.join(file.file_name()?);
    let named = named_in(&folder);
    let may_be = matches!(named, Named::Damaged(_));
    let is_part = listed(&folder, named).is_some_and(|parts| parts.contains(&part));
    (may_be || is_part).then_some(folder)
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
fn listed(folder: &Path, named: Named) -> Option<Vec<PathBuf>> {
    let Named::Files(named) = named else {
        return None;
    };
    let is_ours = |name: &PathBuf| lies_below(name) && is_mcap(name);
    let is_bag = named.len() > 1 && named.iter().all(is_ours);
    is_bag.then(|| named.iter().map(|name| folder.join(name)).collect())
}

/// The files in any format of a bag that is not one of several, so far as they are there: those that its metadata names,
/// or where it is damaged the one that lies beside it.
pub(super) fn present(folder: &Path) -> Vec<PathBuf> {
    let named = match named_in(folder) {
        Named::NoBag => return Vec::new(),
        Named::Damaged(_) => return mcap_files(folder),
        Named::Files(named) => named.into_iter(),
    };
    let below = named.filter(|name| lies_below(name));
    let files = below.map(|name| folder.join(name));
    files.filter(|file| file.is_file()).collect()
}

fn named_in(folder: &Path) -> Named {
    let path = folder.join(METADATA_FILE);
    let Ok(text) = fs::read_to_string(&path) else {
        return Named::NoBag;
    };
    if text.is_empty() {
        return Named::Damaged("it is empty, 0 bytes".to_owned());
    }
    match serde_yaml::from_str::<Metadata>(&text) {
        Ok(metadata) => Named::Files(metadata.rosbag2_bagfile_information.relative_file_paths),
        Err(error) if is_metadata(&path) => Named::Damaged(fault_of(&error)),
        // Others name their files so, too.
        Err(_) => Named::NoBag,
    }
}

/// The MCAP files that lie in a folder.
fn mcap_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.map(|entry| entry.path());
    files
        .filter(|file| is_mcap(file) && file.is_file())
        .collect()
}

fn lies_below(name: &Path) -> bool {
    name.components().all(|c| matches!(c, Component::Normal(_)))
}
