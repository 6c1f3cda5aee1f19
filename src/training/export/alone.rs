//! What keeps two processes from writing a model's folder at the same time.

use std::fs;
use std::path::{Path, PathBuf};

use crate::hidden::neighbour;
use crate::lock::Lock;
use crate::training::TrainingError;

/// A folder that no other process writes until this is dropped or the process ends, however it ends.
#[derive(Debug)]
pub(super) struct Alone {
    /// The locked file, a hidden neighbour of the folder.
    path: PathBuf,
    _lock: Lock,
}

impl Alone {
    /// Takes a folder, which need not be there; the folders that it is to lie in are made. None where nothing can be made
    /// beside it: it is then not protected.
    ///
    /// # Errors
    /// [`TrainingError::ModelInUse`] while another process has it.
    pub(super) fn with(folder: &Path) -> Result<Option<Self>, TrainingError> {
        if let Some(parent) = folder.parent() {
            // Where this fails, who writes the folder tells why.
            let _ = fs::create_dir_all(parent);
        }
        let path = neighbour(folder, "lock");
        match Lock::take(&path) {
            Ok(Some(lock)) => Ok(Some(Self { path, _lock: lock })),
            Ok(None) => Err(TrainingError::ModelInUse {
                folder: folder.to_owned(),
            }),
            Err(_) => Ok(None),
        }
    }
}

impl Drop for Alone {
    fn drop(&mut self) {
        // While it is still held. One that stays is of no harm.
        let _ = fs::remove_file(&self.path);
    }
}
