use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::thread;

use serde::de::DeserializeOwned;

use super::method::{MVP, Method};
use super::plan::Size;
use super::side_by_side::side_by_side;
use crate::cli::arguments::{Arguments, EngineArgument, PaperArguments};
use crate::cli::error::CliError;
use crate::cli::kept::{Missing, keep_text, kept};
use crate::cli::revision::revision;
use crate::experiment::PAPER_TASKS;
use crate::model::sha256_hex;
use crate::storage::{ReadOptions, Recordings, sha256_file, write_file};

/// Seed with which demonstrations are recorded, those of README.md.
const RECORDING_SEED: u64 = 1;
/// How a command is told with how many threads it computes.
const THREADS: &str = "RAYON_NUM_THREADS";
/// Networks that learnt otherwise, the last states of a demonstration less than others, are not these.
const OF_MEMORY: &str = "every state counts alike";
/// Digits of a digest that tell folders apart.
const MARK_DIGITS: usize = 8;
/// Lines of a log that are shown of a command that failed.
const LAST_LINES: usize = 12;
/// Recordings of each task that are made; experiments take the first of them.
const RECORDED: usize = 30;

/// Where an experiment makes what it measures: recordings, and a folder with tasks, recordings, model and
/// graphs for each method and number of demonstrations. Everything is made by this program's own commands,
/// which are shown, so that each can be repeated by hand.
pub(super) struct Workshop<'a> {
    paper: &'a PaperArguments,
    arguments: &'a Arguments,
    work: PathBuf,
    executable: PathBuf,
    /// How many jobs run beside each other.
    at_once: usize,
    /// Held by the job that records.
    recording: Mutex<()>,
    /// What the recordings of each task are: how they are recorded, or the SHA-256 of those that were given. Empty
    /// where nothing is measured, as are the other two.
    recordings: Vec<String>,
    /// SHA-256 of the file of each task.
    tasks: Vec<String>,
    /// SHA-256 of the encoder that somebody else trained, and of what is said beside it.
    encoder: Vec<String>,
    /// How methods with a memory learn, which their flags do not tell.
    of_memory: Vec<String>,
    /// The commit of the working tree, if it is one.
    pub(super) commit: Option<String>,
}

/// A trained method.
pub(super) struct Trained {
    /// The folder that paths in its tasks are relative to.
    pub(super) root: PathBuf,
    /// Its model.
    pub(super) model: PathBuf,
    /// Checkpoints and losses.
    pub(super) run: PathBuf,
}

impl<'a> Workshop<'a> {
    pub(super) fn open(
        paper: &'a PaperArguments,
        arguments: &'a Arguments,
    ) -> Result<Self, CliError> {
        let executable = std::env::current_exe().map_err(io(Path::new("the program itself")))?;
        let (mut recordings, mut tasks, mut encoder) = (Vec::new(), Vec::new(), Vec::new());
        if !paper.only_draw {
            let files = PAPER_TASKS.map(|task| arguments.root.join(task_file(task)));
            for file in &files {
                tasks.push(sha256_file(file)?);
            }
            recordings = recordings_told(paper)?;
            if let Some(file) = &paper.frozen_encoder {
                encoder.push(sha256_file(file)?);
                let beside = file.with_extension("json");
                if beside.exists() {
                    encoder.push(sha256_file(&beside)?);
                }
            }
        }
        Ok(Self {
            recordings,
            tasks,
            encoder,
            of_memory: vec![OF_MEMORY.to_owned()],
            commit: revision(&arguments.root),
            paper,
            arguments,
            work: std::path::absolute(&paper.work).map_err(io(&paper.work))?,
            executable,
            at_once: paper.jobs.get(),
            recording: Mutex::new(()),
        })
    }

    /// What a method learns from and is measured on, for digests.
    pub(super) fn ingredients(&self, method: &Method) -> [&[String]; 3] {
        [&self.recordings, &self.tasks, self.particulars(method)]
    }

