use std::fs;

use rayon::prelude::*;

use super::arguments::{LevelArgument, PracticeArgument, RecordArguments};
use super::error::CliError;
use super::progress;
use crate::simulator::{
    Bedroom, BedroomConfig, BedroomTask, Demonstration, Habits, LONGEST_STEPS, Leftovers, Level,
    Practice, demonstrate_on,
};
use crate::storage::{RecordingMetadata, write_trajectory};
use crate::wording::counted;

/// Keeps the episodes of demonstrations apart from those of evaluations, whose seeds are used as they
/// are: attempt `k` of `record --seed s` is the episode of seed `s * 1,000,000 + k`.
const SEEDS_A_RECORDING: u64 = 1_000_000;
/// Note in a recording's metadata: which kind of episodes it is one of, as JSON.
pub(super) const BEDROOM_NOTE: &str = "bedroom";
/// Attempts for each demonstration that is wanted, before it is given up.
const ATTEMPTS_A_DEMO: usize = 20;

impl From<LevelArgument> for Level {
    fn from(argument: LevelArgument) -> Self {
        match argument {
            LevelArgument::Paper => Self::Paper,
            LevelArgument::Hard => Self::Hard,
        }
    }
}

/// The bedroom's task of that name.
pub(super) fn bedroom_task(name: &str) -> Result<BedroomTask, CliError> {
    BedroomTask::named(name).ok_or_else(|| CliError::UnknownTask {
        found: name.to_owned(),
        known: BedroomTask::ALL.map(BedroomTask::name).join(", "),
    })
}

/// `catena record`: attempts in the order of their seeds until enough have succeeded. What is there
/// from an earlier call counts, so a killed recording goes on and ends with the same files.
pub(super) fn record(arguments: &RecordArguments) -> Result<(), CliError> {
    let task = bedroom_task(&arguments.task)?;
    let config = BedroomConfig {
        level: arguments.level.into(),
        leftovers: if arguments.vary {
            Leftovers::Varied
        } else {
            Leftovers::AtStart
        },
        ..BedroomConfig::paper(task)
    };
    fs::create_dir_all(&arguments.out).map_err(|source| CliError::Io {
        path: arguments.out.clone(),
        source,
    })?;
    let bar = progress::bar("recording", arguments.demos as u64);
    let (mut recorded, mut attempts, mut found) = (0, 0, 0);
    let mut lengths = Vec::new();
    while recorded < arguments.demos {
        if attempts >= arguments.demos.max(1) * ATTEMPTS_A_DEMO {
            return Err(CliError::OperatorFails {
                task: arguments.task.clone(),
                recorded,
                attempts,
                wanted: arguments.demos,
            });
        }
        let wave = attempts..attempts + rayon::current_num_threads().min(8);
        attempts = wave.end;
        let tried: Vec<Attempt> = wave
            .into_par_iter()
            .map(|k| attempt(arguments, task, config, k as u64))
            .collect::<Result<_, CliError>>()?;
        for attempt in tried {
            if recorded < arguments.demos {
                match attempt {
                    Attempt::Failed => continue,
                    Attempt::Known => found += 1,
                    Attempt::Succeeded(seed, demonstration) => {
                        lengths.push(demonstration.trajectory.steps.len());
                        keep(arguments, config, seed, &demonstration)?;
                    }
                }
                recorded += 1;
                bar.set_position(recorded as u64);
            }
        }
    }
    bar.finish_and_clear();
    lengths.sort_unstable();
    let steps = match (lengths.first(), lengths.last()) {
        (Some(least), Some(most)) => format!(
            "; {least} to {most} steps, median {}",
            lengths[lengths.len() / 2]
        ),
        _ => String::new(),
    };
    println!(
        "{} of {} in {} ({found} from before, {}{steps})",
        counted(
            recorded,
            match arguments.practice {
                Some(PracticeArgument::Dry) => "dry run",
                Some(PracticeArgument::Askew) => "askew run",
                None => "demonstration",
            }
        ),
        arguments.task,
        arguments.out.display(),
        counted(attempts, "attempt"),
    );
    Ok(())
}

enum Attempt {
    /// Its file is there.
    Known,
    Failed,
    Succeeded(u64, Box<Demonstration>),
}

fn attempt(
    arguments: &RecordArguments,
    task: BedroomTask,
    config: BedroomConfig,
    number: u64,
) -> Result<Attempt, CliError> {
    let seed = arguments.seed * SEEDS_A_RECORDING + number;
    if arguments.out.join(file_name(task, seed)).is_file() {
        return Ok(Attempt::Known);
    }
    let mut bedroom = Bedroom::new(config);
    bedroom.arrange(seed);
    let habits = Habits {
        practice: arguments.practice.map(|practice| match practice {
            PracticeArgument::Dry => Practice::Dry,
            PracticeArgument::Askew => Practice::Askew,
        }),
        ..Habits::default()
    };
    let demonstration = demonstrate_on(&mut bedroom, task, habits, seed)?;
    let steps = demonstration.trajectory.steps.len();
    // Nothing is to come of practice; only what got stuck is left out.
    let is_wanted = if arguments.practice.is_some() {
        steps < LONGEST_STEPS
    } else {
        demonstration.succeeded && (40..=100).contains(&steps)
    };
    Ok(if is_wanted {
        Attempt::Succeeded(seed, Box::new(demonstration))
    } else {
        Attempt::Failed
    })
}

fn keep(
    arguments: &RecordArguments,
    config: BedroomConfig,
    seed: u64,
    demonstration: &Demonstration,
) -> Result<(), CliError> {
    let task = bedroom_task(&demonstration.trajectory.task)?;
    let metadata = RecordingMetadata {
        robot: "LoCoBot (simulated)".to_owned(),
        seed: Some(seed),
        // Practice neither succeeds nor fails.
        success: arguments.practice.is_none().then_some(true),
        notes: [(BEDROOM_NOTE.to_owned(), serde_json::to_string(&config)?)].into(),
    };
    let path = arguments.out.join(file_name(task, seed));
    write_trajectory(&path, &demonstration.trajectory, &metadata)?;
    Ok(())
}

fn file_name(task: BedroomTask, seed: u64) -> String {
    format!("{}_{seed:08}.mcap", task.name())
}
