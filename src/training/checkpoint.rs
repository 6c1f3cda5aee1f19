//! The state of a training in one file in the safetensors format: weights, their averages, the best
//! averages so far, the optimiser's state and where the training is. Nothing random needs storing,
//! since every step draws from the seed and its own number.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::course::Progress;
use super::weights::NamedWeights;
use super::{ChannelNormalisation, TrainingConfig, TrainingError};
use crate::model::{ModelSpec, ValidationMetrics, sha256_hex};
use crate::training::export::write_beside;

/// The file's name in the run folder.
const FILE: &str = "checkpoint.safetensors";
/// The key of everything that is no tensor.
const STATE: &str = "catena";
const OPTIMISER: &str = "optimiser";
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

#[derive(Serialize, Deserialize)]
struct Entry {
    dtype: String,
    shape: Vec<usize>,
    data_offsets: [usize; 2],
}

impl<S: Serialize + DeserializeOwned> Checkpoint<S> {
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
    /// [`TrainingError::Io`], such as a full disk; the old checkpoint is then still there.
    pub fn save(&self, run_folder: &Path) -> Result<PathBuf, TrainingError> {
        let path = Self::path(run_folder);
        write_beside(&path, &self.to_bytes())?;
        Ok(path)
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
        Self::from_bytes(&bytes)
            .map(Some)
            .map_err(|reason| Self::unusable(run_folder, reason))
    }

    fn to_bytes(&self) -> Vec<u8> {
        let mut data = Vec::new();
        let mut header = BTreeMap::new();
        for (part, weights) in [
            ("weights", &self.weights),
            ("average", &self.average),
            ("best", &self.best),
        ] {
            for (index, tensor) in weights.iter().enumerate() {
                let start = data.len();
                data.extend(tensor.values.iter().flat_map(|v| v.to_le_bytes()));
                // The number keeps the order of the parameters, which the format does not.
                let name = format!("{part}.{index:03}.{}", tensor.name);
                header.insert(name, entry("F32", tensor.shape.clone(), start, data.len()));
            }
        }
        let start = data.len();
        data.extend(&self.optimiser);
        let shape = vec![self.optimiser.len()];
        header.insert(OPTIMISER.to_owned(), entry("U8", shape, start, data.len()));
        let state = serde_json::to_string(&self.state).expect("the state has a JSON form");
        let metadata = BTreeMap::from([(STATE, state), ("sha256", sha256_hex(&data))]);
        let mut json = serde_json::to_value(&header).expect("the header has a JSON form");
        json["__metadata__"] = serde_json::to_value(metadata).expect("strings have a JSON form");
        let mut json = json.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(8), b' ');
        let mut bytes = (json.len() as u64).to_le_bytes().to_vec();
        bytes.extend(json);
        bytes.extend(data);
        bytes
    }

    fn from_bytes(bytes: &[u8]) -> Result<Self, String> {
        let cut = || "it is cut off".to_owned();
        let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(cut)?;
        let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|e| e.to_string())?;
        let (json, data) = rest.split_at_checked(length).ok_or_else(cut)?;
        let mut header: serde_json::Map<String, serde_json::Value> =
            serde_json::from_slice(json).map_err(|e| format!("its header is damaged: {e}"))?;
        let metadata = header.remove("__metadata__").unwrap_or_default();
        let text = |key: &str| metadata[key].as_str().unwrap_or_default().to_owned();
        if text("sha256") != sha256_hex(data) {
            return Err("its contents do not match their SHA-256".to_owned());
        }
        let state = serde_json::from_str(&text(STATE))
            .map_err(|e| format!("its training state is of another method or version: {e}"))?;
        let mut checkpoint = Self {
            state,
            weights: Vec::new(),
            average: Vec::new(),
            best: Vec::new(),
            optimiser: Vec::new(),
        };
        for (name, value) in header {
            let entry: Entry = serde_json::from_value(value).map_err(|e| e.to_string())?;
            let [start, end] = entry.data_offsets;
            let raw = data.get(start..end).ok_or_else(cut)?;
            checkpoint.put(&name, entry.shape, raw)?;
        }
        Ok(checkpoint)
    }

    fn put(&mut self, name: &str, shape: Vec<usize>, raw: &[u8]) -> Result<(), String> {
        if name == OPTIMISER {
            self.optimiser = raw.to_vec();
            return Ok(());
        }
        let mut parts = name.splitn(3, '.');
        let part = match parts.next() {
            Some("weights") => &mut self.weights,
            Some("average") => &mut self.average,
            Some("best") => &mut self.best,
            _ => return Err(format!("it holds an unknown tensor '{name}'")),
        };
        let name = parts.nth(1).unwrap_or_default().to_owned();
        let values = raw
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        part.push(NamedWeights {
            name,
            shape,
            values,
        });
        Ok(())
    }
}

