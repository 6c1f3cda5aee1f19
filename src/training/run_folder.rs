use std::path::{Path, PathBuf};

use super::TrainingError;
use crate::lock::Lock;

/// The file in a run folder that its training locks. It stays: who removed it could remove one that another holds.
const LOCK: &str = "run.lock";

/// The folder of a training, in which its checkpoint and its losses lie. No other training takes it until this is dropped
/// or the process ends, however it ends.
#[derive(Debug)]
pub struct RunFolder {
    path: PathBuf,
    _lock: Lock,
}

impl RunFolder {
    /// Takes a folder, which is made where it is not there. On a file system without locks two trainings can take it.
    ///
    /// # Errors
    /// [`TrainingError::RunInUse`] while another training has it, [`TrainingError::Io`] where it cannot be made.
    pub fn open(path: &Path) -> Result<Self, TrainingError> {
        let failed = |action| {
            move |source| TrainingError::Io {
                action,
                path: path.to_owned(),
                source,
            }
        };
        std::fs::create_dir_all(path).map_err(failed("create"))?;
        let lock = Lock::take(&path.join(LOCK)).map_err(failed("lock"))?;
        let lock = lock.ok_or_else(|| TrainingError::RunInUse {
            run_folder: path.to_owned(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            _lock: lock,
        })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_trainings_do_not_take_one_folder() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("model.run");
        let taken = RunFolder::open(&path).unwrap();
        let refused = RunFolder::open(&path).unwrap_err().to_string();
        assert!(
            refused.contains("model.run") && refused.contains("--run"),
            "{refused}"
        );
        drop(taken);
        assert_eq!(RunFolder::open(&path).unwrap().path(), path);
        let file = place.path().join("file");
        std::fs::write(&file, "").unwrap();
        let refused = RunFolder::open(&file).unwrap_err().to_string();
        assert!(
            refused.contains("cannot create") && refused.contains("file"),
            "{refused}"
        );
    }
}
