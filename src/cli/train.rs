use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;

use super::arguments::TrainArguments;
use super::error::CliError;
use super::loaded::read_demonstrations;
use super::progress;
use crate::storage::demonstrations_digest;
use crate::training::{
    Preset, TrainingConfig, TrainingEvent, TrainingObserver, export, train as fit,
};
use crate::trajectory::{Action, DemonstrationSet};

/// `catena train`: demonstrations to a model in a folder of ONNX files.
pub(super) fn train(arguments: &TrainArguments) -> Result<(), CliError> {
    let config = config(arguments)?;
    let run_folder = arguments
        .run
        .clone()
        .unwrap_or_else(|| beside(&arguments.out));
    if !arguments.resume && run_folder.join(CHECKPOINT).exists() {
        return Err(CliError::RunExists { run: run_folder });
    }
    let (sets, digests) = load_sets(&arguments.demos, arguments.bins)?;
    println!(
        "training on {} states of {} tasks; checkpoints and losses.csv in {}",
        sets.iter().map(DemonstrationSet::step_count).sum::<usize>(),
        sets.len(),
        run_folder.display(),
    );
    let mut printer = Printer {
        bar: progress::bar("training", config.steps),
    };
    let report = fit(&sets, &config, &run_folder, &mut printer)?;
    printer.bar.finish_and_clear();
    let manifest = export(&report.model, digests, &arguments.out)?;
    let metrics = &manifest.training.validation;
    println!(
        "{} steps in {:.0} s ({:.0} states/s); best after step {}: traversability {:.1} % of classes right, \
         policy {:.1} % of actions ({} with goal states of other demonstrations), look-alikes taken for near {:.2} %, \
         missed grasps taken for held {}\nmodel {} in {}",
        report.steps,
        report.spent_secs,
        report.states_per_sec,
        report.model.step,
        100.0 * metrics.traversability_accuracy,
        100.0 * metrics.policy_accuracy,
        percent(metrics.policy_accuracy_across),
        100.0 * metrics.look_alike_wormhole_rate,
        percent(metrics.missed_grasp_wormhole_rate),
        &manifest.digest()[..12],
        arguments.out.display(),
    );
    Ok(())
}

/// A share for people; "none" where there was nothing to measure.
fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "none".to_owned(), |s| format!("{:.1} %", 100.0 * s))
}

/// The trainer's checkpoint in its run folder.
const CHECKPOINT: &str = "checkpoint.safetensors";

/// Runs lie beside the model, which is to hold nothing but what deploys.
fn beside(model: &Path) -> PathBuf {
    let mut name = model.file_name().unwrap_or_default().to_owned();
    name.push(".run");
    model.with_file_name(name)
}

fn config(arguments: &TrainArguments) -> Result<TrainingConfig, CliError> {
    let preset = Preset::parse(&arguments.preset).ok_or_else(|| CliError::UnknownPreset {
        found: arguments.preset.clone(),
        known: Preset::NAMES.map(|(name, _)| name).join(", "),
    })?;
    let mut config = preset.config();
    config.seed = arguments.seed;
    config.max_minutes = arguments.minutes;
    if let Some(steps) = arguments.steps {
        config.steps = steps as u64;
    }
    Ok(config)
}

/// Each folder as a set of its own, with its digest by its task's name. Continuous actions of all sets
/// are binned together.
pub(super) fn load_sets(
    folders: &[PathBuf],
    bins: usize,
) -> Result<(Vec<DemonstrationSet>, BTreeMap<String, String>), CliError> {
    let mut sets = Vec::new();
    let mut digests = BTreeMap::new();
    for folder in folders {
        let task = folder
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let paths = [folder.clone()];
        let (set, _) = read_demonstrations(&paths, &task)?;
        digests.insert(task, demonstrations_digest(&paths)?);
        sets.push(set);
    }
    Ok((binned(sets, bins)?, digests))
}

fn binned(sets: Vec<DemonstrationSet>, bins: usize) -> Result<Vec<DemonstrationSet>, CliError> {
    let Some(first) = sets.first() else {
        return Ok(sets);
    };
    let actions: Vec<Action> = sets
        .iter()
        .flat_map(DemonstrationSet::trajectories)
        .flat_map(|t| t.steps.iter().map(|s| s.action.clone()))
        .collect();
    let space = first.action_space().binned(actions.iter(), bins);
    if space == *first.action_space() {
        return Ok(sets);
    }
    let rebinned = sets.iter().map(|set| {
        let mut trajectories = set.trajectories().to_vec();
        for trajectory in &mut trajectories {
            trajectory.action_space = space.clone();
        }
        DemonstrationSet::new(set.task(), trajectories)
    });
    Ok(rebinned.collect::<Result<_, _>>()?)
}

struct Printer {
    bar: ProgressBar,
}

impl TrainingObserver for Printer {
    fn notice(&mut self, event: &TrainingEvent) {
        match event {
            TrainingEvent::Started {
                training_states,
                validation_states,
                resumed_from,
                parameters,
                ..
            } => {
                self.bar.println(format!(
                    "{training_states} states to train on, {validation_states} held out, {parameters} weights"
                ));
                self.bar.set_position(*resumed_from);
                self.bar.reset_eta();
            }
            TrainingEvent::Step {
                step,
                losses,
                states_per_sec,
                ..
            } => {
                self.bar.set_position(*step);
                self.bar.set_message(format!(
                    "loss {:.3}, {states_per_sec:.0} states/s",
                    losses.total
                ));
            }
            TrainingEvent::Validated {
                step,
                metrics,
                is_best,
                ..
            } => {
                let line = format!(
                    "step {step:>6}: held out: traversability loss {:.3}, {:.1} % right; policy loss {:.3}, {:.1} % right, across {}{}",
                    metrics.traversability_loss,
                    100.0 * metrics.traversability_accuracy,
                    metrics.policy_loss,
                    100.0 * metrics.policy_accuracy,
                    percent(metrics.policy_accuracy_across),
                    if *is_best { "  (best)" } else { "" },
                );
                if self.bar.is_hidden() {
                    println!("{line}");
                } else {
                    self.bar.println(line);
                }
            }
            TrainingEvent::CheckpointWritten { .. } => {}
        }
    }
}
