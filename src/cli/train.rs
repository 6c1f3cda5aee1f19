mod place;
mod printer;
mod run_place;
mod sets;

use std::collections::BTreeMap;
use std::path::Path;

use super::arguments::{Arguments, TrainArguments};
use super::baseline::{method_of, train_method};
use super::demonstrations::{read_demonstrations, read_options, read_practice};
use super::error::CliError;
use super::parent::EndOfInput;
use super::progress;
use super::training_config::{training_config, write_run, written_config};
use crate::inference::Model;
use crate::training::{
    FinishedModel, GripperPractice, Practised, check_training, export, train as fit,
};
use crate::trajectory::DemonstrationSet;
use crate::wording::counted;
use place::{check_can_be_made, check_model_place};
pub(super) use printer::Printer;
pub(super) use run_place::{CHECKPOINT, RunPlace};
use sets::load_sets;

/// `catena train`: demonstrations to a model in a folder of ONNX files.
pub(super) fn train(
    arguments: &TrainArguments,
    all: &Arguments,
    end_of_input: &EndOfInput,
) -> Result<(), CliError> {
    if let Some(method) = method_of(arguments.method) {
        return train_method(method, arguments, all, end_of_input);
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
        runs,
        digests,
        run_place,
    } = prepared(arguments)?;
    let practice = GripperPractice {
        runs: &runs,
        demonstrations: &sets,
    };
    let config = training_config(config, arguments, &sets)?;
    config.check()?;
    if !runs.is_empty() {
        practice.check(&config)?;
    }
    check_training(&sets, &config)?;
    let run_folder = run_place.take(arguments, &sets)?;
    if !run_folder.path().join(CHECKPOINT).exists() {
        write_run(run_folder.path(), &config, config.seed, &digests, None)?;
    }
    let mut printer = Printer {
        bar: progress::bar("training", config.steps),
        end_of_input: end_of_input.clone(),
    };
    let mut report = fit(&sets, &config, &run_folder, &mut printer)?;
    printer.bar.finish_and_clear();
    tell_ended(report.states_per_sec, run_folder.path());
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
pub(super) const PRACTICE_OF: &str = "practice of ";

/// `catena train --keep-networks`: learns anew what a finished model's networks stay out of.
fn practise(arguments: &TrainArguments, all: &Arguments, folder: &Path) -> Result<(), CliError> {
    check_model_place(&arguments.out)?;
    check_can_be_made(&arguments.out)?;
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
    /// Practice with the gripper.
    runs: Vec<DemonstrationSet>,
    /// Digests of the sets by their tasks' names, and of practice.
    pub(super) digests: BTreeMap<String, String>,
    pub(super) run_place: RunPlace,
}

/// Reads the recordings of a training, once it is known that its places can be had.
pub(super) fn prepared(arguments: &TrainArguments) -> Result<Prepared, CliError> {
    let run_place = RunPlace::of(arguments)?;
    let (sets, mut digests) = load_sets(
        &arguments.demos,
        arguments.bins,
        &read_options(&arguments.read),
        read_demonstrations,
    )?;
    let runs = practice_runs(arguments, &mut digests)?;
    Ok(Prepared {
        sets,
        runs,
        digests,
        run_place,
    })
}

/// Says so where nothing was left to train: not even a later time limit adds to a training that has ended.
pub(super) fn tell_ended(states_per_sec: f64, run_folder: &Path) {
    if states_per_sec == 0.0 {
        println!(
            "the training in {} has ended before, and nothing is added to it; for a longer one name another folder with \
             --run",
            run_folder.display()
        );
    }
}

/// A share for people; "none" where there was nothing to measure.
fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "none".to_owned(), |s| format!("{:.1} %", 100.0 * s))
}