fn entry(dtype: &str, shape: Vec<usize>, start: usize, end: usize) -> Entry {
    Entry {
        dtype: dtype.to_owned(),
        shape,
        data_offsets: [start, end],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::ActionSpace;

    fn weights(name: &str, value: f32) -> NamedWeights {
        NamedWeights {
            name: name.to_owned(),
            shape: vec![2],
            values: vec![value, -value],
        }
    }

    fn checkpoint() -> Checkpoint {
        let names = ["z.last", "a.first"];
        Checkpoint {
            state: TrainingState {
                progress: Progress {
                    step: 7,
                    spent_secs: 1.5,
                    ..Progress::default()
                },
                best: None,
                config: TrainingConfig::default(),
                spec: ModelSpec {
                    cameras: Vec::new(),
                    stack: 2,
                    action_space: ActionSpace::Primitives { names: Vec::new() },
                    d_max: 5,
                    latent_dim: 8,
                },
                normalisation: Vec::new(),
                demonstrations: "ab".to_owned(),
            },
            weights: names.iter().map(|n| weights(n, 1.0)).collect(),
            average: names.iter().map(|n| weights(n, 2.0)).collect(),
            best: Vec::new(),
            optimiser: vec![1, 2, 3],
        }
    }

    #[test]
    fn what_is_saved_is_loaded_in_the_same_order() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(<Checkpoint>::load(folder.path()).unwrap(), None);
        checkpoint().save(folder.path()).unwrap();
        checkpoint().save(folder.path()).unwrap();
        let loaded = Checkpoint::load(folder.path()).unwrap();
        assert_eq!(loaded, Some(checkpoint()));
        let files = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(files, 1, "nothing is left beside it");
    }

    #[test]
    fn another_training_is_told_by_what_differs_and_another_time_limit_is_none() {
        let folder = Path::new("a.run");
        let found = TrainingConfig::default();
        let mut wanted = found.clone();
        wanted.max_minutes = Some(5.0);
        let check = |wanted: &TrainingConfig, others: &[(&str, bool)]| {
            check_same(folder, [&found, wanted], others).map_err(|error| error.to_string())
        };
        let others = [("demonstrations", false), ("actions", true), ("eyes", true)];
        check(&wanted, &others[..1]).unwrap();
        let told = check(&wanted, &others).unwrap_err();
        assert!(
            told.contains("a.run") && told.contains("its actions differ"),
            "{told}"
        );
        wanted.seed = 2;
        wanted.network.dropout = 0.5;
        let told = check(&wanted, &others).unwrap_err();
        let dropout = found.network.dropout;
        let differing = format!(
            "its configurations (network.dropout is {dropout:?} there and 0.5 here, seed is 1 there and 2 here) differ"
        );
        assert!(told.contains(&differing), "{told}");
        assert!(!told.contains("learning rate"), "{told}");
    }

    #[test]
    fn damage_is_named_and_never_a_panic() {
        let folder = tempfile::tempdir().unwrap();
        let path = checkpoint().save(folder.path()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 7, 8, 60, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(matches!(
                <Checkpoint>::load(folder.path()),
                Err(TrainingError::CheckpointUnusable { .. })
            ));
        }
        let mut flipped = bytes.clone();
        *flipped.last_mut().unwrap() ^= 1;
        std::fs::write(&path, &flipped).unwrap();
        let message = <Checkpoint>::load(folder.path()).unwrap_err().to_string();
        assert!(message.contains("SHA-256"), "{message}");
    }
}
