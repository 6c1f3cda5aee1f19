use std::fmt::Write as _;

use serde::Serialize;

use super::arguments::{Arguments, EvaluateArguments, PlannerArgument};
use super::error::CliError;
use super::evaluate::{bedroom, driving, episodes, options};
use super::loaded::Loaded;
use super::record::bedroom_task;
use crate::composer::Composition;
use crate::experiment::{ScoredBedroom, ShortcutDetection, Skipper, Watched};
use crate::planner::{Planner, PlannerOptions};
use crate::rollout::{Monitor, Rollout, RolloutError};
use crate::simulator::{Bedroom, BedroomConfig, BedroomTask};
use crate::task::Automaton;
use crate::wording::counted;

/// The target of `catena evaluate` that stands for this evaluation.
pub(super) const TARGET: &str = "shortcuts";
/// What is run where no composition is named.
const COMPOSITION: &str = "tasks/sequences/sock_then_trash.yaml";

/// What drives the robot while the monitor watches.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Drive {
    /// The composition, with subgoals in order.
    InOrder,
    /// The paper's way: the shortest path over the merged graph.
    PapersWay,
    /// The last task alone from where the first one starts.
    LastTask,
    /// An operator who leaves out a part of a task before the last: a shortcut that is provoked.
    Skipper,
}

impl Drive {
    /// Those that take turns; where nothing is to be planned in order, that drive is left out.
    const fn of(planner: PlannerArgument) -> &'static [Self] {
        match planner {
            PlannerArgument::InOrder => &[
                Self::InOrder,
                Self::PapersWay,
                Self::LastTask,
                Self::Skipper,
            ],
            PlannerArgument::Unconstrained => &[Self::PapersWay, Self::LastTask, Self::Skipper],
        }
    }

    const fn described(self) -> &'static str {
        match self {
            Self::InOrder => "subgoals in order",
            Self::PapersWay => "the paper's way",
            Self::LastTask => "the last task alone",
            Self::Skipper => "an operator who skips",
        }
    }
}

#[derive(Serialize)]
struct ShortcutEpisode {
    seed: u64,
    drive: Drive,
    steps: usize,
    /// The first step at which a subgoal held before an earlier one had.
    shortcut_step: Option<usize>,
    /// The first step at which the monitor flagged a shortcut.
    flagged_step: Option<usize>,
}

#[derive(Serialize)]
struct DriveReport {
    drive: Drive,
    episodes: usize,
    #[serde(flatten)]
    detection: ShortcutDetection,
}

/// How well the monitor finds shortcuts.
#[derive(Serialize)]
struct ShortcutEvaluation {
    name: String,
    seed: u64,
    episodes: usize,
    #[serde(flatten)]
    detection: ShortcutDetection,
    drives: Vec<DriveReport>,
    engine: String,
    results: Vec<ShortcutEpisode>,
}

/// `catena evaluate shortcuts`: the ways of driving take turns, all watched by one kind of monitor, which
/// sees images alone and knows the subgoals in order.
pub(super) fn evaluate_shortcuts(
    evaluate_arguments: &EvaluateArguments,
    arguments: &Arguments,
) -> Result<(), CliError> {
    let composition = evaluate_arguments.composition.as_deref();
    let loaded = Loaded::load(composition.unwrap_or(COMPOSITION), arguments)?;
    let alone = Loaded::of(last_alone(&loaded.composition)?, arguments)?;
    let tasks = loaded.composition.automaton.tasks().iter();
    let tasks = tasks.map(|task| bedroom_task(task));
    let in_order = loaded.own_planner()?;
    let papers_way = loaded.planner(PlannerOptions::paper())?;
    let last_task = alone.planner(options(&alone, evaluate_arguments.planner))?;
    let watching = driving(&loaded, evaluate_arguments);
    let stage = Stage {
        bedroom: bedroom(&loaded, evaluate_arguments)?,
        monitor: Monitor::new(loaded.rollout_model(), &in_order, &watching)?,
        in_order: rollout(&loaded, in_order, evaluate_arguments)?,
        papers_way: rollout(&loaded, papers_way, evaluate_arguments)?,
        last_task: rollout(&alone, last_task, evaluate_arguments)?,
        judged: loaded.composition.demonstrated_automaton(),
        max_steps: watching.max_steps,
        tasks: tasks.collect::<Result<_, _>>()?,
    };
    let first = evaluate_arguments.seed;
    let drives = Drive::of(evaluate_arguments.planner);
    let results = episodes("watching", evaluate_arguments, |seed| {
        let drive = drives[(seed - first) as usize % drives.len()];
        stage.episode(seed, drive)
    })?;
    let report = ShortcutEvaluation {
        name: loaded.composition.name.clone(),
        seed: first,
        episodes: results.len(),
        detection: detection(results.iter()),
        drives: drives.iter().map(|d| of_drive(*d, &results)).collect(),
        engine: loaded.model.engine().name().to_owned(),
        results,
    };
    if evaluate_arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{}", described(&report));
    }
    Ok(())
}

