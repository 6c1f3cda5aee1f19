//! Trained networks behind the traits of [`model`](crate::model), run through ONNX.
//!
//! A process computes with one of two engines: the native ONNX Runtime where its library is found, or
//! the one that is compiled in and needs nothing. [`Model::load`] checks every file against the
//! model's manifest before an engine sees it, and [`Baseline::load`] does so with a baseline's.

mod baseline;
mod contract;
mod engine;
mod error;
mod frozen_encoder;
mod loader;
mod model;
mod network;
mod pixels;

pub use baseline::Baseline;
pub use engine::{Engine, EngineChoice, EngineKind};
pub use error::InferenceError;
pub use frozen_encoder::FrozenEncoder;
pub use model::Model;

#[cfg(test)]
mod tests;
