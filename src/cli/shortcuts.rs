use std::fmt::Write as _;

use serde::Serialize;

use super::arguments::{Arguments, EvaluateArguments, PlannerArgument};
use super::error::CliError;
use super::evaluate::{bedroom, episodes, options};
use super::loaded::Loaded;
use super::record::bedroom_task;
use crate::experiment::{ScoredBedroom, ShortcutDetection, Skipper, Watched};
use crate::planner::{Planner, PlannerOptions};
use crate::rollout::{Monitor, Rollout};
use crate::simulator::{Bedroom, BedroomConfig, BedroomTask};
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
    let last = loaded.composition.automaton.tasks().last().cloned();
    let alone = Loaded::load(&last.unwrap_or_default(), arguments)?;
    let tasks = loaded.composition.automaton.tasks().iter();
    let tasks = tasks.map(|task| bedroom_task(task));
    let stage = Stage {
        bedroom: bedroom(&loaded, evaluate_arguments)?,
        in_order: loaded.planner(loaded.composition.planner.clone())?,
        papers_way: loaded.planner(PlannerOptions::paper())?,
        last_task: alone.planner(options(&alone, evaluate_arguments.planner))?,
        loaded: &loaded,
        alone: &alone,
        tasks: tasks.collect::<Result<_, _>>()?,
        nearest_states: evaluate_arguments.nearest_states,
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

/// What all episodes share.
struct Stage<'a> {
    bedroom: BedroomConfig,
    in_order: Planner,
    papers_way: Planner,
    last_task: Planner,
    loaded: &'a Loaded,
    alone: &'a Loaded,
    tasks: Vec<BedroomTask>,
    nearest_states: Option<usize>,
}

impl Stage<'_> {
    fn episode(&self, seed: u64, drive: Drive) -> Result<ShortcutEpisode, CliError> {
        let (driver, planner) = match drive {
            Drive::InOrder | Drive::Skipper => (self.loaded, &self.in_order),
            Drive::PapersWay => (self.loaded, &self.papers_way),
            Drive::LastTask => (self.alone, &self.last_task),
        };
        let options = driver.rollout_options(self.nearest_states);
        let mut watched = Watched::new(Monitor::new(
            self.loaded.rollout_model(),
            &self.in_order,
            &options,
        )?);
        let automaton = &self.loaded.composition.demonstrated_automaton();
        let mut room = ScoredBedroom::new(Bedroom::new(self.bedroom), automaton);
        let steps = if drive == Drive::Skipper {
            let skipper = Skipper::new(self.tasks.clone(), seed);
            skipper.drive(&mut room, options.max_steps, |seen| watched.look(seen))?
        } else {
            let mut rollout = Rollout::new(driver.rollout_model(), planner.clone(), options)?;
            rollout.run(&mut room, seed, &mut watched)?.steps
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
