//! The folder of a model or a baseline, which is replaced as a whole.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::alone::Alone;
use super::files::{UNFINISHED, failed, write_to_disk};
use crate::hidden::{self, PREVIOUS, moved_from, neighbour};
use crate::model::{
    ENCODER_FILE, LANDMARKS_FILE, MANIFEST_FILE, POLICY_FILE, PROJECTION_FILE, TRAVERSABILITY_FILE,
};
use crate::training::TrainingError;

/// All files that the folder of a model or a baseline may hold.
const MODEL_FILES: [&str; 6] = [
    ENCODER_FILE,
    PROJECTION_FILE,
    TRAVERSABILITY_FILE,
    POLICY_FILE,
    LANDMARKS_FILE,
    MANIFEST_FILE,
];

/// Whether a file of this name in the folder of a model or a baseline is part of it, or was left by an export that was
/// killed. Any other file stays when another model takes the place.
#[must_use]
pub fn is_model_file(name: &str) -> bool {
    MODEL_FILES.contains(&name.strip_suffix(UNFINISHED).unwrap_or(name))
}

/// Writes files and their manifest as a folder, which takes the place of one that is there: at each moment the old files
/// are on the disk as a whole, or the new ones. What else lies in the folder stays. A folder that cannot be moved is written
/// into, the manifest last: who is killed while files take their places leaves some of both, which their digests tell.
///
/// A process that is killed leaves at most hidden neighbours of the folder, of which the next call makes use.
///
/// # Errors
/// [`TrainingError::Io`]; the old files are then still there. [`TrainingError::ModelInUse`] while another process writes the
/// folder.
pub fn write_folder(
    folder: &Path,
    files: &[(impl AsRef<str>, Vec<u8>)],
    manifest: &[u8],
) -> Result<(), TrainingError> {
    // A link to a folder stays one.
    let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    let mut all: Vec<(&str, &[u8])> = Vec::new();
    for (name, bytes) in files {
        all.push((name.as_ref(), bytes.as_slice()));
    }
    all.push((MANIFEST_FILE, manifest));
    let _alone = Alone::with(&folder)?;
    settle(&folder)?;
    check_place(&folder, &all)?;
    if is_stood_in(&folder) || !swap(&folder, &all)? {
        write_within(&folder, &all)?;
    }
    Ok(())
}

/// Brings back a folder that a process which was killed had moved away, so that it can be read.
///
/// # Errors
/// [`TrainingError::Io`] when it cannot be moved, [`TrainingError::ModelInUse`] while another process replaces it.
pub fn recover_folder(folder: &Path) -> Result<(), TrainingError> {
    if moved_from(folder).is_none() {
        return Ok(());
    }
    let _alone = Alone::with(folder)?;
    bring_back(folder)
}

/// Checks that what is there is a folder that is not protected, in which no folder has the name of a file that is to be
/// written.
fn check_place(folder: &Path, files: &[(&str, &[u8])]) -> Result<(), TrainingError> {
    let Ok(there) = fs::metadata(folder) else {
        return Ok(());
    };
    let refused = |path: &Path, kind: io::ErrorKind| Err(failed("write", path)(kind.into()));
    if !there.is_dir() {
        return refused(folder, io::ErrorKind::NotADirectory);
    }
    // Of a folder of Windows this says something else.
    if cfg!(unix) && there.permissions().readonly() {
        return refused(folder, io::ErrorKind::PermissionDenied);
    }
    let mut paths = files.iter().map(|(name, _)| folder.join(name));
    match paths.find(|path| path.is_dir()) {
        Some(path) => refused(&path, io::ErrorKind::IsADirectory),
        None => Ok(()),
    }
}

/// Whether this process is at work in a folder, which would go from under it and the shell that started it.
fn is_stood_in(folder: &Path) -> bool {
    std::env::current_dir().is_ok_and(|here| here.starts_with(folder))
}

