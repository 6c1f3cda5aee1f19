use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::method::Method;
use crate::cli::arguments::PaperArguments;
use crate::cli::error::CliError;
use crate::model::sha256_hex;

/// How large an experiment is.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Size {
    /// Numbers of demonstrations of each task.
    pub(super) demonstrations: Vec<usize>,
    /// Episodes of each method and task.
    pub(super) episodes: usize,
    /// Seed of the first episode.
    pub(super) seed: u64,
    /// Seed of the first training.
    pub(super) training_seed: u64,
    /// Trainings with different seeds.
    pub(super) seeds: u64,
    /// Steps of training of our way and its variants.
    pub(super) steps: u64,
    /// Steps of training of a baseline at most.
    pub(super) baseline_steps: u64,
    /// Whether it is the small version.
    pub(super) is_quick: bool,
}

/// Steps of a whole training; losses are flat by then.
const STEPS: u64 = 4_400;
const BASELINE_STEPS: u64 = 4_000;
const EPISODES: usize = 100;
/// Seed of the first episode.
const SEED: u64 = 100;
/// What fits into 20 minutes on 2 cores.
const QUICK_STEPS: u64 = 200;
const QUICK_EPISODES: usize = 4;
const QUICK_DEMONSTRATIONS: usize = 10;
/// The same where each pair of states costs an encoding.
const QUICK_COSTLY_EPISODES: usize = 1;
const QUICK_COSTLY_DEMONSTRATIONS: usize = 3;

impl Size {
    /// What is asked for; `demonstrations` and `seeds` are those of the paper.
    pub(super) fn new(arguments: &PaperArguments, demonstrations: &[usize], seeds: u64) -> Self {
        let quick = arguments.quick;
        let (steps, baseline_steps) = if quick {
            (QUICK_STEPS, QUICK_STEPS)
        } else {
            (STEPS, BASELINE_STEPS)
        };
        let few = [QUICK_DEMONSTRATIONS];
        let usual = if quick { &few[..] } else { demonstrations };
        Self {
            demonstrations: if arguments.demonstrations.is_empty() {
                usual.to_vec()
            } else {
                rising(&arguments.demonstrations)
            },
            episodes: episodes(arguments.episodes, quick),
            seed: arguments.seed.unwrap_or(SEED),
            training_seed: arguments.training_seed,
            seeds: if quick { 1 } else { seeds },
            steps: arguments.steps.unwrap_or(steps),
            baseline_steps: arguments.baseline_steps.unwrap_or(baseline_steps),
            is_quick: quick,
        }
    }

    /// The number of demonstrations of an experiment that has only one.
    pub(super) fn only_number(&self, experiment: &'static str) -> Result<usize, CliError> {
        match self.demonstrations[..] {
            [number] => Ok(number),
            ref several => Err(CliError::OneNumberOnly {
                experiment,
                found: (several.iter().map(usize::to_string))
                    .collect::<Vec<_>>()
                    .join(","),
            }),
        }
    }

    /// Steps of a method's training at most.
    pub(super) fn steps_of(&self, method: &Method) -> u64 {
        if method.plans {
            self.steps
        } else {
            self.baseline_steps
        }
    }

    /// The same for an experiment that runs networks for which each pair of states costs an encoding.
    pub(super) fn of_costly_networks(arguments: &PaperArguments, demonstrations: &[usize]) -> Self {
        let mut size = Self::new(arguments, demonstrations, 1);
        if arguments.quick && arguments.demonstrations.is_empty() {
            size.demonstrations = vec![QUICK_COSTLY_DEMONSTRATIONS];
        }
        if arguments.quick {
            size.episodes = arguments.episodes.unwrap_or(QUICK_COSTLY_EPISODES);
        }
        size
    }

