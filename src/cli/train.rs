use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;

use super::arguments::{Arguments, TrainArguments};
use super::baseline::{method_of, train_method};
use super::demonstrations::{ReadSet, read_demonstrations, read_options, read_practice};
use super::error::CliError;
use super::progress;
use super::training_config::{training_config, write_run, written_config};
use crate::inference::Model;
use crate::model::{
    ENCODER_FILE, LANDMARKS_FILE, MANIFEST_FILE, POLICY_FILE, PROJECTION_FILE, TRAVERSABILITY_FILE,
};
use crate::storage::{ReadOptions, Recordings, what_would_be_lost};
use crate::training::{
    FinishedModel, GripperPractice, Practised, TrainingEvent, TrainingObserver, export,
    train as fit,
};
use crate::trajectory::{ActionDimension, ActionSpace, Binning, DemonstrationSet};
use crate::wording::counted;

/// `catena train`: demonstrations to a model in a folder of ONNX files.
pub(super) fn train(arguments: &TrainArguments, all: &Arguments) -> Result<(), CliError> {
    if let Some(method) = method_of(arguments.method) {
        return train_method(method, arguments, all);
    }
    if arguments.frozen_encoder.is_some() {
        return Err(CliError::FrozenEncoderOfOurs);
    }
    if let Some(model) = &arguments.keep_networks {
        return practise(arguments, all, model);
    }
    // What is wrong in it is told before the demonstrations are read.
    let config = written_config(arguments)?;
    let Prepared {
        sets,
        mut digests,
        run_folder,
    } = prepared(arguments)?;
    let runs = practice_runs(arguments, &mut digests)?;
    let practice = GripperPractice {
        runs: &runs,
        demonstrations: &sets,
    };
    let config = training_config(config, arguments, &sets)?;
    config.check()?;
    if !runs.is_empty() {
        practice.check(&config)?;
    }
    if !run_folder.join(CHECKPOINT).exists() {
        write_run(&run_folder, &config, config.seed, &digests)?;
    }
    let mut printer = Printer {
        bar: progress::bar("training", config.steps),
    };
    let mut report = fit(&sets, &config, &run_folder, &mut printer)?;
    printer.bar.finish_and_clear();
    if !runs.is_empty() {
        say_practised(practice.teach(&config, report.model.landmarks.as_mut())?);
    }
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

/// What the digest of practice is called beside those of demonstrations, before the name of its task.
const PRACTICE_OF: &str = "practice of ";

/// `catena train --keep-networks`: learns anew what a finished model's networks stay out of.
fn practise(arguments: &TrainArguments, all: &Arguments, folder: &Path) -> Result<(), CliError> {
    check_model_place(&arguments.out)?;
    let read = read_options(&arguments.read);
    let (sets, mut digests) =
        load_sets(&arguments.demos, arguments.bins, &read, read_demonstrations)?;
    let finished = FinishedModel::load(folder)?;
    let known = &finished.manifest().training.datasets;
    let is_other = |(task, digest): &(&String, &String)| known.get(*task) != Some(*digest);
    let other = digests.iter().find(is_other).map(|(task, _)| task);
    let is_missing = |set: &&String| !set.starts_with(PRACTICE_OF) && !digests.contains_key(*set);
    if let Some(task) = other.or_else(|| known.keys().find(is_missing)) {
        return Err(CliError::OtherDemonstrations {
            task: task.clone(),
            model: folder.to_path_buf(),
        });
    }
    let runs = practice_runs(arguments, &mut digests)?;
    let practice = GripperPractice {
        runs: &runs,
        demonstrations: &sets,
    };
    let encoder = Model::load(folder, all.engine.into())?;
    let (manifest, practised) = finished.practised(&practice, &encoder, digests, &arguments.out)?;
    say_practised(practised);
    println!(
        "model {} in {}; the graphs of another are to be built anew",
        &manifest.digest()[..12],
        arguments.out.display()
    );
    Ok(())
}

fn say_practised(practised: Practised) {
    println!(
        "practice shows a gripper that is closed on nothing in {}, and one that holds something in {}",
        counted(practised.empty, "state"),
        counted(practised.held, "state"),
    );
}

/// Practice with the gripper; its digests are noted.
fn practice_runs(
    arguments: &TrainArguments,
    digests: &mut BTreeMap<String, String>,
) -> Result<Vec<DemonstrationSet>, CliError> {
    let read = read_options(&arguments.read);
    let (runs, of_runs) = load_sets(&arguments.practice, arguments.bins, &read, read_practice)?;
    let named = of_runs.into_iter();
    digests.extend(named.map(|(task, digest)| (format!("{PRACTICE_OF}{task}"), digest)));
    Ok(runs)
}

/// What a training begins with.
pub(super) struct Prepared {
    pub(super) sets: Vec<DemonstrationSet>,
    /// Digests of the sets by their tasks' names.
    pub(super) digests: BTreeMap<String, String>,
    pub(super) run_folder: PathBuf,
}

/// Reads the demonstrations of a training and says what it begins with; refuses a run folder that holds another
/// one's checkpoint unless it is to be resumed, and a place that a model must not take.
pub(super) fn prepared(arguments: &TrainArguments) -> Result<Prepared, CliError> {
    let run_folder = arguments
        .run
        .clone()
        .unwrap_or_else(|| beside(&arguments.out));
    let has_begun = run_folder.join(CHECKPOINT).exists();
    if !arguments.resume && has_begun {
        return Err(CliError::RunExists { run: run_folder });
    }
    if arguments.resume && !has_begun {
        println!(
            "no checkpoint to go on from in {}: the training begins",
            run_folder.display()
        );
    }
    if whole(&run_folder).starts_with(whole(&arguments.out)) {
        return Err(CliError::RunInModel {
            run: run_folder,
            model: arguments.out.clone(),
        });
    }
    check_model_place(&arguments.out)?;
    let (sets, digests) = load_sets(
        &arguments.demos,
        arguments.bins,
        &read_options(&arguments.read),
        read_demonstrations,
    )?;
    println!(
        "training on {} states of {}; checkpoints and losses.csv in {}{}",
        sets.iter().map(DemonstrationSet::step_count).sum::<usize>(),
        counted(sets.len(), "task"),
        run_folder.display(),
        sets.first()
            .map(|s| describe_bins(s.action_space()))
            .unwrap_or_default(),
    );
    Ok(Prepared {
        sets,
        digests,
        run_folder,
    })
}

/// A path from the root on.
fn whole(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// All files that a model's or a baseline's folder may hold.
const MODEL_FILES: [&str; 6] = [
    ENCODER_FILE,
    PROJECTION_FILE,
    TRAVERSABILITY_FILE,
    POLICY_FILE,
    LANDMARKS_FILE,
    MANIFEST_FILE,
];
/// How the name of one ends that a killed export left.
const UNFINISHED: &str = ".partial";

/// Checks that a model can be written to a place that is not there, empty, or another model's, so that nothing else is
/// lost.
fn check_model_place(out: &Path) -> Result<(), CliError> {
    let path = out.to_owned();
    if out.is_file() {
        return Err(CliError::OutIsFile { path });
    }
    let is_of_model = |name: &str| {
        let finished = name.strip_suffix(UNFINISHED).unwrap_or(name);
        MODEL_FILES.contains(&finished)
    };
    match what_would_be_lost(out, is_of_model)? {
        None => Ok(()),
        Some(what) => Err(CliError::OutHoldsOthers { path, what }),
    }
}

/// A share for people; "none" where there was nothing to measure.
fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "none".to_owned(), |s| format!("{:.1} %", 100.0 * s))
}

