//! Locks on files, by which processes keep out of each other's way.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;

/// The lock on a file, held until this is dropped or the process ends, however it ends.
#[derive(Debug)]
pub(crate) struct Lock {
    file: File,
}

impl Lock {
    /// Takes the lock on a file, which is made where it is not there; none where somebody holds it. A file system without
    /// locks keeps nobody out.
    pub(crate) fn take(path: &Path) -> io::Result<Option<Self>> {
        // Opened to be read, too: one that is only written on at its end cannot be locked everywhere.
        let file = File::options()
            .read(true)
            .append(true)
            .create(true)
            .open(path)?;
        if is_free(&file.try_lock()) {
            Ok(Some(Self { file }))
        } else {
            Ok(None)
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing the file is not enough while a process that is being started still has it open, too. Where unlocking fails
        // there was no lock.
        let _ = self.file.unlock();
    }
}

/// Whether nobody else holds a lock that was tried. Any other error says that there is none to be had: without support for
/// them, or without the service that keeps those of a network.
fn is_free(tried: &Result<(), TryLockError>) -> bool {
    !matches!(tried, Err(TryLockError::WouldBlock))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_held_by_one_and_goes_with_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        let held = Lock::take(&path).unwrap().expect("nobody holds it");
        assert!(Lock::take(&path).unwrap().is_none());
        drop(held);
        assert!(Lock::take(&path).unwrap().is_some());
        let nowhere = folder.path().join("nowhere/lock");
        let error = Lock::take(&nowhere).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }

    #[test]
    fn a_file_system_without_locks_keeps_nobody_out() {
        let without = io::Error::from(io::ErrorKind::Unsupported);
        assert!(is_free(&Err(TryLockError::Error(without))));
        assert!(is_free(&Ok(())));
        assert!(!is_free(&Err(TryLockError::WouldBlock)));
    }
}
