//! `catena train`

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{ReadArguments, minutes, positive};
use crate::storage::MAX_BINS;

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
    #[arg(long, value_name = "MODEL", requires = "practice", conflicts_with_all = ["resume", "steps", "minutes", "config", "variant", "cameras", "own_goals", "seed", "method", "preset", "run"])]
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
    /// The policy learns with goal states of its own demonstration alone, as the paper's does; the preset `bedroom` takes
    /// half of them from others (`sampling.aligned_share`).
    #[arg(long)]
    pub own_goals: bool,
    /// Seed of weights, batches and the split into training and validation; 1 unless the file of
    /// `--config` says otherwise.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Go on from the last checkpoint of the run folder, with the flags that it was begun with; `--minutes` may be
    /// another.
    #[arg(long)]
    pub resume: bool,
    /// Stop after so many optimisation steps. The learning rate falls over all of them, so a training of more steps
    /// begins anew in a run folder of its own.
    #[arg(long, value_parser = positive)]
    pub steps: Option<usize>,
    /// Stop after so many minutes and keep the best checkpoint.
    #[arg(long, value_parser = minutes)]
    pub minutes: Option<f64>,
    /// Bins of each dimension of continuous actions for which a mapping file does not say it.
    #[arg(long, default_value_t = 21, value_parser = bins)]
    pub bins: usize,
    #[command(flatten)]
    pub read: ReadArguments,
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

/// Bins of a dimension, as many as a mapping file may ask for.
fn bins(text: &str) -> Result<usize, String> {
    let bins = text
        .parse()
        .ok()
        .filter(|bins| (1..=MAX_BINS).contains(bins));
    bins.ok_or_else(|| format!("give a whole number within 1..={MAX_BINS}"))
}
