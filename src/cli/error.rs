use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::composer::{Diagnostics, Rendering};
use crate::environment::EnvironmentError;
use crate::experiment::ExperimentError;
use crate::graph::{GraphError, ScoreError};
use crate::inference::InferenceError;
use crate::loading::LoadError;
use crate::model::ModelError;
use crate::planner::{NoPath, PlannerError};
use crate::rollout::RolloutError;
use crate::serve::ServeError;
use crate::storage::StorageError;
use crate::task::TaskError;
use crate::training::TrainingError;
use crate::trajectory::TrajectoryError;
use crate::view::ViewError;
use crate::wording::counted;

/// Why a command failed; the rooms' errors as they are, and what only the command line knows.
#[derive(Debug, Error)]
pub(super) enum CliError {
    /// Faults of YAML files.
    #[error(transparent)]
    Composer(#[from] Diagnostics),
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    #[error(transparent)]
    Graph(#[from] GraphError),
    #[error(transparent)]
    Inference(#[from] InferenceError),
    /// A composition cannot be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error(transparent)]
    Planner(#[from] PlannerError),
    #[error(transparent)]
    Rollout(#[from] RolloutError),
    #[error(transparent)]
    Serve(#[from] ServeError),
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error(transparent)]
    Task(#[from] TaskError),
    #[error(transparent)]
    Training(#[from] TrainingError),
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
    #[error(transparent)]
    View(#[from] ViewError),
    /// There is no plan.
    #[error("{0}")]
    NoPath(NoPath),
    /// A task that the bedroom does not know.
    #[error("the bedroom has no task '{found}'; it has: {known}")]
    UnknownTask {
        /// What was asked for.
        found: String,
        /// What there is.
        known: String,
    },
    /// A preset that does not exist.
    #[error("there is no preset '{found}'; there are: {known}")]
    UnknownPreset {
        /// What was asked for.
        found: String,
        /// What there is.
        known: String,
    },
    /// A network variant that does not exist.
    #[error("there is no network variant '{found}'; there are: {known}")]
    UnknownVariant {
        /// What was asked for.
        found: String,
        /// What there is.
        known: String,
    },
    /// A file of `--config` that is no configuration of a training.
    #[error(
        "{}: {reason}; the names and their values are those of config.json in a run folder",
        file.display()
    )]
    TrainingConfig {
        /// The file.
        file: PathBuf,
        /// Why not.
        reason: String,
    },
    /// The actions of recordings mean something else than those of the model.
    #[error(
        "the recordings of task '{task}', such as '{trajectory}', have {found}, but the model has {expected}: {way_out}, \
         or train a model with these recordings"
    )]
    ActionsDiffer {
        /// The task.
        task: String,
        /// The first of its recordings.
        trajectory: String,
        /// The names of their actions.
        found: String,
        /// Those of the model.
        expected: String,
        /// What makes them agree.
        way_out: &'static str,
    },
    /// Recordings lack a camera of the model.
    #[error(
        "the recordings of task '{task}', such as '{trajectory}', have no camera '{wanted}', which the model sees; they \
         have {present}: name the topic of its images '{wanted}' under 'cameras' of the 'topics' in a mapping file, or \
         train a model with these recordings"
    )]
    CameraMissing {
        /// The task.
        task: String,
        /// The first of its recordings.
        trajectory: String,
        /// The camera of the model.
        wanted: String,
        /// Those of the recordings.
        present: String,
    },
    /// A picture would lie among a graph's tables, which the next graph would not replace then.
    #[error("{} would lie in the graph's folder, which holds its tables only: name another place with --svg", svg.display())]
    PictureInGraph {
        /// The picture.
        svg: PathBuf,
    },
    /// A merged graph would take the place of one that it is made of.
    #[error("{} is one of the graphs to be merged: name another folder with --out", graph.display())]
    MergedIntoItself {
        /// The graph.
        graph: PathBuf,
    },
    /// A file that an experiment keeps is not what it wrote.
    #[error("{}: {reason}; restore it, or remove it to have it measured anew", file.display())]
    CellBroken {
        /// The file.
        file: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A file holds what was measured with other settings, on other demonstrations or by another version.
    #[error(
        "{} holds what was measured otherwise: {what}. --out DIR keeps both, --replace measures it anew",
        file.display()
    )]
    CellOfOthers {
        /// The file.
        file: PathBuf,
        /// How what it was made of differs, so far as it tells.
        what: String,
    },
    /// A composition beside another target.
    #[error(
        "--composition goes with `catena evaluate shortcuts`, not with {target}: `catena evaluate {composition}` \
         evaluates it"
    )]
    CompositionUnused {
        /// What is evaluated.
        target: String,
        /// The composition.
        composition: String,
    },
    /// A model would go where a file is.
    #[error("{} is a file: name a folder for the model with --out", path.display())]
    OutIsFile {
        /// The file.
        path: PathBuf,
    },
    /// A model would go where other things are.
    #[error(
        "{} {what}, which is no part of a model, and a model would be written over what is there: name a folder of its \
         own with --out, one that is empty or not there, or one with a model",
        path.display()
    )]
    OutHoldsOthers {
        /// The folder.
        path: PathBuf,
        /// What is there.
        what: String,
    },
    /// A run folder in a model's folder, which is to hold nothing but what deploys.
    #[error(
        "the run folder {} lies in the model's folder {}: name one beside it with --run, or leave --run out",
        run.display(), model.display()
    )]
    RunInModel {
        /// The run folder.
        run: PathBuf,
        /// The model's folder.
        model: PathBuf,
    },
    /// A method that the experiment does not have.
    #[error("there is no method '{found}' in this experiment; there are: {known}")]
    UnknownMethod {
        /// What was asked for.
        found: String,
        /// What there is.
        known: String,
    },
    /// A flag that an experiment has no use for.
    #[error("{flag} changes nothing in {experiment}: leave it out; it is for {heeding}")]
    FlagOfOthers {
        /// The flag.
        flag: &'static str,
        /// The experiment.
        experiment: &'static str,
        /// Those that heed it, separated by commas.
        heeding: String,
    },
    /// Several numbers of demonstrations for an experiment that has one.
    #[error(
        "{experiment} is made of one number of demonstrations, found --demonstrations {found}: make a call for each, \
         with an --out of its own"
    )]
    OneNumberOnly {
        /// Its name.
        experiment: &'static str,
        /// What was asked for.
        found: String,
    },
    /// Fewer recordings than an experiment needs.
    #[error(
        "{} has {found} MCAP recordings that can be demonstrations, and the experiment needs {wanted}: record more (`catena \
         record {task} --demos {wanted} --vary --out {}`), or ask for fewer with --demonstrations",
        folder.display(),
        folder.display()
    )]
    TooFewRecordings {
        /// The folder.
        folder: PathBuf,
        /// The task.
        task: String,
        /// How many are there.
        found: usize,
        /// How many are needed.
        wanted: usize,
    },
    /// Another process makes the same.
    #[error(
        "another experiment makes the same in {}: wait until it is done and call this one again, what is finished is kept; \
         or name another folder with --work",
        folder.display()
    )]
    ExperimentAtWork {
        /// Where.
        folder: PathBuf,
    },
    /// What an experiment would train is being trained.
    #[error(
        "a training is at work in {}, begun by an experiment that was stopped, or by hand: wait until it ends, as it does \
         soon after its experiment, or stop it, and call this one again, what is done is kept; or name another folder with \
         --work",
        run.display()
    )]
    TrainingAtWork {
        /// The run folder.
        run: PathBuf,
    },
    /// A command of an experiment failed; what it printed says why.
    #[error(
        "this step of the experiment failed ({status}); mend it and call the experiment again, what is finished \
         is kept:\n  {command}{said}"
    )]
    ExperimentStep {
        /// The command.
        command: String,
        /// How it ended.
        status: String,
        /// What it said where that was not shown already.
        said: String,
    },
    /// Cells of an experiment could not be measured; why was said of each.
    #[error(
        "{failed} of {all} cells could not be measured, as said above; mend that and call the experiment again, what is \
         finished is kept"
    )]
    CellsFailed {
        /// How many failed.
        failed: usize,
        /// How many were to be measured.
        all: usize,
    },
    /// A frozen encoder without the baseline that wants one.
    #[error(
        "--frozen-encoder is for --method mvp; our model trains its own encoder, so leave it out"
    )]
    FrozenEncoderOfOurs,
    /// A flag of our networks with a baseline.
    #[error(
        "{flag} is for our own networks (--method ours): a baseline has one network, sees all cameras, and its goal is the \
         end of a demonstration"
    )]
    FlagOfOurs {
        /// The flag.
        flag: &'static str,
    },
    /// A baseline is evaluated on one task at a time.
    #[error(
        "'{composition}' has {tasks} tasks, but a baseline's policy is sent to the end of one task: evaluate it on \
         a task"
    )]
    PolicyOfOneTask {
        /// The composition.
        composition: String,
        /// Its tasks.
        tasks: usize,
    },
    /// There is no image of the task's end.
    #[error(
        "task '{task}' names no demonstrations, and a baseline needs an image of the task's end: write \
         'demonstrations: FOLDER' into its file"
    )]
    NoGoalImage {
        /// The task.
        task: String,
    },
    /// A share that is none.
    #[error(
        "--nearest is {share}; it is a share of all states, above 0 and at most 1, such as 0.05"
    )]
    ShareOutOfRange {
        /// What was given.
        share: f64,
    },
    /// Another number of folders than of tasks.
    #[error(
        "--demos names {} for {}; name one folder a task, in this order: {tasks}",
        counted(*found, "folder"),
        counted(*expected, "task")
    )]
    FoldersOfTasks {
        /// The tasks.
        tasks: String,
        /// How many there are.
        expected: usize,
        /// Folders that were given.
        found: usize,
    },
    /// Two sets of demonstrations are of one task.
    #[error(
        "{} is of task '{task}', like one before it: name all recordings of a task in one mapping file, or keep \
         them in one folder", path.display()
    )]
    TaskTwice {
        /// The task.
        task: String,
        /// The second path.
        path: PathBuf,
    },
    /// Two mapping files cut actions otherwise.
    #[error(
        "{} and {} cut actions into other bins: a model has one action space, so write the same under 'actions' \
         in all mapping files", first.display(), other.display()
    )]
    BinningsDiffer {
        /// The first path.
        first: PathBuf,
        /// The one that differs.
        other: PathBuf,
    },
    /// A model is to keep its networks, and others are to teach it.
    #[error(
        "{} was trained on recordings of '{task}' that are not given, or others are: it is taught with all that it was \
         trained on, and --practice", model.display()
    )]
    OtherDemonstrations {
        /// The task.
        task: String,
        /// The model's folder.
        model: PathBuf,
    },
    /// A training was begun there.
    #[error(
        "{} holds a training already: go on with --resume and the flags that it was begun with, or name another folder with \
         --run",
        run.display()
    )]
    RunExists {
        /// The run folder.
        run: PathBuf,
    },
    /// The operator fails again and again.
    #[error(
        "only {recorded} of {attempts} attempts at '{task}' succeeded; the {wanted} wanted are out of reach"
    )]
    OperatorFails {
        /// The task.
        task: String,
        /// Successful demonstrations.
        recorded: usize,
        /// Attempts.
        attempts: usize,
        /// What was asked for.
        wanted: usize,
    },
    /// A file that would count as recorded was recorded with other flags.
    #[error(
        "{} was recorded otherwise, as {found}, and {wanted} is asked for: name another folder with --out",
        file.display()
    )]
    RecordedOtherwise {
        /// The file.
        file: PathBuf,
        /// What it is of.
        found: String,
        /// What is asked for.
        wanted: String,
    },
    /// The episodes of a recording would have seeds that no number can hold.
    #[error(
        "--seed {seed} is too large: the episodes' seeds are a million times it and more, which leaves room up to \
         --seed {most}"
    )]
    SeedTooLarge {
        /// What was given.
        seed: u64,
        /// The largest that there is room for.
        most: u64,
    },
    /// A stage that a run cannot begin at.
    #[error("a run cannot be resumed from '{found}'; it can from: {known}")]
    UnknownStage {
        /// What was asked for.
        found: String,
        /// The beginning and subgoals, with the numbers of the stages that they begin.
        known: String,
    },
    /// No recording to go on from.
    #[error(
        "there is no recording to resume from: {} is no file. Run '{composition}' before, or name one with --from",
        recording.display()
    )]
    NothingToResume {
        /// Where it was looked for.
        recording: PathBuf,
        /// The composition.
        composition: String,
    },
    /// A recording to go on from that lacks the beginning of its episode.
    #[error(
        "{} begins in the middle of a run, where that was resumed from {original}: resume from that recording (--from)",
        recording.display()
    )]
    ResumedTwice {
        /// The recording.
        recording: PathBuf,
        /// The one that it was gone on from, as it says.
        original: String,
    },
    /// A run would replace the recording that it goes on from.
    #[error(
        "{} is the recording to resume from, and this run's would take its place: name another folder with --out",
        recording.display()
    )]
    ResumedIntoItself {
        /// The recording.
        recording: PathBuf,
    },
    /// A composition without a simulated world.
    #[error(
        "'{composition}' names no world; write 'environment: {{bedroom: {{start: sock}}}}' to run it in the simulated bedroom"
    )]
    NoWorld {
        /// The composition.
        composition: String,
    },
    /// The process that measures one engine cannot be started.
    #[error("cannot start another catena to measure the other engine: {0}; name one with --engine")]
    Child(std::io::Error),
    /// The process that measures one engine failed, and has said why.
    #[error("the measurement with the embedded engine failed; its own message stands above")]
    ChildFailed,
    /// The system refuses to read or write a file or folder.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A result cannot be written as JSON.
    #[error("the result cannot be written as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// Some recordings could not be read; each was named.
    #[error("{failed} of {all} recordings could not be read")]
    RecordingsFailed {
        /// How many failed.
        failed: usize,
        /// How many there were.
        all: usize,
    },
}

