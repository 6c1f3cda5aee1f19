//! Writes a trained network, ours or a baseline, as ONNX files with a manifest.

mod alone;
mod baseline;
mod files;
mod folder;
mod gated_unit;
mod graphs;
mod names;
mod onnx;
mod tokens;
mod transformer;

pub use baseline::export_baseline;
pub use files::export;
pub(super) use files::write_beside;
pub use folder::is_model_file;
pub(super) use folder::{recover_folder, write_folder};
pub(super) use names::check_camera_names;