    /// What `catena train` is told of a method's training, beside what goes in and where it goes out.
    pub(super) fn training(&self, method: &Method, seed: u64) -> Vec<String> {
        let steps = self.steps_of(method);
        let mut words: Vec<String> = ["--preset", "bedroom"].map(str::to_owned).to_vec();
        words.extend(method.flags.iter().map(|w| (*w).to_owned()));
        words.extend(["--steps".to_owned(), steps.to_string()]);
        words.extend(["--seed".to_owned(), seed.to_string()]);
        words
    }
}

/// A method's training as cells keep it: a command without the folder that it works in.
pub(super) fn training_command(words: &[String]) -> String {
    format!("catena train ... {}", words.join(" "))
}

/// Numbers in rising order, each once: two jobs must not work in one folder.
pub(super) fn rising(numbers: &[usize]) -> Vec<usize> {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

/// Episodes of a method: those that are asked for, or as many as a whole or a small version has.
pub(super) fn episodes(asked: Option<usize>, is_quick: bool) -> usize {
    let usual = if is_quick { QUICK_EPISODES } else { EPISODES };
    asked.unwrap_or(usual)
}

/// Where an experiment's cells go: a folder that is there, so that it is not missed after hours.
pub(super) fn out(arguments: &PaperArguments, name: &str) -> Result<PathBuf, CliError> {
    let out = place_of(arguments.out.as_deref(), arguments.quick, name);
    make(&out)?;
    Ok(out)
}

/// The same folder, which need not be there: the one that is asked for, or one of the experiment's name.
pub(super) fn place_of(asked: Option<&Path>, is_quick: bool, name: &str) -> PathBuf {
    let parent = if is_quick { "out/quick" } else { "results" };
    asked.map_or_else(|| Path::new(parent).join(name), Path::to_path_buf)
}

/// Makes a folder that is not there yet.
pub(super) fn make(folder: &Path) -> Result<(), CliError> {
    fs::create_dir_all(folder).map_err(CliError::io(folder))
}

/// A digest of what a cell depends on.
pub(super) fn digest(of: &impl Serialize) -> Result<String, CliError> {
    let version = env!("CARGO_PKG_VERSION");
    Ok(sha256_hex(&serde_json::to_vec(&(version, of))?))
}

/// A table, with what is said of the small version where it has figures of that.
pub(super) fn with_note(table: String, is_quick: bool) -> String {
    if is_quick {
        format!("{QUICK_NOTE}\n\n{table}")
    } else {
        table
    }
}

/// A plot's title, which says so, too.
pub(super) fn with_version(title: &str, is_quick: bool) -> String {
    let version = if is_quick { " (small version)" } else { "" };
    format!("{title}{version}")
}

/// What is said of the small version.
pub(super) const QUICK_NOTE: &str = "small version (--quick): few demonstrations and episodes, a training that \
     ends long before its losses do; it shows that everything runs, not how well it works";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_small_version_says_that_it_is_small() {
        assert_eq!(with_note("| |\n".to_owned(), false), "| |\n");
        assert_eq!(
            with_note("| |\n".to_owned(), true),
            format!("{QUICK_NOTE}\n\n| |\n")
        );
        assert_eq!(with_version("Rates", false), "Rates");
        assert_eq!(with_version("Rates", true), "Rates (small version)");
    }

    #[test]
    fn a_small_version_goes_elsewhere_and_has_few_episodes_unless_others_are_asked_for() {
        let places = [(None, true), (None, false), (Some(Path::new("mine")), true)];
        let places = places.map(|(asked, is_quick)| place_of(asked, is_quick, "table9"));
        assert_eq!(
            places,
            ["out/quick/table9", "results/table9", "mine"].map(PathBuf::from)
        );
        let counts = [(None, true), (None, false), (Some(7), true)];
        let counts = counts.map(|(asked, is_quick)| episodes(asked, is_quick));
        assert_eq!(counts, [QUICK_EPISODES, EPISODES, 7]);
    }

    #[test]
    fn a_number_that_is_named_twice_is_measured_once() {
        assert_eq!(rising(&[30, 10, 30]), [10, 30]);
    }
}
