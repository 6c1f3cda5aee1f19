use std::ffi::OsString;
use std::fs;
use std::io::Error;
use std::path::{Path, PathBuf};

use super::ViewError;

/// The name under which a file is written before it is complete: beside its place.
pub(super) fn unfinished(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".tmp");
    path.with_file_name(name)
}

/// Gives a complete file its name.
pub(super) fn finish(path: &Path) -> Result<(), ViewError> {
    fs::rename(unfinished(path), path).map_err(|e| unwritable(path, &e))
}

/// Writes a file so that there is the old one or the whole new one, whatever happens.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), ViewError> {
    create_folder(path)?;
    fs::write(unfinished(path), bytes).map_err(|e| unwritable(path, &e))?;
    finish(path)
}

/// Creates the folder of a file.
pub(super) fn create_folder(path: &Path) -> Result<(), ViewError> {
    path.parent().map_or(Ok(()), |folder| {
        fs::create_dir_all(folder).map_err(|e| unwritable(path, &e))
    })
}

pub(super) fn unwritable(path: &Path, error: &Error) -> ViewError {
    ViewError::FileUnwritable {
        path: path.to_path_buf(),
        reason: error.to_string(),
    }
}
