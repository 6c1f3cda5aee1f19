//! Commands that plan a composition and drive the robot along it.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{LARGEST_FIRST_SEED, LevelArgument, positive};

/// `catena compose`
#[derive(Debug, Args)]
pub struct ComposeArguments {
    /// The composition: its YAML file, its name, or a task's name.
    pub file: PathBuf,
    /// Also say why the plan is what it is: stages, the orders that were open, what each part costs and how
    /// probable it is to hold, how each task's end was chosen; and draw the automaton.
    #[arg(long)]
    pub explain: bool,
    /// Where the picture goes; by default `out/` and the composition's name.
    #[arg(long, requires = "explain")]
    pub out: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `catena run`
#[derive(Debug, Args)]
pub struct RunArguments {
    /// The composition: its YAML file, its name, or a task's name.
    pub file: PathBuf,
    /// Seed of the episode. The default is one of the evaluations in the README, and one of those that succeed.
    #[arg(long, default_value_t = 111)]
    pub seed: u64,
    /// Where the results go; by default `out/` and the composition's name, and of a resumed run a folder
    /// within it.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Go on from this stage: its number, or the subgoal with which it begins, such as `sock_in_box`. What an
    /// earlier run did until then is done again first; its seed counts.
    #[arg(long, value_name = "STAGE", conflicts_with = "seed")]
    pub resume: Option<String>,
    /// The recording of the earlier run; by default the one in the composition's folder below `out/`.
    #[arg(long, value_name = "RECORDING", requires = "resume")]
    pub from: Option<PathBuf>,
}

/// `catena evaluate`
#[derive(Debug, Args)]
pub struct EvaluateArguments {
    /// A task's name, the YAML file of a composition, or `shortcuts`: how well the monitor finds them.
    pub target: String,
    /// With `shortcuts`: the YAML file of the composition that is watched.
    #[arg(long)]
    pub composition: Option<String>,
    /// Number of episodes.
    #[arg(long, default_value_t = 50, value_parser = positive)]
    pub episodes: usize,
    /// Seed of the first episode; the others follow one by one.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(..=LARGEST_FIRST_SEED))]
    pub seed: u64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// How much the world varies.
    #[arg(long, value_enum, default_value_t = LevelArgument::Paper)]
    pub level: LevelArgument,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all: for large graphs.
    #[arg(long, value_parser = positive)]
    pub nearest_states: Option<usize>,
    /// How to plan: with subgoals in order, or the paper's way. With `shortcuts`, the paper's way leaves out
    /// the runs with subgoals in order.
    #[arg(long, value_enum, default_value_t = PlannerArgument::InOrder)]
    pub planner: PlannerArgument,
    /// Who drives the last steps before the gripper closes or opens.
    #[arg(long, value_enum, default_value_t = LastStepsArgument::Led)]
    pub last_steps: LastStepsArgument,
    /// Evaluate the baseline policy in this folder, written by `catena train --method`, instead of the task's
    /// model and graph. Its goal image is the end of the task's first demonstration.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["planner", "nearest_states", "last_steps", "composition"])]
    pub policy: Option<PathBuf>,
}

/// Way of planning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PlannerArgument {
    /// Subgoals in order: no plan skips one.
    InOrder,
    /// The shortest path over the merged graph, as in the paper.
    Unconstrained,
}

/// Who drives the last steps before the gripper closes or opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LastStepsArgument {
    /// The robot is led to the place that its cameras see, where the model has landmarks.
    Led,
    /// The policy alone, as in the paper.
    Policy,
}

/// `catena bench`
#[derive(Debug, Args)]
pub struct BenchArguments {
    /// The YAML file of the composition whose model and graphs are used.
    #[arg(default_value = "tasks/sequences/sock_then_trash.yaml")]
    pub file: PathBuf,
    /// Sizes of the graphs: demonstrations are left out or copied until there are so many states.
    #[arg(long, value_delimiter = ',', default_values_t = [630, 2100, 6300])]
    pub states: Vec<usize>,
    /// Steps that are timed on each graph, fewer where the robot has finished before.
    #[arg(long, default_value_t = 100, value_parser = positive)]
    pub steps: usize,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all.
    #[arg(long, value_parser = positive)]
    pub nearest_states: Option<usize>,
    /// Steps of the plain implementation that are timed.
    #[arg(long, default_value_t = 20)]
    pub plain_steps: usize,
    /// Seed of the episode and of the noise on copies.
    #[arg(long, default_value_t = 100)]
    pub seed: u64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}
