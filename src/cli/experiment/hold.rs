//! Folders in which only one experiment works at a time.

use std::path::Path;

use super::plan::make;
use crate::cli::error::CliError;
use crate::lock::Lock;
use crate::training::{RunFolder, TrainingError};

/// What is locked in a folder.
const LOCK: &str = "experiment.lock";

/// Makes a folder that is not there, and keeps the experiments of other processes from making the same in it until what
/// this returns is dropped.
pub(super) fn hold(folder: &Path) -> Result<Lock, CliError> {
    make(folder)?;
    let lock = Lock::take(&folder.join(LOCK)).map_err(CliError::io(folder))?;
    lock.ok_or_else(|| CliError::ExperimentAtWork {
        folder: folder.to_owned(),
    })
}

/// Refuses a run folder in which a training is at work, one that has not ended with its experiment yet or that somebody
/// began by hand.
pub(super) fn ensure_free(run: &Path) -> Result<(), CliError> {
    if !run.exists() {
        return Ok(());
    }
    let opened = RunFolder::open(run).map(drop);
    opened.map_err(|error| match error {
        TrainingError::RunInUse { run_folder } => CliError::TrainingAtWork { run: run_folder },
        other => other.into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_held_by_one_experiment() {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("ours_10_seed1_steps4400");
        let held = hold(&folder).unwrap();
        let refused = hold(&folder).unwrap_err().to_string();
        assert!(
            refused.contains("ours_10_seed1") && refused.contains("--work"),
            "{refused}"
        );
        drop(held);
        hold(&folder).unwrap();
    }
}
