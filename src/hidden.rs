//! Hidden neighbours of files and folders: what is to take a place is written to one, and a folder waits in one until
//! another has taken its place.

use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// How the name of the neighbour ends to which an older folder is moved.
pub(crate) const PREVIOUS: &str = "previous";

/// The hidden neighbour of a file or folder whose name ends so.
pub(crate) fn neighbour(path: &Path, ending: &str) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".");
    name.push(ending);
    path.with_file_name(name)
}

/// Where a folder lies that was moved away from a place at which nothing is: whoever moved it was killed before another
/// took its place.
pub(crate) fn moved_from(folder: &Path) -> Option<PathBuf> {
    let previous = neighbour(folder, PREVIOUS);
    (!folder.exists() && previous.exists()).then_some(previous)
}

/// How people bring a folder back from where it was moved to.
pub(crate) fn way_back(folder: &Path, previous: &Path) -> String {
    let (folder, previous) = (folder.display(), previous.display());
    format!("a command that was killed had moved it away; bring it back: mv {previous} {folder}")
}

/// Brings such a folder back, if there is one.
pub(crate) fn bring_back(folder: &Path) -> io::Result<()> {
    match moved_from(folder) {
        Some(previous) => fs::rename(previous, folder),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_was_moved_away_comes_back_where_nothing_has_taken_its_place() {
        let root = tempfile::tempdir().unwrap();
        let [folder, previous] = ["model", ".model.previous"].map(|name| root.path().join(name));
        assert_eq!(neighbour(&folder, PREVIOUS), previous);
        bring_back(&folder).unwrap();
        assert!(!folder.exists(), "there is none to bring back");
        fs::create_dir(&previous).unwrap();
        assert_eq!(moved_from(&folder).as_ref(), Some(&previous));
        bring_back(&folder).unwrap();
        assert!(folder.exists() && !previous.exists());
        // Another has taken the place.
        fs::create_dir(&previous).unwrap();
        assert_eq!(moved_from(&folder), None);
        bring_back(&folder).unwrap();
        assert!(folder.exists() && previous.exists());
    }
}
