//! An experiment's steps, run as commands of this program.

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;

use serde::de::DeserializeOwned;

use crate::cli::arguments::EngineArgument;
use crate::cli::error::CliError;
use crate::cli::parent;

/// How a command is told with how many threads it computes.
const THREADS: &str = "RAYON_NUM_THREADS";
/// Lines of a log that are shown of a command that failed.
const LAST_LINES: usize = 12;

/// This program, whose commands are shown so that each can be repeated by hand. What they print is shown, too, or
/// goes to a log in a folder where they run beside others. They end with this process, also where it is killed.
pub(super) struct Commands {
    executable: PathBuf,
    /// The engine of those for which none is named.
    engine: Option<&'static str>,
    /// How many run beside each other.
    pub(super) at_once: usize,
}

impl Commands {
    pub(super) fn new(at_once: usize, engine: EngineArgument) -> Result<Self, CliError> {
        Ok(Self {
            executable: std::env::current_exe()
                .map_err(CliError::io(Path::new("the program itself")))?,
            engine: engine_name(engine),
            at_once,
        })
    }

    /// Runs a command that makes a part of what lies in a folder, or what all share.
    pub(super) fn run(&self, words: &[OsString], folder: Option<&Path>) -> Result<(), CliError> {
        let log = folder.and_then(|folder| self.log_in(folder));
        let mut command = self.command(words, log.as_deref(), None)?;
        if let Some(log) = &log {
            command.stdout(end_of(log)?);
        }
        let status = parent::status(&mut command).map_err(CliError::io(&self.executable))?;
        if status.success() {
            return Ok(());
        }
        Err(CliError::ExperimentStep {
            command: self.shown(words, None),
            status: status.to_string(),
            said: last_words(log.as_deref()),
        })
    }

    /// Runs a command on what lies in a folder and reads the JSON that it prints.
    pub(super) fn json<T: DeserializeOwned>(
        &self,
        words: &[OsString],
        folder: &Path,
        engine: Option<&str>,
    ) -> Result<T, CliError> {
        let log = self.log_in(folder);
        let mut command = self.command(words, log.as_deref(), engine)?;
        let output = parent::output(&mut command).map_err(CliError::io(&self.executable))?;
        let failed = |said: String| CliError::ExperimentStep {
            command: self.shown(words, engine),
            status: output.status.to_string(),
            said,
        };
        if !output.status.success() {
            return Err(failed(last_words(log.as_deref())));
        }
        serde_json::from_slice(&output.stdout)
            .map_err(|e| failed(format!("\nit printed no JSON of the kind: {e}")))
    }

    /// Where commands print to; `None` for the terminal, which belongs to a single job.
    fn log_in(&self, folder: &Path) -> Option<PathBuf> {
        (self.at_once > 1).then(|| folder.join("log.txt"))
    }

    /// A command, which is shown. Beside others it computes with its share of the processors only, since threads that
    /// wait for one another cost more than they bring. Results do not depend on it.
    fn command(
        &self,
        words: &[OsString],
        log: Option<&Path>,
        engine: Option<&str>,
    ) -> Result<Command, CliError> {
        println!("$ {}", self.shown(words, engine));
        let mut command = Command::new(&self.executable);
        command.args(self.with_engine(words, engine));
        let Some(log) = log else {
            command.stderr(Stdio::inherit());
            return Ok(command);
        };
        command.stderr(end_of(log)?);
        if std::env::var_os(THREADS).is_none() {
            let processors = thread::available_parallelism().map_or(1, usize::from);
            command.env(THREADS, (processors / self.at_once).max(1).to_string());
        }
        Ok(command)
    }

    /// A command as it would be typed.
    pub(super) fn shown(&self, words: &[OsString], engine: Option<&str>) -> String {
        let words = self.with_engine(words, engine);
        let words: Vec<String> = (words.iter())
            .map(|word| quoted(&word.to_string_lossy()))
            .collect();
        format!("catena {}", words.join(" "))
    }

    /// A command with the engine that it names, if it names one.
    fn with_engine(&self, words: &[OsString], engine: Option<&str>) -> Vec<OsString> {
        let mut words = words.to_vec();
        if let Some(engine) = engine.or(self.engine) {
            words.extend(["--engine".into(), engine.into()]);
        }
        words
    }
}

/// An engine as `--engine` names it; none where whichever is found is taken.
pub(super) fn engine_name(engine: EngineArgument) -> Option<&'static str> {
    match engine {
        EngineArgument::Auto => None,
        EngineArgument::Native => Some("native"),
        EngineArgument::Embedded => Some("embedded"),
    }
}

/// A word as a shell takes it for one: in quotes where it has more than letters, digits and what paths are made of.
pub(super) fn quoted(word: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "_-+=./,:@%".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// A log, opened to be written on.
fn end_of(log: &Path) -> Result<File, CliError> {
    let file = File::options().create(true).append(true).open(log);
    file.map_err(CliError::io(log))
}

/// The last lines of a log, after a line break; nothing where it was all shown.
fn last_words(log: Option<&Path>) -> String {
    let Some(log) = log else {
        return String::new();
    };
    let text = fs::read_to_string(log).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    let last = lines[lines.len().saturating_sub(LAST_LINES)..].join("\n");
    format!("\nthe end of {}:\n{last}", log.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_shown_as_a_shell_takes_it() {
        let commands = Commands::new(1, EngineArgument::Native).unwrap();
        let shown = |path: &str| {
            let words = ["evaluate", "sock", "--root", path].map(OsString::from);
            commands.shown(&words, None)
        };
        let plain = "/work/out/ours_10_seed1_steps4400";
        assert_eq!(
            shown(plain),
            format!("catena evaluate sock --root {plain} --engine native")
        );
        assert_eq!(
            shown("/home/a b/Ann's $work"),
            r"catena evaluate sock --root '/home/a b/Ann'\''s $work' --engine native"
        );
    }
}
