use rayon::prelude::*;

use super::arguments::{Arguments, EvaluateArguments, PlannerArgument};
use super::error::CliError;
use super::loaded::Loaded;
use super::{progress, shortcuts};
use crate::experiment::{EpisodeResult, Evaluation, ScoredBedroom};
use crate::planner::{PlannerOptions, Search};
use crate::rollout::Rollout;
use crate::simulator::{Bedroom, BedroomConfig};

/// `catena evaluate`: episodes on seeds of their own, side by side on all cores.
pub(super) fn evaluate(
    evaluate_arguments: &EvaluateArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    if evaluate_arguments.target == shortcuts::TARGET {
        return shortcuts::evaluate_shortcuts(evaluate_arguments, arguments);
    }
    let loaded = Loaded::load(&evaluate_arguments.target, arguments)?;
    let bedroom = BedroomConfig {
        level: evaluate_arguments.level.into(),
        ..loaded.bedroom()?
    };
    let planner = loaded.planner(options(&loaded, evaluate_arguments.planner))?;
    let episodes = evaluate_arguments.episodes as u64;
    let bar = progress::bar("evaluating", episodes);
    let seeds: Vec<u64> = (0..episodes).map(|k| evaluate_arguments.seed + k).collect();
    let results: Vec<EpisodeResult> = seeds
        .into_par_iter()
        .map(|seed| {
            let mut room = ScoredBedroom::new(Bedroom::new(bedroom), &loaded.composition.automaton);
            let mut rollout = Rollout::new(
                loaded.rollout_model(),
                planner.clone(),
                loaded.rollout_options(),
            )?;
            let episode = rollout.run(&mut room, seed, &mut ())?;
            bar.inc(1);
            Ok(EpisodeResult::new(seed, &episode, room.score()))
        })
        .collect::<Result<_, CliError>>()?;
    bar.finish_and_clear();
    let subgoals: Vec<String> = loaded
        .composition
        .automaton
        .subgoals()
        .iter()
        .map(|s| s.name.clone())
        .collect();
    let level = format!("{:?}", bedroom.level).to_lowercase();
    let evaluation = Evaluation::new(
        &loaded.composition.name,
        &level,
        evaluate_arguments.seed,
        loaded.model.engine().description(),
        &subgoals,
        results,
    );
    if evaluate_arguments.json {
        println!("{}", serde_json::to_string_pretty(&evaluation)?);
    } else {
        println!("{evaluation}");
    }
    Ok(())
}

fn options(loaded: &Loaded, planner: PlannerArgument) -> PlannerOptions {
    match planner {
        PlannerArgument::InOrder => loaded.composition.planner.clone(),
        PlannerArgument::Unconstrained => PlannerOptions {
            search: Search::Unconstrained,
            ..PlannerOptions::paper()
        },
    }
}
