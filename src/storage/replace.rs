//! Files and folders that appear whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::StorageError;
use crate::hidden::{PREVIOUS, bring_back, neighbour};

/// Writes a file whole or not at all: `fill` writes to a hidden neighbour, which then takes the
/// place of `path`. Missing folders are made.
///
/// A killed process leaves at most the hidden neighbour `.NAME.tmp`, which the next call replaces.
///
/// # Errors
/// [`StorageError::Io`] when a folder or the file cannot be made, written or renamed, or `fill` fails.
pub fn write_file(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), StorageError> {
    let draft = Draft::create(path)?;
    let mut writer = BufWriter::new(draft.file()?);
    fill(&mut writer)
        .and_then(|()| writer.flush())
        .map_err(StorageError::io("write", path))?;
    drop(writer);
    draft.commit()
}

/// The hidden neighbour of a file that is being written; removed when dropped uncommitted.
pub(super) struct Draft {
    place: PathBuf,
    neighbour: PathBuf,
    committed: bool,
}

impl Draft {
    /// A draft of `place`, whose folder is made if it is missing.
    pub(super) fn create(place: &Path) -> Result<Self, StorageError> {
        make_parent(place)?;
        Ok(Self {
            place: place.to_owned(),
            neighbour: neighbour(place, "tmp"),
            committed: false,
        })
    }

    /// The draft's file, empty.
    pub(super) fn file(&self) -> Result<File, StorageError> {
        File::create(&self.neighbour).map_err(StorageError::io("create", &self.neighbour))
    }

    /// Puts the draft in its place once its bytes are on the disk.
    pub(super) fn commit(mut self) -> Result<(), StorageError> {
        OpenOptions::new()
            .write(true)
            .open(&self.neighbour)
            .and_then(|f| f.sync_all())
            .and_then(|()| fs::rename(&self.neighbour, &self.place))
            .map_err(StorageError::io("write", &self.place))?;
        self.committed = true;
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        if !self.committed {
            // Nothing to do about a failure here: the leftover is hidden and replaced next time.
            let _ = fs::remove_file(&self.neighbour);
        }
    }
}

/// Replaces a folder by what `fill` writes into a hidden neighbour.
///
/// Two renames are needed where the folder exists already; [`settle_folder`] undoes the first one
/// if the process is killed between them.
pub(super) fn replace_folder(
    folder: &Path,
    fill: impl FnOnce(&Path) -> Result<(), StorageError>,
) -> Result<(), StorageError> {
    make_parent(folder)?;
    settle_folder(folder)?;
    let (draft, previous) = (neighbour(folder, "tmp"), neighbour(folder, PREVIOUS));
    remove_folder(&draft)?;
    remove_folder(&previous)?;
    fs::create_dir(&draft).map_err(StorageError::io("create", &draft))?;
    if let Err(error) = fill(&draft) {
        remove_folder(&draft)?;
        return Err(error);
    }
    if folder.exists() {
        fs::rename(folder, &previous).map_err(StorageError::io("replace", folder))?;
    }
    fs::rename(&draft, folder).map_err(StorageError::io("write", folder))?;
    remove_folder(&previous)
}

/// Brings back the previous folder if a process was killed after it had been moved away and before
/// its successor took its place.
pub(super) fn settle_folder(folder: &Path) -> Result<(), StorageError> {
    bring_back(folder).map_err(StorageError::io("restore", folder))
}

fn remove_folder(folder: &Path) -> Result<(), StorageError> {
    match fs::remove_dir_all(folder) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(StorageError::io("remove", folder)(e)),
        _ => Ok(()),
    }
}

fn make_parent(path: &Path) -> Result<(), StorageError> {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => {
            fs::create_dir_all(parent).map_err(StorageError::io("create", parent))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_write_leaves_the_old_file_and_no_draft() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/er/file");
        write_file(&path, |w| w.write_all(b"old")).unwrap();
        let failed = write_file(&path, |w| {
            w.write_all(b"new")?;
            Err(io::Error::other("the disk is full"))
        });
        assert!(failed.unwrap_err().to_string().contains("the disk is full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn folder_survives_a_kill_between_the_two_renames() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("graph");
        let write = |text: &'static str| {
            replace_folder(&folder, |draft| {
                fs::write(draft.join("a"), text).map_err(StorageError::io("write", draft))
            })
        };
        write("one").unwrap();
        // Killed while building the second one, and again between the renames.
        fs::create_dir(root.path().join(".graph.tmp")).unwrap();
        fs::write(root.path().join(".graph.tmp/half"), "x").unwrap();
        fs::rename(&folder, root.path().join(".graph.previous")).unwrap();
        settle_folder(&folder).unwrap();
        assert_eq!(fs::read_to_string(folder.join("a")).unwrap(), "one");
        write("two").unwrap();
        assert_eq!(fs::read_to_string(folder.join("a")).unwrap(), "two");
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        assert_eq!(fs::read_dir(root.path()).unwrap().count(), 1);
    }
}
