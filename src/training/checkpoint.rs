//! The state of a training in one file in the safetensors format: weights, their averages, the best
//! averages so far, the optimiser's state and where the training is. Nothing random needs storing,
//! since every step draws from the seed and its own number.

mod form;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::course::Progress;
use super::weights::NamedWeights;
use super::{ChannelNormalisation, TrainingConfig, TrainingError};
use crate::model::{ModelSpec, ValidationMetrics};
use crate::training::export::write_beside;

/// The file's name in the run folder.
const FILE: &str = "checkpoint.safetensors";
/// What configurations call the time limit.
const TIME_LIMIT: &str = "max_minutes";
/// What they call the number of steps.
const STEPS: &str = "steps";
/// Why a training of other steps is not gone on with.
const OF_OTHER_STEPS: &str = " (the learning rate falls over all steps, so that one of another number is another training from \
     the first step on, and this one cannot be made longer)";

/// A checkpoint in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint<S = TrainingState> {
    /// Everything that is no tensor.
    pub state: S,
    /// The weights after the last step.
    pub weights: Vec<NamedWeights>,
    /// Their averages.
    pub average: Vec<NamedWeights>,
    /// The averages that did best; empty before the first validation.
    pub best: Vec<NamedWeights>,
    /// The optimiser's state as Burn writes it.
    pub optimiser: Vec<u8>,
}

/// Where a training is, as its checkpoint keeps it.
pub trait CheckpointState: Serialize + DeserializeOwned {
    /// Whether it tells of best weights, which are then kept beside it.
    fn has_best(&self) -> bool;
}

/// Where a training is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingState {
    /// How far it is.
    #[serde(flatten)]
    pub progress: Progress,
    /// The best weights so far.
    pub best: Option<BestSoFar>,
    /// The configuration.
    pub config: TrainingConfig,
    /// What the model takes and gives.
    pub spec: ModelSpec,
    /// How each camera's values are normalised.
    pub normalisation: Vec<ChannelNormalisation>,
    /// A fingerprint of the demonstrations.
    pub demonstrations: String,
}

impl CheckpointState for TrainingState {
    fn has_best(&self) -> bool {
        self.best.is_some()
    }
}

/// The best weights so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BestSoFar {
    /// The step after which they were found.
    pub step: u64,
    /// What chose them; lower is better.
    pub score: f64,
    /// How well they do.
    pub metrics: ValidationMetrics,
    /// The temperature that calibrates them.
    pub temperature: f32,
}

/// Refuses the checkpoint of another training: the configuration that was found is not the one that is wanted, or one of
/// `others` differs, which say what they are and whether they do. The time limit may be changed: it says when to stop, not
/// what to learn.
///
/// # Errors
/// [`TrainingError::CheckpointOfAnother`].
pub fn check_same<C: Serialize>(
    run_folder: &Path,
    configs: [&C; 2],
    others: &[(&str, bool)],
) -> Result<(), TrainingError> {
    let [found, wanted] = configs.map(|config| {
        let mut values = serde_json::to_value(config).expect("a configuration has a JSON form");
        values[TIME_LIMIT] = Value::Null;
        values
    });
    let mut differing = Vec::new();
    differences("", &found, &wanted, &mut differing);
    let other = others.iter().find(|(_, differs)| *differs);
    let what = match other {
        _ if !differing.is_empty() => format!("configurations ({})", differing.join(", ")),
        Some((what, _)) => (*what).to_owned(),
        None => return Ok(()),
    };
    let has_other_steps = found[STEPS] != wanted[STEPS];
    Err(TrainingError::CheckpointOfAnother {
        path: <Checkpoint>::path(run_folder),
        what,
        why: if has_other_steps { OF_OTHER_STEPS } else { "" },
    })
}

fn differences(name: &str, found: &Value, wanted: &Value, differing: &mut Vec<String>) {
    let (Value::Object(of_found), Value::Object(of_wanted)) = (found, wanted) else {
        if found != wanted {
            differing.push(format!("{name} is {found} there and {wanted} here"));
        }
        return;
    };
    let names: BTreeSet<&String> = of_found.keys().chain(of_wanted.keys()).collect();
    for key in names {
        let name = if name.is_empty() {
            key.clone()
        } else {
            format!("{name}.{key}")
        };
        let of = |values: &Map<String, Value>| values.get(key).cloned().unwrap_or_default();
        differences(&name, &of(of_found), &of(of_wanted), differing);
    }
}

impl<S: CheckpointState> Checkpoint<S> {
    /// Where the checkpoint of a run lies.
    pub fn path(run_folder: &Path) -> PathBuf {
        run_folder.join(FILE)
    }

    /// Why a run's checkpoint is of no use.
    pub fn unusable(run_folder: &Path, reason: String) -> TrainingError {
        TrainingError::CheckpointUnusable {
            path: Self::path(run_folder),
            reason,
        }
    }

    /// Writes the checkpoint beside the old one and then takes its place.
    ///
    /// # Errors
    /// [`TrainingError::CheckpointNotReplaced`], such as for a full disk, where an older one is there and stays so,
    /// [`TrainingError::Io`] where none is.
    pub fn save(&self, run_folder: &Path) -> Result<PathBuf, TrainingError> {
        let path = Self::path(run_folder);
        match write_beside(&path, &self.to_bytes()) {
            Err(TrainingError::Io { source, .. }) if path.is_file() => {
                Err(TrainingError::CheckpointNotReplaced { path, source })
            }
            written => written.map(|()| path),
        }
    }

    /// Reads the checkpoint of a run, if there is one.
    ///
    /// # Errors
    /// [`TrainingError::CheckpointUnusable`] when it is damaged, [`TrainingError::Io`].
    pub fn load(run_folder: &Path) -> Result<Option<Self>, TrainingError> {
        let path = Self::path(run_folder);
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => {
                return Err(TrainingError::Io {
                    action: "read",
                    path,
                    source,
                });
            }
        };
        Self::from_bytes(bytes)
            .map(Some)
            .map_err(|reason| Self::unusable(run_folder, reason))
    }
}

#[cfg(test)]
pub use form::in_old_form;

#[cfg(test)]
mod tests;
