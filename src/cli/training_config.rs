//! From the command line to the configuration of a training, and what of it a run folder keeps.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::arguments::TrainArguments;
use super::error::CliError;
use super::kept::keep;
use super::revision::revision;
use crate::model::{BaselineMethod, FeatureEncoder, sha256_hex};
use crate::storage::{nearest, read_values};
use crate::training::{BaselineConfig, NetworkVariant, Preset, TrainingConfig, training_device};
use crate::trajectory::DemonstrationSet;

/// The configuration of a run, complete: given to `--config` it repeats the training.
const CONFIG: &str = "config.json";
/// Which program trained on what.
const RECORD: &str = "run.json";

/// The preset, with the values of a file in their places.
pub(super) fn written_config(arguments: &TrainArguments) -> Result<TrainingConfig, CliError> {
    let config = preset(arguments)?.config();
    match &arguments.config {
        Some(file) => overridden(&config, file),
        None => Ok(config),
    }
}

/// The same with what the flags say.
pub(super) fn training_config(
    mut config: TrainingConfig,
    arguments: &TrainArguments,
    sets: &[DemonstrationSet],
) -> Result<TrainingConfig, CliError> {
    config.seed = arguments.seed.unwrap_or(config.seed);
    config.max_minutes = arguments.minutes.or(config.max_minutes);
    config.steps = arguments.steps.map_or(config.steps, |steps| steps as u64);
    if arguments.variant.is_some() || !arguments.cameras.is_empty() {
        let variant = arguments.variant.as_deref().map(variant).transpose()?;
        let variant = variant.unwrap_or(config.network.variant);
        let present = sets.first().map_or(0, |set| set.cameras().len());
        config = config.matched(variant, &arguments.cameras, present);
    }
    if arguments.own_goals {
        config.sampling.aligned_share = 0.0;
    }
    Ok(config)
}

/// The same for a baseline, which has one network and sees all cameras.
pub(super) fn baseline_config(
    method: BaselineMethod,
    arguments: &TrainArguments,
) -> Result<BaselineConfig, CliError> {
    let flags = [
        ("--variant", arguments.variant.is_some()),
        ("--camera", !arguments.cameras.is_empty()),
        ("--own-goals", arguments.own_goals),
    ];
    if let Some((flag, _)) = flags.into_iter().find(|(_, is_given)| *is_given) {
        return Err(CliError::FlagOfOurs { flag });
    }
    let mut config = BaselineConfig::of(method, preset(arguments)?);
    if let Some(file) = &arguments.config {
        config = overridden(&config, file)?;
        config.method = method;
    }
    config.seed = arguments.seed.unwrap_or(config.seed);
    config.max_minutes = arguments.minutes.or(config.max_minutes);
    config.steps = arguments.steps.map_or(config.steps, |steps| steps as u64);
    Ok(config)
}

/// The preset that is asked for.
pub(super) fn preset(arguments: &TrainArguments) -> Result<Preset, CliError> {
    Preset::parse(&arguments.preset).ok_or_else(|| CliError::UnknownPreset {
        found: arguments.preset.clone(),
        known: Preset::NAMES.map(|(name, _)| name).join(", "),
    })
}

fn variant(name: &str) -> Result<NetworkVariant, CliError> {
    NetworkVariant::parse(name).ok_or_else(|| CliError::UnknownVariant {
        found: name.to_owned(),
        known: NetworkVariant::NAMES.map(|(name, _)| name).join(", "),
    })
}

