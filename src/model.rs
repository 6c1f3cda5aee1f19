//! What the rest of the house asks of a learned model: encode states, predict traversability, act
//! towards a nearby goal. No framework is named here; `inference` implements these traits.

mod baseline;
mod encoder;
mod error;
mod grasp_sense;
mod landmark_book;
mod latents;
mod manifest;
mod policy;
mod spec;
mod temperature;
mod traversability;

pub use baseline::{
    BASELINE_FORMAT_VERSION, BaselineManifest, BaselineMethod, BaselineRecord, BaselineSpec,
    BaselineValidation, FeatureEncoder, FrozenPictures, ReactivePolicy,
};
pub use encoder::Encoder;
pub use error::ModelError;
pub(crate) use grasp_sense::grasp_values;
pub use grasp_sense::{GraspSense, GraspSight};
pub(crate) use landmark_book::median;
pub use landmark_book::{
    HIDDEN_M, LANDMARK_VALUES, Landmark, LandmarkBook, LandmarkSight, LandmarkView,
};
pub use latents::Latents;
pub use manifest::{
    ENCODER_FILE, LANDMARKS_FILE, MANIFEST_FILE, MODEL_FORMAT_VERSION, ManifestError,
    ModelManifest, POLICY_FILE, PROJECTION_FILE, TRAVERSABILITY_FILE, TrainingRecord,
    ValidationMetrics, sha256_hex,
};
pub(crate) use manifest::{file_digests, indented_json};
pub use policy::{ActionDistribution, LocalPolicy};
pub use spec::ModelSpec;
pub use temperature::temper;
pub(crate) use temperature::{best_temperature, most_probable, softmax};
pub(crate) use traversability::BLOCK_PAIRS;
pub use traversability::{Projections, StepDistributions, Traversability, predict_in_blocks};
