//! `catena graph ...`

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::{ReadArguments, positive};

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
    /// The task's YAML file, or its name.
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
    /// The composition: its YAML file, its name, or a task's name.
    pub file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// `catena graph localise`
#[derive(Debug, Args)]
pub struct GraphLocaliseArguments {
    /// The task's YAML file, or its name.
    pub task: PathBuf,
    /// A folder of recordings that the graph was not built from.
    #[arg(long)]
    pub demos: PathBuf,
    /// Ask at each step how far only so many states are in each direction, those that seem nearest, instead
    /// of all.
    #[arg(long, value_parser = positive)]
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
    /// Folders of recordings that the model was not trained on, one a task, in the order of the composition; a task that is
    /// done several times has one.
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