fn overridden<C: Serialize + DeserializeOwned>(config: &C, file: &Path) -> Result<C, CliError> {
    let failed = |reason: String| CliError::TrainingConfig {
        file: file.to_owned(),
        reason,
    };
    let text = fs::read_to_string(file).map_err(|e| failed(e.to_string()))?;
    let values = read_values(&text).map_err(failed)?;
    if !values.is_object() {
        return Err(failed("it holds no names with values".to_owned()));
    }
    let base = serde_json::to_value(config)?;
    let with = |values: Value| {
        let mut whole = base.clone();
        put(&mut whole, values);
        serde_json::from_value::<C>(whole)
    };
    let Err(together) = with(values.clone()) else {
        return Ok(with(values)?);
    };
    let (mut given, mut known) = (Vec::new(), Vec::new());
    leaves(&values, Some(&base), &[], &mut given);
    leaves(&base, None, &[], &mut known);
    let known: Vec<String> = known
        .into_iter()
        .map(|(names, _)| names.join("."))
        .collect();
    let faults = given.iter().filter_map(|(names, value)| {
        let alone = names.iter().rev().fold((*value).clone(), |value, name| {
            Value::Object([(name.clone(), value)].into_iter().collect())
        });
        let fault = with(alone).err()?.to_string();
        let name = names.join(".");
        Some(if value.is_object() {
            format!("{name}: {fault}")
        } else {
            fault_of(&name, &fault, &known)
        })
    });
    let faults: Vec<String> = faults.collect();
    Err(failed(if faults.is_empty() {
        together.to_string()
    } else {
        faults.join("; ")
    }))
}

/// What is wrong with a value, by its whole name.
fn fault_of(name: &str, fault: &str, known: &[String]) -> String {
    if !fault.starts_with("unknown field") {
        return format!("{name}: {fault}");
    }
    let last = |name: &str| name.rsplit('.').next().unwrap_or_default().to_owned();
    let meant = nearest(name, known.iter().map(String::as_str));
    let of_same_end = || {
        let ends: Vec<String> = known.iter().map(|known| last(known)).collect();
        let end = nearest(&last(name), ends.iter().map(String::as_str))?.to_owned();
        known
            .iter()
            .map(String::as_str)
            .find(|known| last(known) == end)
    };
    match meant.or_else(of_same_end) {
        Some(meant) => format!("there is no '{name}' (did you mean '{meant}'?)"),
        None => format!("there is no '{name}'"),
    }
}

/// Adds the values that hold no others, with the names that lead to them. What is put in the place of nothing, such as
/// landmarks where `base` has none, is one value: no part of it stands alone.
fn leaves<'a>(
    of: &'a Value,
    base: Option<&Value>,
    names: &[String],
    found: &mut Vec<(Vec<String>, &'a Value)>,
) {
    match of {
        Value::Object(values) if !values.is_empty() && base != Some(&Value::Null) => {
            for (name, value) in values {
                let names = [names, std::slice::from_ref(name)].concat();
                leaves(value, base.and_then(|base| base.get(name)), &names, found);
            }
        }
        _ => found.push((names.to_vec(), of)),
    }
}

/// Puts values in the places of those of the same name. Names that are not there are added, for the
/// configuration to refuse.
fn put(whole: &mut Value, values: Value) {
    match (whole, values) {
        (Value::Object(whole), Value::Object(values)) => {
            for (name, value) in values {
                put(whole.entry(name).or_insert(Value::Null), value);
            }
        }
        (whole, value) => *whole = value,
    }
}

#[derive(Serialize)]
struct RunRecord<'a> {
    version: &'static str,
    commit: Option<String>,
    seed: u64,
    device: String,
    demonstrations: &'a BTreeMap<String, String>,
    /// Of MVP alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    frozen_encoder: Option<EncoderRecord>,
}

/// The encoder that a training was given.
#[derive(Serialize)]
pub(super) struct EncoderRecord {
    /// The name of its file.
    file: String,
    sha256: String,
}

impl EncoderRecord {
    /// The record of an encoder that was loaded from a file.
    pub(super) fn new(path: &Path, encoder: &dyn FeatureEncoder) -> Self {
        let name = path.file_name().unwrap_or(path.as_os_str());
        Self {
            file: name.to_string_lossy().into_owned(),
            sha256: sha256_hex(encoder.file()),
        }
    }
}