    /// A cell that may not be replaced.
    pub(super) fn kept<T: DeserializeOwned>(&self, file: &Path) -> Result<Option<T>, CliError> {
        if self.paper.replace {
            return Ok(None);
        }
        kept(file)
    }

    /// A cell that is to be measured; none where it is there already.
    pub(super) fn missing<T: DeserializeOwned>(
        &self,
        file: PathBuf,
        digest: String,
    ) -> Result<Option<Missing>, CliError> {
        Missing::unless_kept::<T>(file, digest, self.paper.replace)
    }

    /// What one method learns from beside recordings, or how.
    fn particulars(&self, method: &Method) -> &[String] {
        if method.name == MVP {
            &self.encoder
        } else if method.has_memory {
            &self.of_memory
        } else {
            &[]
        }
    }

    /// A mark in a folder's name of what a method learns from and how, where its name does not tell: what is made
    /// otherwise lies beside it. None of what this program records.
    fn mark(&self, method: &Method) -> Result<String, CliError> {
        let recordings: &[String] = match self.paper.demos {
            Some(_) => &self.recordings,
            None => &[],
        };
        let given = [recordings, self.particulars(method)];
        if given.concat().is_empty() {
            return Ok(String::new());
        }
        let digest = sha256_hex(&serde_json::to_vec(&given)?);
        Ok(format!("_{}", &digest[..MARK_DIGITS]))
    }

    /// Does each job, as many beside each other as was asked for.
    pub(super) fn side_by_side<J: Send>(
        &self,
        jobs: impl IntoIterator<Item = J, IntoIter: Send>,
        work: impl Fn(J) -> Result<(), CliError> + Sync,
    ) -> Result<(), CliError> {
        side_by_side(jobs, self.at_once, work)
    }

    /// For work whose time counts.
    pub(super) fn one_after_the_other(&mut self) {
        self.at_once = 1;
    }

    /// Whether a method can be trained at all; says why not.
    pub(super) fn can_train(&self, method: &Method) -> bool {
        if method.name == MVP && self.paper.frozen_encoder.is_none() {
            println!(
                "{}: left out, it needs an image encoder that somebody else trained (--frozen-encoder FILE.onnx)",
                method.described
            );
            return false;
        }
        true
    }

    /// A method trained on the first recordings of each task, with a graph of each task where it plans.
    pub(super) fn trained(
        &self,
        method: &Method,
        demonstrations: usize,
        size: &Size,
        seed: u64,
        with_graphs: bool,
    ) -> Result<Trained, CliError> {
        let steps = size.steps_of(method);
        let (name, mark) = (method.name, self.mark(method)?);
        let name = format!("{name}_{demonstrations}{mark}_seed{seed}_steps{steps}");
        let root = self.work.join(name);
        self.furnish(&root, demonstrations)?;
        let model = root.join(if method.plans {
            "graphs/bedroom/model"
        } else {
            "policy"
        });
        let trained = Trained {
            run: root.join("run"),
            model,
            root,
        };
        self.train(method, &trained, &size.training(method, seed))?;
        if method.plans && with_graphs {
            for task in PAPER_TASKS {
                let mut command: Vec<OsString> = vec![
                    "graph".into(),
                    "build".into(),
                    trained.root.join(task_file(task)).into(),
                    "--model".into(),
                    trained.model.clone().into(),
                    "--root".into(),
                    trained.root.clone().into(),
                ];
                command.extend(method.building().iter().map(OsString::from));
                self.run(&command, Some(&trained))?;
            }
        }
        Ok(trained)
    }

