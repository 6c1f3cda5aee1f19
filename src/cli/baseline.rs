use std::path::Path;
use std::sync::Arc;

use super::arguments::{Arguments, EvaluateArguments, MethodArgument, TrainArguments};
use super::demonstrations::read_demonstrations;
use super::error::CliError;
use super::evaluate::episodes;
use super::loaded::bedroom_at;
use super::parent::EndOfInput;
use super::progress;
use super::train::{CHECKPOINT, Prepared, Printer, prepared, tell_ended};
use super::training_config::{EncoderRecord, baseline_config, write_run};
use super::worlds::composed;
use crate::composer::ResolvedTask;
use crate::experiment::{EpisodeResult, Evaluation, ScoredBedroom};
use crate::inference::{Baseline, FrozenEncoder};
use crate::model::{BaselineMethod, BaselineSpec, FeatureEncoder, ReactivePolicy};
use crate::rollout::{ReactiveRollout, RolloutOptions};
use crate::simulator::Bedroom;
use crate::storage::{ReadOptions, Recordings};
use crate::training::{TrainingError, check_baseline_training, export_baseline, train_baseline};
use crate::trajectory::{State, TrajectoryError};

/// The baseline that is asked for; none for our own model.
pub(super) fn method_of(argument: MethodArgument) -> Option<BaselineMethod> {
    match argument {
        MethodArgument::Ours => None,
        MethodArgument::Bc => Some(BaselineMethod::Bc),
        MethodArgument::BcRnn => Some(BaselineMethod::BcRnn),
        MethodArgument::Rt1 => Some(BaselineMethod::Rt1),
        MethodArgument::Mvp => Some(BaselineMethod::Mvp),
    }
}

/// `catena train --method`: demonstrations to a baseline policy in a folder of ONNX files.
pub(super) fn train_method(
    method: BaselineMethod,
    arguments: &TrainArguments,
    all: &Arguments,
    end_of_input: &EndOfInput,
) -> Result<(), CliError> {
    if !arguments.practice.is_empty() {
        return Err(CliError::FlagOfOurs { flag: "--practice" });
    }
    let config = baseline_config(method, arguments)?;
    let frozen = frozen_encoder(method, arguments, all)?;
    let Prepared {
        sets,
        digests,
        run_place,
        ..
    } = prepared(arguments)?;
    check_baseline_training(&sets, &config)?;
    let run_folder = run_place.take(arguments, &sets)?;
    if let Some(encoder) = &frozen {
        let pictures = encoder.pictures();
        println!(
            "frozen encoder: pictures of {}x{}, mean {:?}, deviation {:?}, {} features each; {}",
            pictures.height,
            pictures.width,
            pictures.mean,
            pictures.deviation,
            pictures.feature_dim,
            encoder.engine().name(),
        );
    }
    if !run_folder.path().join(CHECKPOINT).exists() {
        let given = arguments.frozen_encoder.as_ref().zip(frozen.as_ref());
        let encoder = given.map(|(path, encoder)| EncoderRecord::new(path, encoder));
        write_run(run_folder.path(), &config, config.seed, &digests, encoder)?;
    }
    let mut printer = Printer {
        bar: progress::bar("training", config.steps),
        end_of_input: end_of_input.clone(),
    };
    let frozen = frozen
        .as_ref()
        .map(|encoder| encoder as &dyn FeatureEncoder);
    let report = train_baseline(&sets, &config, frozen, &run_folder, &mut printer)?;
    printer.bar.finish_and_clear();
    tell_ended(report.states_per_sec, run_folder.path());
    let manifest = export_baseline(&report.baseline, digests, &arguments.out)?;
    println!(
        "{} steps in {:.0} s ({:.0} states/s); best after step {}: held-out loss {:.3}, {:.1} % of actions \
         right\n{} {} in {}",
        report.steps,
        report.spent_secs,
        report.states_per_sec,
        report.baseline.step,
        report.baseline.validation.loss,
        100.0 * report.baseline.validation.accuracy,
        method.described(),
        &manifest.digest()[..12],
        arguments.out.display(),
    );
    Ok(())
}

/// Loaded before the demonstrations are read, which takes longer.
fn frozen_encoder(
    method: BaselineMethod,
    arguments: &TrainArguments,
    all: &Arguments,
) -> Result<Option<FrozenEncoder>, CliError> {
    match (&arguments.frozen_encoder, method) {
        (Some(path), BaselineMethod::Mvp) => {
            Ok(Some(FrozenEncoder::load(path, all.engine.into())?))
        }
        (None, BaselineMethod::Mvp) => Err(TrainingError::FrozenEncoderNeeded { method }.into()),
        (Some(_), _) => Err(TrainingError::FrozenEncoderUnused { method }.into()),
        (None, _) => Ok(None),
    }
}

/// How the baseline in a folder does on a task: success judged by the simulator's truth as for our method, an
/// episode over when all subgoals were reached or the task's steps are used up.
pub(super) fn baseline_evaluation(
    task: &str,
    policy: &Path,
    evaluate_arguments: &EvaluateArguments,
    arguments: &Arguments,
) -> Result<Evaluation, CliError> {
    let composition = composed(task, &arguments.root)?;
    let [only] = &composition.tasks[..] else {
        return Err(CliError::PolicyOfOneTask {
            composition: composition.name.clone(),
            tasks: composition.tasks.len(),
        });
    };
    let baseline = Baseline::load(policy, arguments.engine.into())?;
    let goal = goal_state(only, baseline.spec())?;
    let room = bedroom_at(&composition, evaluate_arguments.level.into())?;
    let options = RolloutOptions {
        max_steps: composition.limits.steps as usize,
        ..RolloutOptions::default()
    };
    let rollout = ReactiveRollout::new(&baseline, &goal, options)?;
    let judged = composition.demonstrated_automaton();
    let results = episodes("evaluating", evaluate_arguments, |seed| {
        let mut scored = ScoredBedroom::new(Bedroom::new(room), &judged);
        let is_done = |room: &ScoredBedroom| room.score().first_steps().iter().all(Option::is_some);
        let episode = rollout.run(&mut scored, seed, &mut (), is_done)?;
        Ok(EpisodeResult::new(seed, &episode, scored.score()))
    })?;
    let subgoals: Vec<String> = judged.subgoals().iter().map(|s| s.name.clone()).collect();
    Ok(Evaluation::new(
        &composition.name,
        &format!("{:?}", room.level).to_lowercase(),
        evaluate_arguments.seed,
        baseline.engine().name(),
        &subgoals,
        results,
    ))
}

/// The end of a task's first demonstration, with the images of the policy's cameras in their size.
pub(super) fn goal_state(task: &ResolvedTask, spec: &BaselineSpec) -> Result<State, CliError> {
    let name = &task.task.name;
    let none = || CliError::NoGoalImage { task: name.clone() };
    if task.demonstrations.is_empty() {
        return Err(none());
    }
    let recordings = Recordings::open(&task.demonstrations, &ReadOptions::default())?;
    let (set, _) = read_demonstrations(&recordings, name)?;
    let steps = &set.trajectories().first().ok_or_else(none)?.steps;
    let first = steps.len().saturating_sub(spec.stack);
    let frames = steps[first..]
        .iter()
        .map(|step| Ok(Arc::new(step.observation.fitted(&spec.cameras)?)))
        .collect::<Result<Vec<_>, TrajectoryError>>()?;
    if frames.is_empty() {
        return Err(none());
    }
    Ok(State::from_history(&frames, spec.stack))
}
