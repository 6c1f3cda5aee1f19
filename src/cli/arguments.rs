mod experiment;

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

pub use experiment::{ChainingArguments, ExperimentCommand, PaperArguments};

use crate::storage::ImageSize;

/// Chains robot behaviour out of demonstrations of single tasks.
#[derive(Debug, Parser)]
#[command(name = "catena", version, about, max_term_width = 100)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// Which engine runs the networks.
    #[arg(long, global = true, value_enum, default_value_t = EngineArgument::Auto)]
    pub engine: EngineArgument,
    /// The folder that paths in tasks and compositions are relative to.
    #[arg(long, global = true, default_value = ".")]
    pub root: PathBuf,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Record demonstrations of a task in the simulated bedroom, one MCAP file each.
    Record(RecordArguments),
    /// Say what is in recordings: topics, cameras, steps, actions, and what was lost.
    Demos(DemosArguments),
    /// Write recordings as a LeRobot dataset, or as MCAP files.
    Convert(ConvertArguments),
    /// Train a model on demonstrations and export it as ONNX.
    Train(TrainArguments),
    /// Build, merge and look at topological graphs.
    #[command(subcommand)]
    Graph(GraphCommand),
    /// Check a composition and plan it without running it.
    Compose(ComposeArguments),
    /// Plan a composition and run it closed-loop in the simulator.
    Run(RunArguments),
    /// Measure the success rate of a task or a composition over many episodes.
    Evaluate(EvaluateArguments),
    /// Make tables and figures; what is finished is kept, so that a run that was cut goes on.
    #[command(subcommand)]
    Experiment(ExperimentCommand),
    /// Serve a composition to a robot's own program: observations in, actions out.
    Serve(ServeArguments),
    /// Serve the simulated bedroom to a program that drives it: actions in, observations out.
    Simulate(SimulateArguments),
    /// Time the steps of the closed loop on graphs of growing size, on this machine.
    Bench(BenchArguments),
}

/// `catena record`
#[derive(Debug, Args)]
pub struct RecordArguments {
    /// The task to demonstrate: sock, trash or wine.
    pub task: String,
    /// How many successful demonstrations to record.
    #[arg(long, default_value_t = 30)]
    pub demos: usize,
    /// Seed of the first attempt; the others follow from it.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Where the recordings go.
    #[arg(long)]
    pub out: PathBuf,
    /// How much the world varies from one demonstration to the next.
    #[arg(long, value_enum, default_value_t = LevelArgument::Paper)]
    pub level: LevelArgument,
    /// Vary what other tasks leave behind: a drawer open or shut, a can gone.
    #[arg(long)]
    pub vary: bool,
    /// Practise with the gripper instead, for `catena train --practice`.
    #[arg(long, value_enum, value_name = "HOW")]
    pub practice: Option<PracticeArgument>,
}

/// How recordings are read; goes before what a mapping file says.
#[derive(Debug, Args)]
pub struct ReadArguments {
    /// Take a step every so many actions, counted from the last, of continuous actions.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub every: Option<u32>,
    /// Stretch or squeeze the images of all cameras to this size.
    #[arg(long, value_name = "HEIGHTxWIDTH")]
    pub image_size: Option<ImageSize>,
}