    fn train(&self, method: &Method, trained: &Trained, words: &[String]) -> Result<(), CliError> {
        let note = trained.root.join("trained.txt");
        let told = words.join(" ");
        let is_done = fs::read_to_string(&note).is_ok_and(|text| text == told)
            && trained.model.join("manifest.json").exists();
        if is_done {
            return Ok(());
        }
        // A run of other words is of no use; one of the same words goes on.
        let begun = trained.root.join("begun.txt");
        if fs::read_to_string(&begun).is_ok_and(|text| text != told) && trained.run.exists() {
            fs::remove_dir_all(&trained.run).map_err(io(&trained.run))?;
        }
        keep_text(&begun, told.as_bytes())?;
        let mut command: Vec<OsString> = vec!["train".into()];
        command.extend(PAPER_TASKS.map(|task| trained.root.join("demos").join(task).into()));
        command.extend(words.iter().map(OsString::from));
        if let (MVP, Some(encoder)) = (method.name, &self.paper.frozen_encoder) {
            command.extend(["--frozen-encoder".into(), encoder.into()]);
        }
        command.extend([
            "--resume".into(),
            "--run".into(),
            trained.run.clone().into(),
        ]);
        command.extend(["--out".into(), trained.model.clone().into()]);
        self.run(&command, Some(trained))?;
        keep_text(&note, told.as_bytes())
    }

    /// Puts tasks and the first recordings of each into a folder.
    fn furnish(&self, root: &Path, demonstrations: usize) -> Result<(), CliError> {
        for task in PAPER_TASKS {
            let (file, place) = (task_file(task), root.join(task_file(task)));
            let file = self.arguments.root.join(file);
            keep_text(&place, &fs::read(&file).map_err(io(&file))?)?;
            let from = self.recordings(task, demonstrations)?;
            let folder = root.join("demos").join(task);
            fs::create_dir_all(&folder).map_err(io(&folder))?;
            for recording in &from[..demonstrations] {
                let name = recording.file_name().unwrap_or_default();
                copied(recording, &folder.join(name))?;
            }
        }
        Ok(())
    }

    /// The recordings of a task, in order, at least so many.
    fn recordings(&self, task: &str, wanted: usize) -> Result<Vec<PathBuf>, CliError> {
        let given = self.paper.demos.as_ref().map(|folder| folder.join(task));
        let folder = given
            .clone()
            .unwrap_or_else(|| self.work.join("demos").join(task));
        let _one_records = self.recording.lock().expect("no one panics with it");
        if given.is_none() && files_of(&folder).len() < wanted {
            let count = wanted.max(if self.paper.quick { 0 } else { RECORDED });
            let command = [
                "record".into(),
                task.into(),
                "--demos".into(),
                count.to_string().into(),
                "--seed".into(),
                RECORDING_SEED.to_string().into(),
                "--vary".into(),
                "--out".into(),
                folder.clone().into(),
            ];
            self.run(&command, None)?;
        }
        let files = files_of(&folder);
        if files.len() < wanted {
            return Err(CliError::TooFewRecordings {
                folder,
                task: task.to_owned(),
                found: files.len(),
                wanted,
            });
        }
        Ok(files)
    }

    /// Runs a command of this program that makes a part of what is trained, or what all share; what it prints is shown
    /// or goes to a log.
    fn run(&self, words: &[OsString], part_of: Option<&Trained>) -> Result<(), CliError> {
        let log = part_of.and_then(|trained| self.log_of(trained));
        let mut command = self.command(words, log.as_deref(), None)?;
        if let Some(log) = &log {
            command.stdout(end_of(log)?);
        }
        let status = command.status().map_err(io(&self.executable))?;
        if status.success() {
            return Ok(());
        }
        Err(CliError::ExperimentStep {
            command: shown(words),
            status: status.to_string(),
            said: last_words(log.as_deref()),
        })
    }

