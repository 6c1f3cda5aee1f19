//! Learning from demonstrations: the latent-flow network, its sampling and losses, the trainer and
//! the ONNX export (Fu & Finn, sections III-C, III-E and III-F).
//!
//! The way of a training: [`Dataset`] lays out the states of all demonstrations, a
//! sampler draws windows of states and pairs among them, a producer thread turns
//! them into patches, the [network](LatentFlowNetwork) encodes each state once and scores the pairs,
//! and [`train`] keeps the weights that do best on held-out demonstrations. [`export`] writes them as
//! ONNX files with a manifest; nothing outside this room needs Burn.

mod alignment;
mod augmentation;
mod baseline;
mod batch;
mod budget;
mod checkpoint;
mod closings;
mod config;
mod course;
mod dataset;
mod device;
mod encodings;
mod error;
mod evaluation;
mod export;
mod finished;
mod held_out_pairs;
mod history;
mod landmarks;
mod learner;
mod look_alikes;
mod loss;
mod masks;
mod missed_grasps;
mod motion_to_go;
mod network;
mod normalisation;
mod objective;
mod observer;
mod patches;
mod preset;
mod reference;
mod run_folder;
mod sampler;
mod schedule;
#[cfg(test)]
mod synthetic;
mod trained_model;
mod trainer;
mod variant;
mod weights;

pub use baseline::{
    BaselineConfig, BaselineNetwork, BaselineOutputs, BaselineReport, TrainedBaseline,
    TransformerConfig, check_baseline_training, train_baseline, train_baseline_on,
};
pub use config::{
    AugmentationConfig, EncoderConfig, ImitationConfig, NetworkConfig, OptimiserConfig,
    SamplingConfig, TrainingConfig,
};
pub use dataset::{Dataset, Split, StateRef};
pub use device::training_device;
pub use error::TrainingError;
pub use export::{export, export_baseline, is_model_file};
pub use finished::FinishedModel;
pub use landmarks::{GripperPractice, LandmarkConfig, Practised};
pub use network::LatentFlowNetwork;
pub use normalisation::ChannelNormalisation;
pub use observer::{SilentObserver, StepLosses, TrainingEvent, TrainingObserver};
pub use preset::Preset;
pub use reference::ReferenceOutputs;
pub use run_folder::RunFolder;
pub use trained_model::TrainedModel;
pub use trainer::{TrainingReport, check_training, train, train_on};
pub use variant::NetworkVariant;
