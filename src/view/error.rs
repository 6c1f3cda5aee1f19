use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Why a picture or a recording could not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The file could not be created, written or renamed.
    #[error("cannot write {path}: {source}")]
    FileUnwritable {
        /// The file as it was to be called in the end.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Rerun refused what was logged, or could not write it.
    #[error("the recording {path} failed at '{entity}': {reason}")]
    RecordingFailed {
        /// The recording as it was to be called in the end.
        path: PathBuf,
        /// What was being logged.
        entity: String,
        /// What Rerun said.
        reason: String,
    },
}