/// The trainer's checkpoint in its run folder.
pub(super) const CHECKPOINT: &str = "checkpoint.safetensors";

/// Runs lie beside the model, which is to hold nothing but what deploys.
fn beside(model: &Path) -> PathBuf {
    let mut name = model.file_name().unwrap_or_default().to_owned();
    name.push(".run");
    model.with_file_name(name)
}

/// Each path as a set of its own, or several of a dataset that has several tasks, with their digests by the
/// tasks' names. Continuous actions of all sets are binned together.
pub(super) fn load_sets(
    paths: &[PathBuf],
    bins: usize,
    options: &ReadOptions,
    read: fn(&Recordings, &str) -> Result<ReadSet, CliError>,
) -> Result<(Vec<DemonstrationSet>, BTreeMap<String, String>), CliError> {
    let mut sets = Vec::new();
    let mut digests = BTreeMap::new();
    let mut binning: Option<(&Path, Binning)> = None;
    for path in paths {
        let recordings = Recordings::open(std::slice::from_ref(path), options)?;
        let digest = recordings.digest()?;
        for task in recordings.tasks() {
            let (set, _) = read(&recordings, &task)?;
            if digests.insert(task.clone(), digest.clone()).is_some() {
                return Err(CliError::TaskTwice {
                    task,
                    path: path.clone(),
                });
            }
            sets.push(set);
        }
        let own = recordings.binning(bins);
        match &binning {
            Some((first, other)) if *other != own => {
                return Err(CliError::BinningsDiffer {
                    first: first.to_path_buf(),
                    other: path.clone(),
                });
            }
            _ => binning = Some((path, own)),
        }
    }
    let binning = binning.map_or_else(|| Binning::uniform(bins), |(_, binning)| binning);
    Ok((binned(sets, &binning)?, digests))
}