/// Writes files beside a folder, whose place they then take. Tells whether that could be: not where the folder cannot be
/// moved or nothing made beside it.
fn swap(folder: &Path, files: &[(&str, &[u8])]) -> Result<bool, TrainingError> {
    let [draft, previous] = ["partial", PREVIOUS].map(|ending| neighbour(folder, ending));
    let is_new = !folder.exists();
    if let Err(source) = make_empty(&draft) {
        return if is_new {
            Err(failed("create", folder)(source))
        } else {
            Ok(false)
        };
    }
    let written = write_all(files, folder, |name| draft.join(name));
    // It takes the place with the rights of the one that is there.
    let rights = fs::metadata(folder).map(|there| there.permissions());
    let _ = rights.and_then(|rights| fs::set_permissions(&draft, rights));
    let is_free = written.map(|()| is_new || fs::rename(folder, &previous).is_ok());
    if !matches!(is_free, Ok(true)) {
        // It is of no use to anybody.
        let _ = fs::remove_dir_all(&draft);
        return is_free;
    }
    if let Err(source) = fs::rename(&draft, folder) {
        let _ = fs::remove_dir_all(&draft);
        settle(folder)?;
        return Err(failed("write", folder)(source));
    }
    settle(folder)?;
    Ok(true)
}

/// Writes files into a folder: all of them beside their places, and only then do they take these, the last one last.
fn write_within(folder: &Path, files: &[(&str, &[u8])]) -> Result<(), TrainingError> {
    let draft_of = |name: &str| folder.join(format!("{name}{UNFINISHED}"));
    if let Err(error) = write_all(files, folder, draft_of) {
        for &(name, _) in files {
            // Not all of them have come to be.
            let _ = fs::remove_file(draft_of(name));
        }
        return Err(error);
    }
    for &(name, _) in files {
        let path = folder.join(name);
        fs::rename(draft_of(name), &path).map_err(failed("rename to", &path))?;
    }
    Ok(())
}

/// Writes files that are to lie in a folder to other places meanwhile.
fn write_all(
    files: &[(&str, &[u8])],
    folder: &Path,
    place: impl Fn(&str) -> PathBuf,
) -> Result<(), TrainingError> {
    for &(name, bytes) in files {
        let path = folder.join(name);
        write_to_disk(&place(name), bytes).map_err(failed("write", &path))?;
    }
    Ok(())
}

/// Brings back a folder that was moved away where nothing has taken its place, or an empty folder has.
fn bring_back(folder: &Path) -> Result<(), TrainingError> {
    if neighbour(folder, PREVIOUS).exists() {
        // Only a folder in which nothing lies can be removed so.
        let _ = fs::remove_dir(folder);
    }
    hidden::bring_back(folder).map_err(failed("bring back", folder))
}

/// Brings back a folder that was moved away; from one whose place is taken it brings what was no part of the model, and
/// removes the rest.
fn settle(folder: &Path) -> Result<(), TrainingError> {
    bring_back(folder)?;
    let previous = neighbour(folder, PREVIOUS);
    if !previous.exists() {
        return Ok(());
    }
    for entry in fs::read_dir(&previous).map_err(failed("read", &previous))? {
        let entry = entry.map_err(failed("read", &previous))?;
        let (name, from) = (entry.file_name(), entry.path());
        if from.is_dir() || !name.to_str().is_some_and(is_model_file) {
            keep(&from, &folder.join(&name)).map_err(failed("keep", &from))?;
        }
    }
    // The new model is in its place: a file that is still in use, as on a network, is no reason to call this a failure, and
    // is removed by the next call.
    let _ = fs::remove_dir_all(&previous);
    Ok(())
}

/// Moves a file or folder to a place where nothing is.
fn keep(from: &Path, to: &Path) -> io::Result<()> {
    if to.exists() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    fs::rename(from, to)
}

/// Makes a folder with nothing in it.
fn make_empty(folder: &Path) -> io::Result<()> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => fs::create_dir_all(folder),
    }
}

#[cfg(test)]
mod tests;