    /// Runs a command on what was trained and reads the JSON that it prints; its progress is shown or goes to a log.
    pub(super) fn json<T: DeserializeOwned>(
        &self,
        trained: &Trained,
        words: &[OsString],
        engine: Option<&str>,
    ) -> Result<T, CliError> {
        let log = self.log_of(trained);
        let mut command = self.command(words, log.as_deref(), engine)?;
        let output = command.output().map_err(io(&self.executable))?;
        let failed = |said: String| CliError::ExperimentStep {
            command: shown(words),
            status: output.status.to_string(),
            said,
        };
        if !output.status.success() {
            return Err(failed(last_words(log.as_deref())));
        }
        serde_json::from_slice(&output.stdout)
            .map_err(|e| failed(format!("\nit printed no JSON of the kind: {e}")))
    }

    /// Where commands on what is trained print to; `None` for the terminal, which belongs to a single job.
    fn log_of(&self, trained: &Trained) -> Option<PathBuf> {
        (self.at_once > 1).then(|| trained.root.join("log.txt"))
    }

    /// A command of this program, which is shown. Its progress is, too, or goes to a log where it runs beside others;
    /// there it computes with its share of the processors only, since threads that wait for one another cost more than
    /// they bring. Results do not depend on it. The engine is that of this call where none is named.
    fn command(
        &self,
        words: &[OsString],
        log: Option<&Path>,
        engine: Option<&str>,
    ) -> Result<Command, CliError> {
        println!("$ {}", shown(words));
        let mut command = Command::new(&self.executable);
        command.args(words);
        let of_call = match self.arguments.engine {
            EngineArgument::Auto => None,
            EngineArgument::Native => Some("native"),
            EngineArgument::Embedded => Some("embedded"),
        };
        if let Some(engine) = engine.or(of_call) {
            command.args(["--engine", engine]);
        }
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
}

fn recordings_told(paper: &PaperArguments) -> Result<Vec<String>, CliError> {
    let told = |task: &str| match &paper.demos {
        None => Ok(format!("recorded with seed {RECORDING_SEED}, varied")),
        Some(folder) => {
            let recordings = Recordings::open(&[folder.join(task)], &ReadOptions::default())?;
            Ok(recordings.digest()?)
        }
    };
    PAPER_TASKS.into_iter().map(told).collect()
}

/// The words that evaluate a trained method on a task.
pub(super) fn evaluation(
    method: &Method,
    trained: &Trained,
    task: &str,
    size: &Size,
) -> Vec<OsString> {
    let mut words: Vec<OsString> = vec!["evaluate".into(), task.into()];
    if !method.plans {
        words.extend(["--policy".into(), trained.model.clone().into()]);
    }
    words.extend(["--root".into(), trained.root.clone().into()]);
    words.extend(["--episodes".into(), size.episodes.to_string().into()]);
    words.extend(["--seed".into(), size.seed.to_string().into()]);
    words.extend(method.running().iter().map(OsString::from));
    words.push("--json".into());
    words
}

/// A command as it would be typed.
pub(super) fn shown(words: &[OsString]) -> String {
    let words: Vec<_> = words.iter().map(|w| w.to_string_lossy()).collect();
    format!("catena {}", words.join(" "))
}

/// The recordings of a folder, sorted by name.
fn files_of(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|e| e == "mcap"))
        .collect();
    files.sort_unstable();
    files
}

/// Where a task is described, below the root.
fn task_file(task: &str) -> String {
    format!("tasks/{task}.yaml")
}

/// Puts a file that never changes in another place, without a second copy of its contents where the file system can.
fn copied(from: &Path, to: &Path) -> Result<(), CliError> {
    if to.exists() || fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    let mut file = File::open(from).map_err(io(from))?;
    Ok(write_file(to, |copy| {
        std::io::copy(&mut file, copy).map(|_| ())
    })?)
}

/// A log, opened to be written on.
fn end_of(log: &Path) -> Result<File, CliError> {
    let file = File::options().create(true).append(true).open(log);
    file.map_err(io(log))
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

fn io(path: &Path) -> impl FnOnce(std::io::Error) -> CliError {
    let path = path.to_owned();
    move |source| CliError::Io { path, source }
}
