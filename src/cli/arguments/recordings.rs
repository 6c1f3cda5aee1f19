//! Commands that make, read and rewrite recordings.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{LevelArgument, positive};
use crate::storage::ImageSize;

/// `catena record`
#[derive(Debug, Args)]
pub struct RecordArguments {
    /// The task to demonstrate: sock, trash or wine.
    pub task: String,
    /// How many successful demonstrations to record.
    #[arg(long, default_value_t = 30, value_parser = positive)]
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

/// What is practised with the gripper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PracticeArgument {
    /// Only go through the motions: the gripper closes beside every loose thing and is carried on empty.
    Dry,
    /// Take every loose thing beside where it is best taken, so that it is held oddly.
    Askew,
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
