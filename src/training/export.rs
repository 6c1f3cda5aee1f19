//! Writes a trained network as ONNX files with a manifest.

mod files;
mod graphs;
mod onnx;

pub use files::export;
pub(super) use files::write_beside;
