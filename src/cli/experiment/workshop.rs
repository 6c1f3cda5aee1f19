use std::ffi::OsString;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use serde::de::DeserializeOwned;

use super::commands::Commands;
use super::digests::{Digests, digests_of, recordings_now};
use super::given::recordings_in;
use super::hold::{ensure_free, hold};
use super::ingredients::{Ingredients, RECORDING_SEED};
use super::method::{MVP, Method};
use super::plan::{Size, make};
use super::side_by_side::side_by_side;
use crate::cli::arguments::{Arguments, PaperArguments};
use crate::cli::error::CliError;
use crate::cli::kept::{Missing, keep_text};
use crate::cli::recipe::{Ingredient, Recipe};
use crate::cli::revision::revision;
use crate::experiment::PAPER_TASKS;
use crate::storage::{demonstrations_digest, write_file};

/// Recordings of each task that are made; experiments take the first of them.
const RECORDED: usize = 30;

/// Where an experiment makes what it measures: recordings, and a folder with tasks, recordings, model and
/// graphs for each method and number of demonstrations. Everything is made by this program's own commands,
/// which are shown, so that each can be repeated by hand.
pub(super) struct Workshop<'a> {
    paper: &'a PaperArguments,
    arguments: &'a Arguments,
    work: PathBuf,
    commands: Commands,
    /// Held by the job that records.
    recording: Mutex<()>,
    /// What methods learn from and are measured on.
    pub(super) ingredients: Ingredients,
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
        let ingredients = if paper.only_draw {
            Ingredients::default()
        } else {
            Ingredients::gather(paper, &arguments.root)?
        };
        Ok(Self {
            ingredients,
            commands: Commands::new(paper.jobs.get(), arguments.engine)?,
            commit: revision(&arguments.root),
            paper,
            arguments,
            work: std::path::absolute(&paper.work).map_err(CliError::io(&paper.work))?,
            recording: Mutex::new(()),
        })
    }

    /// Runs a command on what was trained and reads the JSON that it prints; its progress is shown or goes to a log.
    pub(super) fn json<T: DeserializeOwned>(
        &self,
        trained: &Trained,
        words: &[OsString],
        engine: Option<&str>,
    ) -> Result<T, CliError> {
        self.commands.json(words, &trained.root, engine)
    }

    /// A command on what was trained as it is kept: without the folder that it works in.
    pub(super) fn shown(
        &self,
        trained: &Trained,
        words: &[OsString],
        engine: Option<&str>,
    ) -> String {
        let root = trained.root.display().to_string();
        let words = words.iter().map(|word| word.to_string_lossy());
        let words = words.map(|word| OsString::from(word.replace(&root, "...")));
        let words: Vec<OsString> = words.collect();
        self.commands.shown(&words, engine)
    }

    /// A cell that is to be measured; none where it is there already.
    pub(super) fn missing<T: DeserializeOwned>(
        &self,
        file: PathBuf,
        digest: String,
        recipe: impl FnOnce() -> Result<Recipe, CliError>,
    ) -> Result<Option<Missing>, CliError> {
        Missing::unless_kept::<T>(file, digest, self.paper.replace, recipe)
    }

    /// The same where one of another number of episodes is kept, too.
    pub(super) fn missing_of_any_episodes<T: DeserializeOwned>(
        &self,
        file: PathBuf,
        episodes: usize,
        digest_of: impl Fn(usize) -> Result<String, CliError>,
        recipe: impl FnOnce() -> Result<Recipe, CliError>,
    ) -> Result<Option<Missing>, CliError> {
        let replace = self.paper.replace;
        Missing::unless_kept_of_any_episodes::<T>(file, episodes, digest_of, replace, recipe)
    }

    /// Digests of what a cell of a trained method was measured with.
    pub(super) fn digests(&self, method: &Method, trained: &Trained) -> Result<Digests, CliError> {
        digests_of(&trained.model, self.ingredients.encoder_of(method))
    }

    /// The first recordings of each task as cells name them; none of a task that has not so many yet.
    pub(super) fn recordings_now(&self, demonstrations: usize) -> Vec<Ingredient> {
        let of_task = |task: &str| {
            let recordings = match self.ingredients.given(task) {
                Some(given) => given.to_vec(),
                None => each_alone(recordings_in(&self.demos(task))),
            };
            let files = recordings.get(..demonstrations)?.concat();
            Some(recordings_now(task, demonstrations_digest(&files).ok()?))
        };
        PAPER_TASKS.into_iter().filter_map(of_task).collect()
    }

    /// Does each job, as many beside each other as was asked for.
    pub(super) fn side_by_side<J: Send>(
        &self,
        jobs: impl IntoIterator<Item = J>,
        work: impl Fn(J) -> Result<(), CliError> + Sync,
    ) -> Result<(), CliError> {
        side_by_side(jobs, self.commands.at_once, work)
    }

    /// For work whose time counts.
    pub(super) fn one_after_the_other(&mut self) {
        self.commands.at_once = 1;
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
        let trained = self.place(method, demonstrations, size, seed)?;
        let _alone = hold(&trained.root)?;
        self.furnish(&trained.root, demonstrations)?;
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
                command.extend(method.building.iter().map(OsString::from));
                self.commands.run(&command, Some(&trained.root))?;
            }
        }
        Ok(trained)
    }

    /// Where a method is trained; nothing need be there yet.
    pub(super) fn place(
        &self,
        method: &Method,
        demonstrations: usize,
        size: &Size,
        seed: u64,
    ) -> Result<Trained, CliError> {
        let steps = size.steps_of(method);
        let (name, mark) = (method.trained_as, self.ingredients.mark(method)?);
        let name = format!("{name}_{demonstrations}{mark}_seed{seed}_steps{steps}");
        let root = self.work.join(name);
        let model = root.join(if method.plans {
            "graphs/bedroom/model"
        } else {
            "policy"
        });
        Ok(Trained {
            run: root.join("run"),
            model,
            root,
        })
    }

    fn train(&self, method: &Method, trained: &Trained, words: &[String]) -> Result<(), CliError> {
        let note = trained.root.join("trained.txt");
        let told = words.join(" ");
        let is_done = fs::read_to_string(&note).is_ok_and(|text| text == told)
            && trained.model.join("manifest.json").exists();
        if is_done {
            return Ok(());
        }
        ensure_free(&trained.run)?;
        // A run of other words is of no use; one of the same words goes on.
        let begun = trained.root.join("begun.txt");
        if fs::read_to_string(&begun).is_ok_and(|text| text != told) && trained.run.exists() {
            fs::remove_dir_all(&trained.run).map_err(CliError::io(&trained.run))?;
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
        self.commands.run(&command, Some(&trained.root))?;
        keep_text(&note, told.as_bytes())
    }

    /// Puts tasks and the first recordings of each into a folder.
    fn furnish(&self, root: &Path, demonstrations: usize) -> Result<(), CliError> {
        for task in PAPER_TASKS {
            let (file, place) = (task_file(task), root.join(task_file(task)));
            let file = self.arguments.root.join(file);
            keep_text(&place, &fs::read(&file).map_err(CliError::io(&file))?)?;
            let given = self.demos(task);
            let from = self.recordings(task, demonstrations)?;
            let folder = root.join("demos").join(task);
            for file in from[..demonstrations].concat() {
                // A bag that has a folder of its own has one there, too.
                let name = Path::new(file.file_name().unwrap_or_default());
                let place = folder.join(file.strip_prefix(&given).unwrap_or(name));
                make(place.parent().unwrap_or(&folder))?;
                copied(&file, &place)?;
            }
        }
        Ok(())
    }

    /// The folder of a task's recordings.
    fn demos(&self, task: &str) -> PathBuf {
        let demos = self.paper.demos.clone();
        demos.unwrap_or_else(|| self.work.join("demos")).join(task)
    }

    /// The recordings of a task that count as demonstrations, each as its files, in order, at least so many.
    fn recordings(&self, task: &str, wanted: usize) -> Result<Vec<Vec<PathBuf>>, CliError> {
        let folder = self.demos(task);
        let recordings = match self.ingredients.given(task) {
            Some(given) => given.to_vec(),
            None => each_alone(self.recorded(task, &folder, wanted)?),
        };
        if recordings.len() < wanted {
            return Err(CliError::TooFewRecordings {
                folder,
                task: task.to_owned(),
                found: recordings.len(),
                wanted,
            });
        }
        Ok(recordings)
    }

    /// The recordings of a task in a folder, in order; where they are fewer than wanted, they are recorded.
    fn recorded(&self, task: &str, folder: &Path, wanted: usize) -> Result<Vec<PathBuf>, CliError> {
        let _one_records = self.recording.lock().expect("no one panics with it");
        if recordings_in(folder).len() < wanted {
            let _alone = hold(folder)?;
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
                folder.into(),
            ];
            self.commands.run(&command, None)?;
        }
        Ok(recordings_in(folder))
    }
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
    words.extend(method.running.iter().map(OsString::from));
    words.push("--json".into());
    words
}

/// Files that are a recording each.
fn each_alone(files: Vec<PathBuf>) -> Vec<Vec<PathBuf>> {
    files.into_iter().map(|file| vec![file]).collect()
}

/// Where a task is described, below the root.
pub(super) fn task_file(task: &str) -> String {
    format!("tasks/{task}.yaml")
}

/// Puts a file that never changes in another place, without a second copy of its contents where the file system can.
fn copied(from: &Path, to: &Path) -> Result<(), CliError> {
    if to.exists() || fs::hard_link(from, to).is_ok() {
        return Ok(());
    }
    let mut file = File::open(from).map_err(CliError::io(from))?;
    Ok(write_file(to, |copy| {
        std::io::copy(&mut file, copy).map(|_| ())
    })?)
}
