use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use crate::cli::error::CliError;
use crate::storage::what_would_be_lost;
use crate::training::{TrainingError, is_model_file};

/// Checks that a model can be written to a place that is not there, empty, or another model's, so that nothing else is
/// lost.
pub(super) fn check_model_place(out: &Path) -> Result<(), CliError> {
    let path = out.to_owned();
    if out.is_file() {
        return Err(CliError::OutIsFile { path });
    }
    match what_would_be_lost(out, is_model_file)? {
        None => Ok(()),
        Some(what) => Err(CliError::OutHoldsOthers { path, what }),
    }
}

/// Checks that a folder can be made where none is, by whether the nearest one around it can be written to. Of a folder that
/// is there it must be possible within it or beside it, as a model is written. Leaves nothing behind.
pub(super) fn check_can_be_made(place: &Path) -> Result<(), CliError> {
    let whole = whole(place);
    let mut there = whole.ancestors().filter(|path| path.exists());
    let Some(nearest) = there.next() else {
        return Ok(());
    };
    let around = there.next().filter(|_| nearest == whole);
    let written = match around {
        Some(around) => check_writable(around).or_else(|_| check_writable(nearest)),
        None => check_writable(nearest),
    };
    Ok(written.map_err(|source| TrainingError::Io {
        action: "create",
        path: place.to_owned(),
        source,
    })?)
}

/// A path from the root on.
pub(super) fn whole(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// Rights alone do not tell whether a folder can be written to: a file system can be there to be read only.
fn check_writable(folder: &Path) -> io::Result<()> {
    if !folder.is_dir() {
        return Err(io::ErrorKind::NotADirectory.into());
    }
    let trial = folder.join(format!(".catena.{}.tmp", std::process::id()));
    match File::create_new(&trial).map(drop) {
        Ok(()) => fs::remove_file(&trial),
        // Another thread tries the same.
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_in_which_nothing_can_be_made_is_refused_and_nothing_is_left() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("notes.txt");
        fs::write(&file, "mine").unwrap();
        let far = root.path().join("models/new/model");
        check_can_be_made(&far).unwrap();
        check_can_be_made(root.path()).unwrap();
        let below = file.join("model");
        let refused = check_can_be_made(&below).unwrap_err().to_string();
        let told = format!("cannot create {}: not a directory", below.display());
        assert_eq!(refused, told);
        let left = fs::read_dir(root.path()).unwrap().count();
        assert_eq!(left, 1, "the file alone");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_place_that_nobody_can_write_to_is_refused() {
        let nowhere = Path::new("/proc/catena/model");
        let refused = check_can_be_made(nowhere).unwrap_err().to_string();
        assert!(
            refused.contains("cannot create /proc/catena/model"),
            "{refused}"
        );
    }

    #[test]
    fn a_model_takes_the_place_of_nothing_but_a_model() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("model");
        check_model_place(&out).unwrap();
        fs::create_dir(&out).unwrap();
        check_model_place(&out).unwrap();
        for file in ["landmarks.json", "manifest.json", "policy.onnx.partial"] {
            fs::write(out.join(file), "").unwrap();
        }
        check_model_place(&out).unwrap();
        let precious = out.join("thesis.tex");
        fs::write(&precious, "years").unwrap();
        let refused = check_model_place(&out).unwrap_err().to_string();
        assert!(
            refused.contains("model holds thesis.tex") && refused.contains("--out"),
            "{refused}"
        );
        let refused = check_model_place(&precious).unwrap_err().to_string();
        assert!(refused.contains("is a file"), "{refused}");
        // What another command wrote, whose manifest a model's would replace.
        let graph = Path::new(env!("CARGO_MANIFEST_DIR")).join("graphs/bedroom");
        check_model_place(&graph.join("model")).unwrap();
        check_model_place(&graph.join("sock")).unwrap_err();
    }
}
