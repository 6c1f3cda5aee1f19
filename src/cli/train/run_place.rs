use std::path::{Path, PathBuf};

use super::place::{check_can_be_made, check_model_place, whole};
use super::sets::describe_bins;
use crate::cli::arguments::TrainArguments;
use crate::cli::error::CliError;
use crate::training::RunFolder;
use crate::trajectory::DemonstrationSet;
use crate::wording::counted;

/// The trainer's checkpoint in its run folder.
pub(in crate::cli) const CHECKPOINT: &str = "checkpoint.safetensors";

/// Where the run folder of a training is. One that is there is taken, so that who may not have it need not wait; one that
/// is not there is made later, so that what is refused leaves none.
pub(in crate::cli) struct RunPlace {
    path: PathBuf,
    taken: Option<RunFolder>,
}

impl RunPlace {
    /// Refuses a run folder in the model's folder, one in which another training is at work or whose checkpoint is not to
    /// be gone on from, a place that a model must not take, and places in which nothing can be made.
    pub(super) fn of(arguments: &TrainArguments) -> Result<Self, CliError> {
        let path = arguments.run.clone();
        let path = path.unwrap_or_else(|| beside(&arguments.out));
        if whole(&path).starts_with(whole(&arguments.out)) {
            return Err(CliError::RunInModel {
                run: path,
                model: arguments.out.clone(),
            });
        }
        check_model_place(&arguments.out)?;
        check_can_be_made(&arguments.out)?;
        check_can_be_made(&path)?;
        let taken = path.exists().then(|| taken(arguments, &path)).transpose()?;
        Ok(Self { path, taken })
    }

    /// The run folder, which is made where it is not there. Says what the training begins with. No other training takes
    /// the folder meanwhile.
    pub(in crate::cli) fn take(
        self,
        arguments: &TrainArguments,
        sets: &[DemonstrationSet],
    ) -> Result<RunFolder, CliError> {
        let Self { path, taken: early } = self;
        let run_folder = early.map_or_else(|| taken(arguments, &path), Ok)?;
        println!(
            "training on {} states of {}; checkpoints and losses.csv in {}{}",
            sets.iter().map(DemonstrationSet::step_count).sum::<usize>(),
            counted(sets.len(), "task"),
            run_folder.path().display(),
            sets.first()
                .map(|s| describe_bins(s.action_space()))
                .unwrap_or_default(),
        );
        Ok(run_folder)
    }
}

/// Takes the run folder of a training; refuses one in which another is at work or whose checkpoint is not to be gone on
/// from.
fn taken(arguments: &TrainArguments, run: &Path) -> Result<RunFolder, CliError> {
    let run_folder = RunFolder::open(run)?;
    let has_begun = run.join(CHECKPOINT).exists();
    if !arguments.resume && has_begun {
        return Err(CliError::RunExists {
            run: run.to_owned(),
        });
    }
    if arguments.resume && !has_begun {
        println!(
            "no checkpoint to go on from in {}: the training begins",
            run.display()
        );
    }
    Ok(run_folder)
}

/// Runs lie beside the model, which is to hold nothing but what deploys.
fn beside(model: &Path) -> PathBuf {
    let mut name = model.file_name().unwrap_or_default().to_owned();
    name.push(".run");
    model.with_file_name(name)
}
