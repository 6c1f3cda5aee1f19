use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::arguments::{LevelArgument, PracticeArgument, RecordArguments};
use super::error::CliError;
use super::progress;
use crate::simulator::{
    Bedroom, BedroomConfig, BedroomTask, Demonstration, Habits, LONGEST_STEPS, Leftovers, Level,
    Practice, demonstrate_on,
};
use crate::storage::{PRACTICE_NOTE, RecordingMetadata, inspect, write_trajectory};
use crate::wording::counted;

/// Keeps the episodes of demonstrations apart from those of evaluations, whose seeds are used as they
/// are: attempt `k` of `record --seed s` is the episode of seed `s * 1,000,000 + k`.
const SEEDS_A_RECORDING: u64 = 1_000_000;
/// Note in a recording's metadata: which kind of episodes it is one of, as JSON.
pub(super) const BEDROOM_NOTE: &str = "bedroom";
/// Of practice that was recorded before its kind was noted.
const UNKNOWN_PRACTICE: &str = "unknown";
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

impl PracticeArgument {
    /// As the command line and a recording's metadata call it.
    const fn name(self) -> &'static str {
        match self {
            Self::Dry => "dry",
            Self::Askew => "askew",
        }
    }
}

/// `catena record`: attempts in the order of their seeds until enough have succeeded. What is there
/// from an earlier call of the same flags counts, so a killed recording goes on and ends with the same files.
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
    episode_seed(arguments.seed, 0)?;
    fs::create_dir_all(&arguments.out).map_err(CliError::io(&arguments.out))?;
    check_earlier(arguments, task, &config)?;
    let bar = progress::bar("recording", arguments.demos as u64);
    let (mut recorded, mut attempts, mut found) = (0, 0, 0);
    let mut lengths = Vec::new();
    while recorded < arguments.demos {
        if attempts >= arguments.demos.max(1).saturating_mul(ATTEMPTS_A_DEMO) {
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

/// The seed of an attempt's episode.
fn episode_seed(seed: u64, attempt: u64) -> Result<u64, CliError> {
    let first = seed.checked_mul(SEEDS_A_RECORDING);
    let seed_of_attempt = first.and_then(|first| first.checked_add(attempt));
    seed_of_attempt.ok_or(CliError::SeedTooLarge {
        seed,
        most: u64::MAX / SEEDS_A_RECORDING - 1,
    })
}

/// Checks that what is there of this recording was recorded with the same flags, before anything is added to it.
fn check_earlier(
    arguments: &RecordArguments,
    task: BedroomTask,
    config: &BedroomConfig,
) -> Result<(), CliError> {
    let failed = CliError::io(&arguments.out);
    let mut earlier: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(&arguments.out).map_err(&failed)? {
        let path = entry.map_err(&failed)?.path();
        let name = path.file_name().and_then(|name| name.to_str());
        let seed = name.and_then(|name| seed_of_file(task, name));
        if seed.is_some_and(|seed| seed / SEEDS_A_RECORDING == arguments.seed) && path.is_file() {
            earlier.push(path);
        }
    }
    earlier.sort_unstable();
    let check = |path: &PathBuf| check_alike(path, config, arguments.practice).err();
    earlier.par_iter().find_map_first(check).map_or(Ok(()), Err)
}

/// Checks that a recording is of the bedroom and the practice that are asked for.
fn check_alike(
    path: &Path,
    config: &BedroomConfig,
    practice: Option<PracticeArgument>,
) -> Result<(), CliError> {
    let metadata = inspect(path)?.metadata;
    let note = metadata.get(BEDROOM_NOTE).map(String::as_str);
    let noted = note.and_then(|note| serde_json::from_str::<BedroomConfig>(note).ok());
    // Every demonstration says that it succeeded, practice neither that nor that it failed.
    let is_practice = !metadata.contains_key("success");
    let kind = metadata.get(PRACTICE_NOTE).map(String::as_str);
    let kind = kind.or(is_practice.then_some(UNKNOWN_PRACTICE));
    let wanted = practice.map(PracticeArgument::name);
    // Recordings of before the note was written do not tell of which bedroom they are.
    let is_same_bedroom = note.is_none() || noted.as_ref() == Some(config);
    let is_same_kind = kind == wanted || (kind == Some(UNKNOWN_PRACTICE) && wanted.is_some());
    if is_same_bedroom && is_same_kind {
        return Ok(());
    }
    Err(CliError::RecordedOtherwise {
        file: path.to_owned(),
        found: described(note.unwrap_or("unknown"), kind),
        wanted: described(&serde_json::to_string(config)?, wanted),
    })
}

/// What sets recordings of one seed apart, for people.
fn described(bedroom: &str, practice: Option<&str>) -> String {
    format!(
        "bedroom {bedroom} with practice {}",
        practice.unwrap_or("none")
    )
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
    let seed = episode_seed(arguments.seed, number)?;
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
    let mut notes = vec![(BEDROOM_NOTE, serde_json::to_string(&config)?)];
    let practice = arguments.practice.map(PracticeArgument::name);
    notes.extend(practice.map(|practice| (PRACTICE_NOTE, practice.to_owned())));
    let notes = notes.into_iter();
    let metadata = RecordingMetadata {
        robot: "LoCoBot (simulated)".to_owned(),
        seed: Some(seed),
        // Practice neither succeeds nor fails.
        success: arguments.practice.is_none().then_some(true),
        notes: notes.map(|(name, note)| (name.to_owned(), note)).collect(),
    };
    let path = arguments.out.join(file_name(task, seed));
    write_trajectory(&path, &demonstration.trajectory, &metadata)?;
    Ok(())
}

fn file_name(task: BedroomTask, seed: u64) -> String {
    format!("{}_{seed:08}.mcap", task.name())
}

/// The seed in the name of a task's recording.
fn seed_of_file(task: BedroomTask, name: &str) -> Option<u64> {
    let seed = name.strip_prefix(task.name())?.strip_prefix('_')?;
    seed.strip_suffix(".mcap")?.parse().ok()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::trajectory::{Action, ActionSpace, Image, Observation, Step, Trajectory};

    fn arguments(out: &Path, practice: Option<PracticeArgument>) -> RecordArguments {
        RecordArguments {
            task: "sock".to_owned(),
            demos: 1,
            seed: 3,
            out: out.to_owned(),
            level: LevelArgument::Paper,
            vary: false,
            practice,
        }
    }

    /// A demonstration of one step.
    fn demonstration() -> Demonstration {
        let image = Image::new(2, 2, vec![9_u8; 12]).unwrap();
        let step = Step {
            time_secs: 0.0,
            observation: Arc::new(Observation::new([("head".to_owned(), image)])),
            action: Action::Primitive(0),
        };
        Demonstration {
            trajectory: Trajectory {
                id: "demo".to_owned(),
                task: "sock".to_owned(),
                action_space: ActionSpace::Primitives {
                    names: vec!["terminate".to_owned()],
                },
                steps: vec![step],
                markers: Vec::new(),
            },
            succeeded: true,
        }
    }

    #[test]
    fn recordings_of_other_flags_do_not_count_as_these() {
        let config = BedroomConfig::paper(BedroomTask::Sock);
        let varied = BedroomConfig {
            leftovers: Leftovers::Varied,
            ..config
        };
        let hard = BedroomConfig {
            level: Level::Hard,
            ..config
        };
        let (dry, askew) = (Some(PracticeArgument::Dry), Some(PracticeArgument::Askew));
        for practice in [None, dry] {
            let folder = tempfile::tempdir().unwrap();
            let call = arguments(folder.path(), practice);
            keep(&call, config, 3_000_000, &demonstration()).unwrap();
            check_earlier(&call, BedroomTask::Sock, &config).unwrap();
            // Of another seed are other files.
            let another = RecordArguments {
                seed: 4,
                ..arguments(folder.path(), askew)
            };
            check_earlier(&another, BedroomTask::Sock, &hard).unwrap();
            let others = [
                (practice, varied),
                (practice, hard),
                (if practice == dry { None } else { dry }, config),
                (askew, config),
            ];
            for (practice, config) in others {
                let call = arguments(folder.path(), practice);
                let refused = check_earlier(&call, BedroomTask::Sock, &config).unwrap_err();
                let said = refused.to_string();
                for part in ["sock_03000000.mcap", "at_start", "practice", "--out"] {
                    assert!(said.contains(part), "{said}");
                }
            }
        }
    }

    #[test]
    fn practice_of_before_its_kind_was_noted_counts_as_practice_alone() {
        let folder = tempfile::tempdir().unwrap();
        let config = BedroomConfig::paper(BedroomTask::Sock);
        let path = folder.path().join(file_name(BedroomTask::Sock, 3_000_000));
        let metadata = RecordingMetadata {
            notes: [(
                BEDROOM_NOTE.to_owned(),
                serde_json::to_string(&config).unwrap(),
            )]
            .into(),
            ..RecordingMetadata::default()
        };
        write_trajectory(&path, &demonstration().trajectory, &metadata).unwrap();
        check_alike(&path, &config, Some(PracticeArgument::Askew)).unwrap();
        let refused = check_alike(&path, &config, None).unwrap_err().to_string();
        assert!(refused.contains("practice unknown"), "{refused}");
    }

    #[test]
    fn demonstrations_say_nothing_of_practice() {
        let folder = tempfile::tempdir().unwrap();
        let config = BedroomConfig::paper(BedroomTask::Sock);
        let call = arguments(folder.path(), None);
        keep(&call, config, 3_000_000, &demonstration()).unwrap();
        let path = folder.path().join("sock_03000000.mcap");
        let metadata = inspect(&path).unwrap().metadata;
        let names: Vec<&str> = metadata.keys().map(String::as_str).collect();
        let expected = [
            "bedroom",
            "catena_version",
            "robot",
            "seed",
            "steps",
            "success",
        ];
        assert_eq!(names, expected);
    }

    #[test]
    fn a_seed_without_room_for_its_attempts_is_refused() {
        let most = u64::MAX / SEEDS_A_RECORDING - 1;
        assert_eq!(episode_seed(3, 7).unwrap(), 3_000_007);
        assert!(episode_seed(most, SEEDS_A_RECORDING - 1).is_ok());
        let refused = episode_seed(u64::MAX / 2, 0).unwrap_err().to_string();
        assert!(refused.contains(&most.to_string()), "{refused}");
    }
}
