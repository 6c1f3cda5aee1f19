use std::ffi::OsString;
use std::fs::{self, OpenOptions};
use std::io::{Error, Write};
use std::path::{Path, PathBuf};

use super::ViewError;
use crate::storage::{StorageError, write_file};

/// The name under which a file is written before it is complete: beside its place.
pub(super) fn unfinished(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".tmp");
    path.with_file_name(name)
}

/// Gives a complete file its name once its bytes are on the disk; one that cannot have it is removed.
pub(super) fn finish(path: &Path) -> Result<(), ViewError> {
    let unfinished = unfinished(path);
    let finished = OpenOptions::new()
        .write(true)
        .open(&unfinished)
        .and_then(|file| file.sync_all())
        .and_then(|()| fs::rename(&unfinished, path));
    finished.map_err(|e| {
        // Nothing to do about a failure here: the next recording replaces the leftover.
        let _ = fs::remove_file(&unfinished);
        unwritable(path, e)
    })
}

/// Writes a file so that there is the old one or the whole new one, whatever happens.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), ViewError> {
    write_file(path, |file| file.write_all(bytes)).map_err(|error| match error {
        StorageError::Io { source, .. } => unwritable(path, source),
        other => unwritable(path, Error::other(other)),
    })
}

/// Creates the folder of a file.
pub(super) fn create_folder(path: &Path) -> Result<(), ViewError> {
    path.parent().map_or(Ok(()), |folder| {
        fs::create_dir_all(folder).map_err(|e| unwritable(path, e))
    })
}

pub(super) fn unwritable(path: &Path, source: Error) -> ViewError {
    ViewError::FileUnwritable {
        path: path.to_path_buf(),
        source,
    }
}