impl From<ScoreError<StorageError>> for CliError {
    fn from(error: ScoreError<StorageError>) -> Self {
        match error {
            ScoreError::Graph(e) => Self::Graph(e),
            ScoreError::Sink(e) => Self::Storage(e),
        }
    }
}

impl CliError {
    /// The error of what the system refuses to do with a file or folder.
    pub(super) fn io(path: &Path) -> impl Fn(std::io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |source| Self::Io {
            path: path.clone(),
            source,
        }
    }

    /// What is printed: faults of YAML files with their lines, everything else as one line with its
    /// causes.
    pub(super) fn report(&self) -> String {
        if let Self::Composer(diagnostics) | Self::Load(LoadError::Composer(diagnostics)) = self {
            let style = if std::io::stderr().is_terminal() {
                Rendering::Colour
            } else {
                Rendering::Plain
            };
            return diagnostics.render(style);
        }
        let mut text = format!("error: {self}");
        let mut cause = std::error::Error::source(self);
        while let Some(source) = cause {
            let line = source.to_string();
            if !text.contains(&line) {
                text.push_str("\n  because: ");
                text.push_str(&line);
            }
            cause = source.source();
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::composer::compose_named;

    #[test]
    fn what_is_wrong_while_loading_is_told_as_anywhere_else() {
        let error = || InferenceError::EngineUnknown {
            name: "x".to_owned(),
        };
        let loading = CliError::from(LoadError::from(error()));
        assert_eq!(loading.report(), CliError::from(error()).report());
        let faults = compose_named("nothing", Path::new("nowhere")).expect_err("there is no task");
        let loading = CliError::from(LoadError::from(faults.clone()));
        assert_eq!(loading.report(), CliError::from(faults).report());
    }

    #[test]
    fn a_cause_that_the_message_tells_is_not_told_again() {
        let source = std::io::Error::other("the disk is gone");
        let path = PathBuf::from("model/policy.onnx");
        let error = CliError::from(InferenceError::FileUnreadable { path, source });
        let cause = std::error::Error::source(&error);
        assert!(
            cause.is_some_and(<dyn std::error::Error>::is::<std::io::Error>),
            "{error:?}"
        );
        assert_eq!(
            error.report(),
            "error: cannot read model/policy.onnx: the disk is gone; a model folder is written by `catena train`"
        );
    }
}
