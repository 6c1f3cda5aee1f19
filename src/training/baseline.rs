//! The imitation-learning baselines that our method is compared with (Fu & Finn, section IV-A).
//!
//! All four have one shape: an encoder turns each state into a latent, and a policy turns the latents of the
//! last states and of a goal image, the end of a demonstration of the task, into an action. What differs is the
//! [network](BaselineNetwork) and, of RT-1 and MVP, the encoder. [`train_baseline`] fits one,
//! [`export_baseline`](super::export_baseline) writes it as ONNX.

mod batch;
mod config;
mod dropout;
mod layers;
mod network;
mod objective;
mod reference;
mod sampler;
mod source;
mod token_encoder;
mod trained;
mod trainer;
mod transformer;
mod validation;

pub use config::{BaselineConfig, TransformerConfig};
pub use layers::{GatedUnit, LayerNorm, NORM_EPSILON, Perceptron};
pub use network::BaselineNetwork;
pub use reference::BaselineOutputs;
pub use token_encoder::TokenEncoder;
pub use trained::TrainedBaseline;
pub use trainer::{BaselineReport, check_baseline_training, train_baseline, train_baseline_on};
pub use transformer::{Block, CausalTransformer};

#[cfg(test)]
mod tests;