/// `catena demos`
#[derive(Debug, Args)]
pub struct DemosArguments {
    /// MCAP files, LeRobot datasets, folders of them, or mapping files.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    #[command(flatten)]
    pub read: ReadArguments,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `catena convert`
#[derive(Debug, Args)]
pub struct ConvertArguments {
    /// MCAP files, LeRobot datasets, folders of them, or mapping files.
    #[arg(required = true)]
    pub paths: Vec<PathBuf>,
    /// What to write: a LeRobot dataset of version 3.0, or an MCAP file an episode.
    #[arg(long, value_enum)]
    pub to: FormatArgument,
    /// Where it goes: a folder that is not there yet.
    #[arg(long)]
    pub out: PathBuf,
    /// How images are kept: every pixel as PNG, or as JPEG in a fraction of the space.
    #[arg(long, value_enum, default_value_t = PicturesArgument::Png)]
    pub images: PicturesArgument,
    #[command(flatten)]
    pub read: ReadArguments,
}

/// `catena train`
#[derive(Debug, Args)]
pub struct TrainArguments {
    /// Folders of recordings, LeRobot datasets or mapping files, one a task; a dataset of several tasks is
    /// taken apart.
    #[arg(required = true)]
    pub demos: Vec<PathBuf>,
    /// Where the exported model goes.
    #[arg(long)]
    pub out: PathBuf,
    /// Where checkpoints and losses go; by default a folder beside the model.
    #[arg(long)]
    pub run: Option<PathBuf>,
    /// What to train: our model, or a baseline of the paper to compare it with.
    #[arg(long, value_enum, default_value_t = MethodArgument::Ours)]
    pub method: MethodArgument,
    /// Recordings of practice with the gripper, as the demonstrations are given: teach what an empty gripper looks like,
    /// and one that holds things oddly. A closing after which a subgoal was reached holds something, any other nothing.
    #[arg(long, value_name = "PATH", num_args = 1..)]
    pub practice: Vec<PathBuf>,
    /// Train nothing: take the networks of this model as they are, and learn anew what tells whether the gripper is
    /// empty, and how far off places are seen, from the demonstrations that the model was trained on and `--practice`.
    #[arg(long, value_name = "MODEL", requires = "practice", conflicts_with_all = ["resume", "steps", "minutes", "config", "variant", "cameras", "seed", "method", "preset", "run"])]
    pub keep_networks: Option<PathBuf>,
    /// With `--method mvp`: the visual encoder, trained elsewhere, as an ONNX file with one input
    /// [n, 3, height, width] and one output [n, features]. A JSON file beside it of the same name may say
    /// mean and deviation (of 0 to 255) and the size of its pictures.
    #[arg(long, value_name = "FILE")]
    pub frozen_encoder: Option<PathBuf>,
    /// Size of the network and length of the training.
    #[arg(long, default_value = "paper")]
    pub preset: String,
    /// YAML or JSON with values that replace the preset's, under the names that `config.json` of a run
    /// folder has; such a file as a whole repeats its training.
    #[arg(long)]
    pub config: Option<PathBuf>,
    /// Where two states meet in the network: `latent_flow`, `siamese`, `frame_stacking` or
    /// `pixel_difference`; widths are changed so that all have about as many weights.
    #[arg(long)]
    pub variant: Option<String>,
    /// A camera that the network sees; may be given several times. By default all.
    #[arg(long = "camera")]
    pub cameras: Vec<String>,
    /// Seed of weights, batches and the split into training and validation; 1 unless the file of
    /// `--config` says otherwise.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Go on from the last checkpoint of the run folder.
    #[arg(long)]
    pub resume: bool,
    /// Stop after so many optimisation steps.
    #[arg(long)]
    pub steps: Option<usize>,
    /// Stop after so many minutes and keep the best checkpoint.
    #[arg(long)]
    pub minutes: Option<f64>,
    /// Bins of each dimension of continuous actions for which a mapping file does not say it.
    #[arg(long, default_value_t = 21)]
    pub bins: usize,
    #[command(flatten)]
    pub read: ReadArguments,
}

/// `catena graph ...`
#[derive(Debug, Subcommand)]
pub enum GraphCommand {
    /// Build the graph of one task from its demonstrations.
    Build(GraphBuildArguments),
    /// Merge graphs of several tasks through learned cross-task edges.
    Merge(GraphMergeArguments),
    /// Say what is in a graph: nodes, edges by kind, components, end states.
    Show(GraphShowArguments),
    /// Say where the tasks of a composition do not connect, and what to demonstrate.
    Gaps(GraphGapsArguments),
    /// Follow recordings that are not in a task's graph along it: errors, jumps, with and without the filter.
    Localise(GraphLocaliseArguments),
    /// Say how far predicted edges can be trusted, by recordings of the simulator that are in no graph: calibration,
    /// false edges, and what each option of the edges does.
    Trust(GraphTrustArguments),
}

/// `catena graph build`
#[derive(Debug, Args)]
pub struct GraphBuildArguments {
    /// The task's YAML file.
    pub task: PathBuf,
    /// The recordings; by default those that the task names.
    #[arg(long)]
    pub demos: Option<PathBuf>,
    /// The exported model.
    #[arg(long)]
    pub model: PathBuf,
    /// Where the graph goes; by default where the task says.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Score only this share (above 0, at most 1) of all states for each state, those that are most
    /// probably connected, instead of all; 0.05 finds nearly all edges of the bedroom.
    #[arg(long)]
    pub nearest: Option<f64>,
    #[command(flatten)]
    pub read: ReadArguments,
}

/// `catena graph merge`
#[derive(Debug, Args)]
pub struct GraphMergeArguments {
    /// Graph folders in the order of their tasks.
    #[arg(required = true, num_args = 2..)]
    pub graphs: Vec<PathBuf>,
    /// The exported model that all of them were built with.
    #[arg(long)]
    pub model: PathBuf,
    /// Where the merged graph goes.
    #[arg(long)]
    pub out: PathBuf,
    /// Also draw it as SVG.
    #[arg(long)]
    pub svg: Option<PathBuf>,
}

/// `catena graph show`
#[derive(Debug, Args)]
pub struct GraphShowArguments {
    /// A graph folder.
    pub graph: PathBuf,
    /// Also list the predicted edges that claim to gain most steps over the demonstrations, those that a
    /// shortest path would take and a robot perhaps cannot.
    #[arg(long)]
    pub suspects: bool,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `catena graph gaps`
#[derive(Debug, Args)]
pub struct GraphGapsArguments {
    /// The composition's YAML file.
    pub file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `catena graph localise`
#[derive(Debug, Args)]
pub struct GraphLocaliseArguments {
    /// The task's YAML file.
    pub task: PathBuf,
    /// A folder of recordings that the graph was not built from.
    #[arg(long)]
    pub demos: PathBuf,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all.
    #[arg(long)]
    pub nearest_states: Option<usize>,
    #[command(flatten)]
    pub read: ReadArguments,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `catena graph trust`
#[derive(Debug, Args)]
pub struct GraphTrustArguments {
    /// The YAML file of a task or a composition.
    pub file: PathBuf,
    /// Folders of recordings that the model was not trained on, one a task, in the order of the composition.
    #[arg(long, required = true, num_args = 1..)]
    pub demos: Vec<PathBuf>,
    /// Edges that are walked in the simulator, of the true and of the false ones each.
    #[arg(long, default_value_t = 60)]
    pub walks: usize,
    /// Seed of the samples.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `catena compose`
#[derive(Debug, Args)]
pub struct ComposeArguments {
    /// The composition's YAML file.
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
    /// The composition's YAML file.
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
    #[arg(long, default_value_t = 50)]
    pub episodes: usize,
    /// Seed of the first episode; the others follow one by one.
    #[arg(long, default_value_t = 100)]
    pub seed: u64,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// How much the world varies.
    #[arg(long, value_enum, default_value_t = LevelArgument::Paper)]
    pub level: LevelArgument,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all: for large graphs.
    #[arg(long)]
    pub nearest_states: Option<usize>,
    /// How to plan: with subgoals in order, or the paper's way. With `shortcuts`, the paper's way leaves out
    /// the runs with subgoals in order.
    #[arg(long, value_enum, default_value_t = PlannerArgument::InOrder)]
    pub planner: PlannerArgument,
    /// Evaluate the baseline policy in this folder, written by `catena train --method`, instead of the task's
    /// model and graph. Its goal image is the end of the task's first demonstration.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["planner", "nearest_states", "composition"])]
    pub policy: Option<PathBuf>,
}

/// `catena serve`
#[derive(Debug, Args)]
pub struct ServeArguments {
    /// The composition's YAML file, or a task's name.
    pub target: String,
    /// The address to listen on.
    #[arg(long, default_value = "127.0.0.1:8000")]
    pub bind: SocketAddr,
    #[command(flatten)]
    pub limits: LimitArguments,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all: for large graphs.
    #[arg(long)]
    pub nearest_states: Option<usize>,
}

/// `catena simulate`
#[derive(Debug, Args)]
pub struct SimulateArguments {
    /// The composition's YAML file, or a task's name: where the robot starts, and which subgoals are judged.
    pub target: String,
    /// The address to listen on.
    #[arg(long, default_value = "127.0.0.1:8001")]
    pub bind: SocketAddr,
    #[command(flatten)]
    pub limits: LimitArguments,
    /// How much the world varies.
    #[arg(long, value_enum, default_value_t = LevelArgument::Paper)]
    pub level: LevelArgument,
}

/// Who may come in, and what each may take.
#[derive(Debug, Args)]
pub struct LimitArguments {
    /// A file with the key that clients must send (`api_key` of openpi-client). Needed where other machines
    /// reach the address.
    #[arg(long, value_name = "FILE")]
    pub api_key_file: Option<PathBuf>,
    /// Connections at a time.
    #[arg(long, default_value_t = 64)]
    pub max_connections: usize,
    /// Mebibytes of a message.
    #[arg(long, default_value_t = 32)]
    pub max_message_mib: usize,
    /// A connection that sends nothing for so many seconds is closed.
    #[arg(long, default_value_t = 600)]
    pub idle_secs: u64,
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
    #[arg(long, default_value_t = 100)]
    pub steps: usize,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all.
    #[arg(long)]
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

/// What recordings are converted to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum FormatArgument {
    /// A LeRobot dataset of version 3.0.
    Lerobot,
    /// An MCAP file an episode, in a folder a task.
    Mcap,
}

/// How images are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PicturesArgument {
    /// Every pixel.
    Png,
    /// Quality 92.
    Jpeg,
}

/// What is practised with the gripper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PracticeArgument {
    /// Only go through the motions: the gripper closes beside every loose thing and is carried on empty.
    Dry,
    /// Take every loose thing beside where it is best taken, so that it is held oddly.
    Askew,
}

/// Level of variation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LevelArgument {
    /// One real room, objects put back by hand.
    Paper,
    /// Twice the poses; textures, colours and clutter drawn anew.
    Hard,
}

/// Way of planning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PlannerArgument {
    /// Subgoals in order: no plan skips one.
    InOrder,
    /// The shortest path over the merged graph, as in the paper.
    Unconstrained,
}

/// What is trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MethodArgument {
    /// The latent-flow model, to build graphs with and plan.
    Ours,
    /// Behavior cloning.
    Bc,
    /// Behavior cloning with a memory.
    #[value(name = "bc_rnn")]
    BcRnn,
    /// A transformer over tokens of images.
    Rt1,
    /// Behavior cloning on features of a frozen encoder.
    Mvp,
}

/// Inference engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum EngineArgument {
    /// ONNX Runtime if it is found, else the embedded engine.
    Auto,
    /// ONNX Runtime or an error.
    Native,
    /// The engine that is compiled in.
    Embedded,
}
