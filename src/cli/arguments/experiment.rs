//! `catena experiment ...`

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{LARGEST_FIRST_SEED, LevelArgument, positive};

/// `catena experiment ...`
#[derive(Debug, Subcommand)]
pub enum ExperimentCommand {
    /// A chain of tasks with all that guards it, with each guard switched off in turn, and with none.
    Chaining(ChainingArguments),
    /// The paper's Table I: success of our way and of the baselines after 10, 20 and 30 demonstrations.
    Table1(PaperArguments),
    /// The paper's Table II: time that a step of each method takes, with both engines.
    Table2(PaperArguments),
    /// The paper's Table III: success of the networks that ours is compared with, after 20 demonstrations.
    Table3(PaperArguments),
    /// The paper's Figure 5: losses of these networks on held-out demonstrations, three seeds.
    Fig5(PaperArguments),
    /// The paper's Figure 6: how sure our way and behaviour cloning are of the first action of `sock`.
    Fig6(PaperArguments),
}

/// `catena experiment table1` and the others of the paper.
#[derive(Clone, Debug, Args)]
pub struct PaperArguments {
    /// A small version, meant to end within 20 minutes on 2 cores: fewer demonstrations, episodes and steps of
    /// training. What it measures says little, and says so.
    #[arg(long)]
    pub quick: bool,
    /// Only these methods, such as `ours,bc`; by default all.
    #[arg(long, value_delimiter = ',')]
    pub methods: Vec<String>,
    /// Only these numbers of demonstrations of each task.
    #[arg(long, value_delimiter = ',', value_parser = positive)]
    pub demonstrations: Vec<usize>,
    /// Episodes of each method and task; not of `table2`, which times one, nor of `fig5`, which has none.
    #[arg(long, value_parser = positive)]
    pub episodes: Option<usize>,
    /// Seed of the first episode, by default 100; the others follow one by one. Not of `fig5`, which has no episodes.
    #[arg(long, value_parser = clap::value_parser!(u64).range(..=LARGEST_FIRST_SEED))]
    pub seed: Option<u64>,
    /// Seed of the trainings, the first of several.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=LARGEST_FIRST_SEED))]
    pub training_seed: u64,
    /// Steps of training of our way and its variants.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    pub steps: Option<u64>,
    /// Steps of training of the baselines at most; they stop earlier where nothing gets better. `table3` and `fig5`
    /// have no baselines.
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..))]
    pub baseline_steps: Option<u64>,
    /// Folder with recordings of each task (`DIR/sock` and so on), of which the first are taken; by default
    /// they are recorded.
    #[arg(long, value_name = "DIR")]
    pub demos: Option<PathBuf>,
    /// An image encoder in ONNX that somebody else trained, for the baseline `mvp` of `table1` and `table2`;
    /// without one it is left out.
    #[arg(long, value_name = "FILE")]
    pub frozen_encoder: Option<PathBuf>,
    /// Where recordings, models and graphs go, which are large.
    #[arg(long, default_value = "out/experiments")]
    pub work: PathBuf,
    /// Where the cells, the table and the plot go; by default a folder of the experiment's name in
    /// `results`, or in `out/quick` with `--quick`.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// How many trainings, each with its episodes, run beside each other and share the processors; each
    /// needs 1 to 2 GB of memory. What they print goes to `log.txt` in their folders then. Table II, which
    /// measures times, does one after the other.
    #[arg(long, default_value = "1")]
    pub jobs: NonZeroUsize,
    /// Make the table and the plot of the cells that are there, measure nothing.
    #[arg(long)]
    pub only_draw: bool,
    /// Measure anew what was measured otherwise, in place of it.
    #[arg(long, conflicts_with = "only_draw")]
    pub replace: bool,
}

/// `catena experiment chaining`
#[derive(Debug, Args)]
pub struct ChainingArguments {
    /// The composition: its YAML file, its name, or a task's name.
    #[arg(default_value = "tasks/sequences/sock_then_trash.yaml")]
    pub target: String,
    /// A small version, of 4 episodes of each method. What it measures says little, and says so.
    #[arg(long)]
    pub quick: bool,
    /// Number of episodes of each method; by default 100.
    #[arg(long, value_parser = positive)]
    pub episodes: Option<usize>,
    /// Seed of the first episode; the others follow one by one.
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u64).range(..=LARGEST_FIRST_SEED))]
    pub seed: u64,
    /// How much the world varies.
    #[arg(long, value_enum, default_value_t = LevelArgument::Paper)]
    pub level: LevelArgument,
    /// Where the cells, the table and the plot go; by default `results/chaining`, or `out/quick/chaining` with
    /// `--quick`.
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Measure anew what was measured otherwise, in place of it.
    #[arg(long)]
    pub replace: bool,
}