/// The last task as a composition of its own, with the model of the whole one: a task need not name any.
fn last_alone(composition: &Composition) -> Result<Composition, CliError> {
    let last = composition.tasks.last();
    let mut last = last.expect("a composition has tasks").clone();
    last.model = Some(composition.model.clone());
    Ok(Composition::single(last)?)
}

/// What drives along a planner's composition.
fn rollout<'a>(
    driver: &'a Loaded,
    planner: Planner,
    evaluate_arguments: &EvaluateArguments,
) -> Result<Rollout<'a>, RolloutError> {
    let options = driving(driver, evaluate_arguments);
    Rollout::new(driver.rollout_model(), planner, options)
}

/// What all episodes share.
struct Stage<'a> {
    bedroom: BedroomConfig,
    monitor: Monitor<'a>,
    in_order: Rollout<'a>,
    papers_way: Rollout<'a>,
    last_task: Rollout<'a>,
    judged: Automaton,
    /// Steps of an operator who skips, at most.
    max_steps: usize,
    tasks: Vec<BedroomTask>,
}

impl Stage<'_> {
    fn episode(&self, seed: u64, drive: Drive) -> Result<ShortcutEpisode, CliError> {
        let mut watched = Watched::new(self.monitor.clone());
        let mut room = ScoredBedroom::new(Bedroom::new(self.bedroom), &self.judged);
        let rollout = match drive {
            Drive::InOrder => Some(&self.in_order),
            Drive::PapersWay => Some(&self.papers_way),
            Drive::LastTask => Some(&self.last_task),
            Drive::Skipper => None,
        };
        let steps = match rollout {
            Some(rollout) => rollout.clone().run(&mut room, seed, &mut watched)?.steps,
            None => {
                Skipper::new(self.tasks.clone(), seed)
                    .drive(&mut room, self.max_steps, |seen| watched.look(seen))?
            }
        };
        Ok(ShortcutEpisode {
            seed,
            drive,
            steps,
            shortcut_step: room.score().shortcut_step(),
            flagged_step: watched.flagged_step()?,
        })
    }
}

fn detection<'a>(episodes: impl Iterator<Item = &'a ShortcutEpisode>) -> ShortcutDetection {
    ShortcutDetection::new(episodes.map(|e| (e.shortcut_step, e.flagged_step)))
}

fn of_drive(drive: Drive, results: &[ShortcutEpisode]) -> DriveReport {
    let episodes = || results.iter().filter(move |e| e.drive == drive);
    DriveReport {
        drive,
        episodes: episodes().count(),
        detection: detection(episodes()),
    }
}

fn described(report: &ShortcutEvaluation) -> String {
    let percent = |share: Option<f64>| {
        share.map_or_else(|| "none".to_owned(), |s| format!("{:.0} %", 100.0 * s))
    };
    let mut text = format!(
        "{}: {} from seed {}; precision {}, recall {}\n  {}\n",
        report.name,
        counted(report.episodes, "episode"),
        report.seed,
        percent(report.detection.precision),
        percent(report.detection.recall),
        report.detection
    );
    for part in &report.drives {
        let (what, found) = (part.drive.described(), &part.detection);
        let episodes = counted(part.episodes, "episode");
        _ = writeln!(text, "  {what} ({episodes}): {found}");
    }
    text
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::composer::{FoundBy, TaskSpec};

    #[test]
    fn the_last_task_alone_goes_with_the_model_of_the_composition() {
        let task = |name: &str| {
            let spec = TaskSpec::new(name, format!("graphs/{name}"));
            let spec = spec.subgoal("reached", FoundBy::End);
            spec.resolve(Path::new("")).expect("a sound task")
        };
        let whole = Composition::builder("both")
            .task(task("first"))
            .task(task("second"))
            .model("out/model")
            .build()
            .expect("a sound composition");
        let alone = last_alone(&whole).expect("the model is that of the whole");
        assert_eq!(alone.automaton.tasks(), ["second"]);
        assert_eq!(alone.model, Path::new("out/model"));
    }
}