fn binned(
    sets: Vec<DemonstrationSet>,
    binning: &Binning,
) -> Result<Vec<DemonstrationSet>, CliError> {
    let Some(first) = sets.first() else {
        return Ok(sets);
    };
    let actions = sets
        .iter()
        .flat_map(DemonstrationSet::trajectories)
        .flat_map(|t| t.steps.iter().map(|s| &s.action));
    let space = first.action_space().binned_by(actions, binning)?;
    if space == *first.action_space() {
        return Ok(sets);
    }
    let rebinned = sets.iter().map(|set| {
        if set.action_space() != first.action_space() {
            // Told by the training, with the names of both sets.
            return Ok(set.clone());
        }
        let mut trajectories = set.trajectories().to_vec();
        for trajectory in &mut trajectories {
            trajectory.action_space = space.clone();
        }
        DemonstrationSet::new(set.task(), trajectories)
    });
    Ok(rebinned.collect::<Result<_, _>>()?)
}

/// How each dimension of binned actions is cut, a line each.
fn describe_bins(space: &ActionSpace) -> String {
    let ActionSpace::Binned { dimensions } = space else {
        return String::new();
    };
    let line = |d: &ActionDimension| {
        let spacing = if d.edges.is_empty() {
            "equal"
        } else {
            "by quantiles"
        };
        format!(
            "\n  {:<12} {:>3} bins, {spacing}, {} to {}",
            d.name, d.bins, d.low, d.high
        )
    };
    dimensions.iter().map(line).collect()
}

/// Tells people how a training goes.
pub(super) struct Printer {
    pub(super) bar: ProgressBar,
}

impl Printer {
    fn print(&self, line: String) {
        if self.bar.is_hidden() {
            println!("{line}");
        } else {
            self.bar.println(line);
        }
    }
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
                self.print(format!(
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
                    "step {step:>6}: held out: traversability loss {:.3}, {:.1} % right; policy loss {:.3}, {:.1} % right, across {}{}{}{}",
                    metrics.traversability_loss,
                    100.0 * metrics.traversability_accuracy,
                    metrics.policy_loss,
                    100.0 * metrics.policy_accuracy,
                    percent(metrics.policy_accuracy_across),
                    (metrics.motion_explained).map_or_else(String::new, |e| format!(
                        "; motion to go {:.1} % explained",
                        100.0 * e
                    )),
                    (metrics.landmark_error_pixels)
                        .map_or_else(String::new, |e| format!("; landmarks {e:.1} pixels off")),
                    if *is_best { "  (best)" } else { "" },
                );
                self.print(line);
            }
            TrainingEvent::BaselineValidated {
                step,
                validation,
                is_best,
            } => self.print(format!(
                "step {step:>6}: held out: loss {:.3}, {:.1} % of actions right{}",
                validation.loss,
                100.0 * validation.accuracy,
                if *is_best { "  (best)" } else { "" },
            )),
            TrainingEvent::CheckpointWritten { .. } => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_model_takes_the_place_of_nothing_but_a_model() {
        let root = tempfile::tempdir().unwrap();
        let out = root.path().join("model");
        check_model_place(&out).unwrap();
        fs::create_dir(&out).unwrap();
        check_model_place(&out).unwrap();
        for file in MODEL_FILES {
            fs::write(out.join(file), "").unwrap();
        }
        fs::write(out.join("policy.onnx.partial"), "").unwrap();
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
