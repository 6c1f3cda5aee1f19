use rayon::prelude::*;

use super::arguments::{Arguments, EvaluateArguments, LastStepsArgument, PlannerArgument};
use super::baseline::baseline_evaluation;
use super::error::CliError;
use super::loaded::{Loaded, bedroom_at};
use super::{progress, shortcuts};
use crate::experiment::{EpisodeResult, Evaluation, ScoredBedroom};
use crate::planner::PlannerOptions;
use crate::rollout::{Rollout, RolloutOptions};
use crate::simulator::{Bedroom, BedroomConfig};

/// `catena evaluate`: episodes on seeds of their own, side by side on all cores.
pub(super) fn evaluate(
    evaluate_arguments: &EvaluateArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    if evaluate_arguments.target == shortcuts::TARGET && evaluate_arguments.policy.is_none() {
        return shortcuts::evaluate_shortcuts(evaluate_arguments, arguments);
    }
    let target = &evaluate_arguments.target;
    if let Some(composition) = &evaluate_arguments.composition {
        return Err(CliError::CompositionUnused {
            target: target.clone(),
            composition: composition.clone(),
        });
    }
    let evaluation = match &evaluate_arguments.policy {
        Some(folder) => baseline_evaluation(target, folder, evaluate_arguments, arguments)?,
        None => evaluation(target, evaluate_arguments, arguments)?,
    };
    if evaluate_arguments.json {
        println!("{}", serde_json::to_string_pretty(&evaluation)?);
    } else {
        println!("{evaluation}");
    }
    Ok(())
}

/// How our method does on a task or a composition.
pub(super) fn evaluation(
    target: &str,
    evaluate_arguments: &EvaluateArguments,
    arguments: &Arguments,
) -> Result<Evaluation, CliError> {
    let loaded = Loaded::load(target, arguments)?;
    let bedroom = bedroom(&loaded, evaluate_arguments)?;
    let planner = loaded.planner(options(&loaded, evaluate_arguments.planner))?;
    let judged = loaded.composition.demonstrated_automaton();
    let options = driving(&loaded, evaluate_arguments);
    let rollout = Rollout::new(loaded.rollout_model(), planner, options)?;
    let results = episodes("evaluating", evaluate_arguments, |seed| {
        let mut room = ScoredBedroom::new(Bedroom::new(bedroom), &judged);
        let episode = rollout.clone().run(&mut room, seed, &mut ())?;
        Ok(EpisodeResult::new(seed, &episode, room.score()))
    })?;
    let subgoals: Vec<String> = judged.subgoals().iter().map(|s| s.name.clone()).collect();
    let level = format!("{:?}", bedroom.level).to_lowercase();
    Ok(Evaluation::new(
        &loaded.composition.name,
        &level,
        evaluate_arguments.seed,
        loaded.model.engine().name(),
        &subgoals,
        results,
    ))
}

/// The bedroom of a composition at the level that is asked for.
pub(super) fn bedroom(
    loaded: &Loaded,
    evaluate_arguments: &EvaluateArguments,
) -> Result<BedroomConfig, CliError> {
    bedroom_at(&loaded.composition, evaluate_arguments.level.into())
}

/// Runs as many episodes as are asked for, each on a seed of its own, side by side on all cores with a
/// bar of that name; the results are in the order of the seeds.
pub(super) fn episodes<T: Send>(
    name: &'static str,
    evaluate_arguments: &EvaluateArguments,
    episode: impl Fn(u64) -> Result<T, CliError> + Sync,
) -> Result<Vec<T>, CliError> {
    let count = evaluate_arguments.episodes as u64;
    let bar = progress::bar(name, count);
    let results = (0..count)
        .into_par_iter()
        .map(|k| {
            let result = episode(evaluate_arguments.seed + k)?;
            bar.inc(1);
            Ok(result)
        })
        .collect::<Result<_, CliError>>()?;
    bar.finish_and_clear();
    Ok(results)
}

/// How a composition is run in the way that is asked for.
pub(super) fn driving(loaded: &Loaded, evaluate_arguments: &EvaluateArguments) -> RolloutOptions {
    RolloutOptions {
        approach: evaluate_arguments.last_steps == LastStepsArgument::Led,
        ..loaded.rollout_options(evaluate_arguments.nearest_states)
    }
}

/// How a composition is planned in the way that is asked for.
pub(super) fn options(loaded: &Loaded, planner: PlannerArgument) -> PlannerOptions {
    match planner {
        PlannerArgument::InOrder => loaded.composition.planner.clone(),
        PlannerArgument::Unconstrained => PlannerOptions::paper(),
    }
}