/// Keeps the configuration of a training in its run folder, and with which version of the program, on
/// which demonstrations, by their SHA-256, and with which encoder, if it was given one, it was started.
pub(super) fn write_run(
    run_folder: &Path,
    config: &impl Serialize,
    seed: u64,
    digests: &BTreeMap<String, String>,
    frozen_encoder: Option<EncoderRecord>,
) -> Result<(), CliError> {
    let record = RunRecord {
        version: env!("CARGO_PKG_VERSION"),
        commit: revision(Path::new(".")),
        seed,
        device: format!("{:?}", training_device()),
        demonstrations: digests,
        frozen_encoder,
    };
    keep(&run_folder.join(CONFIG), config)?;
    keep(&run_folder.join(RECORD), &record)
}

/// The commit that a training began with, so far as its run folder tells.
pub(super) fn training_commit(run_folder: &Path) -> Option<String> {
    let text = fs::read(run_folder.join(RECORD)).ok()?;
    let record: Value = serde_json::from_slice(&text).ok()?;
    record["commit"].as_str().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::arguments::{Arguments, Command};

    fn file(text: &str) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        file
    }

    #[test]
    fn a_file_replaces_what_it_names_and_nothing_else() {
        let preset = Preset::Bedroom.config();
        let text = "seed: 9\nnetwork:\n  variant: siamese\n  encoder: {latent_dim: 64}\n";
        let config = overridden(&preset, file(text).path()).unwrap();
        let mut expected = preset.clone();
        expected.seed = 9;
        expected.network.variant = NetworkVariant::Siamese;
        expected.network.encoder.latent_dim = 64;
        assert_eq!(config, expected);
        let whole = serde_json::to_string(&config).unwrap();
        assert_eq!(overridden(&preset, file(&whole).path()).unwrap(), config);
    }

    #[test]
    fn all_faults_are_told_with_their_names_and_what_was_meant() {
        let preset = Preset::Tiny.config();
        let text = "stepps: 5\nlearning_rat: 0.1\nsampling: {states: -4, windw: 3}\nseed: 7\n";
        let message = overridden(&preset, file(text).path())
            .unwrap_err()
            .to_string();
        for part in [
            "no 'stepps' (did you mean 'steps'?)",
            "no 'learning_rat' (did you mean 'optimiser.learning_rate'?)",
            "sampling.states: invalid value: integer `-4`",
            "no 'sampling.windw' (did you mean 'sampling.window'?)",
        ] {
            assert!(message.contains(part), "{part} is not in {message}");
        }
        assert!(!message.contains("seed"), "{message}");
    }

    #[test]
    fn one_wrong_name_where_there_was_nothing_is_one_fault() {
        let preset = Preset::Tiny.config();
        assert!(preset.landmarks.is_none());
        let text = "landmarks:\n  weigth: 1.0\n  count: 2\n  drop_m: 0.12\n";
        let refused = overridden(&preset, file(text).path()).unwrap_err();
        let message = refused.to_string();
        assert_eq!(message.matches("landmarks").count(), 1, "{message}");
        assert!(
            message.contains("landmarks: unknown field `weigth`"),
            "{message}"
        );
    }

    #[test]
    fn own_goals_are_those_of_our_networks_alone() {
        let given = |words: &[&str]| {
            let words = [&["catena", "train", "demos", "--out", "model"], words].concat();
            let Command::Train(arguments) = Arguments::try_parse_from(words).unwrap().command
            else {
                panic!("it is a training");
            };
            arguments
        };
        let share = |words: &[&str]| {
            let arguments = given(words);
            let config = training_config(written_config(&arguments).unwrap(), &arguments, &[]);
            config.unwrap().sampling.aligned_share
        };
        assert!(share(&["--preset", "bedroom"]) > 0.0);
        assert!(share(&["--preset", "bedroom", "--own-goals"]) < f64::EPSILON);
        let refused = baseline_config(BaselineMethod::Bc, &given(&["--own-goals"])).unwrap_err();
        assert!(refused.to_string().starts_with("--own-goals"), "{refused}");
    }

    #[test]
    fn faults_name_the_file() {
        let preset = Preset::Tiny.config();
        for text in ["network: {stepz: 1}", "steps: many", "seed: [", "- 1"] {
            let file = file(text);
            let message = overridden(&preset, file.path()).unwrap_err().to_string();
            assert!(
                message.contains(&file.path().display().to_string()),
                "{message}"
            );
        }
    }
}
