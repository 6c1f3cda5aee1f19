use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::ModelSpec;

/// The manifest's version that this crate writes and reads.
pub const MODEL_FORMAT_VERSION: u32 = 1;
/// The manifest's file name in a model folder.
pub const MANIFEST_FILE: &str = "manifest.json";
/// One `f32 [n, 3 * stack, height, width]` input a camera, named by the camera: pixel values
/// 0..=255, oldest frame first, RGB within a frame. Output `latent` `[n, latent_dim]`.
pub const ENCODER_FILE: &str = "encoder.onnx";
/// Input `latent` `[n, latent_dim]`, outputs `from` and `to` `[n, projection_width]`.
pub const PROJECTION_FILE: &str = "projection.onnx";
/// Inputs `from` and `to` `[n, projection_width]`, output `logits` `[n, d_max]`; the logits are to be
/// divided by [`ModelManifest::temperature`] before the softmax.
pub const TRAVERSABILITY_FILE: &str = "traversability.onnx";
/// Inputs `from` and `goal` `[n, latent_dim]`, output `logits` `[n, sum of the head sizes]`.
pub const POLICY_FILE: &str = "policy.onnx";

/// What is known of the model's landmarks, a [`LandmarkBook`](super::LandmarkBook) as JSON; only where the encoder tells
/// landmarks.
pub const LANDMARKS_FILE: &str = "landmarks.json";

/// Why a manifest was refused, or a file beside it.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ManifestError {
    /// The text is no manifest.
    #[error("this is no model manifest: {source}")]
    Malformed {
        /// What serde says, with line and column.
        #[from]
        source: serde_json::Error,
    },
    /// The manifest was written by another version of the crate.
    #[error(
        "the model has format {found}, this version reads format {MODEL_FORMAT_VERSION}; \
         train it again or use a version of catena that knows format {found}"
    )]
    Version {
        /// The format that was found.
        found: u32,
    },
    /// A baseline where a model was wanted.
    #[error(
        "this is a baseline policy and no model: it has no traversability to plan with. Evaluate it with \
         `catena evaluate TASK --policy FOLDER`, or train a model with `catena train` without --method"
    )]
    IsBaseline,
    /// A model where a baseline was wanted.
    #[error(
        "this is a model with a traversability function and no baseline policy: name it in a task's YAML file \
         and run it without --policy, or train a baseline with `catena train --method bc`"
    )]
    NoBaseline,
    /// The baseline was written by another version of the crate.
    #[error(
        "the baseline has format {found}, this version reads format {}; train it again or use a version of \
         catena that knows format {found}",
        super::BASELINE_FORMAT_VERSION
    )]
    BaselineVersion {
        /// The format that was found.
        found: u32,
    },
    /// A file that the manifest does not name.
    #[error("the manifest does not name '{file}'; it names: {present}")]
    FileUnknown {
        /// The file that was asked for.
        file: String,
        /// What is named.
        present: String,
    },
    /// A file is not the one that was written with the manifest.
    #[error(
        "'{file}' has SHA-256 {found}, its manifest says {expected}; the file was damaged or belongs \
         to another model, so export or fetch the model again"
    )]
    DigestDiffers {
        /// The file.
        file: String,
        /// The manifest's digest.
        expected: String,
        /// The digest of the bytes that are there.
        found: String,
    },
}

/// What a trained model's folder holds, and how it came about; written last, as `manifest.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelManifest {
    /// Version of this format.
    pub format_version: u32,
    /// What the model takes and gives.
    pub spec: ModelSpec,
    /// Values in each of a state's two projections.
    pub projection_width: usize,
    /// Divides the traversability logits so that their softmax is calibrated on held-out pairs.
    pub temperature: f32,
    /// SHA-256 of each file, in lower-case hexadecimal, by file name.
    pub files: BTreeMap<String, String>,
    /// How the model was trained.
    pub training: TrainingRecord,
}

/// How a model was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingRecord {
    /// The training's configuration as it was used.
    pub config: serde_json::Value,
    /// The seed of everything random.
    pub seed: u64,
    /// The optimiser step whose weights were kept.
    pub step: u64,
    /// Digests of the demonstrations, by the name of their set.
    pub datasets: BTreeMap<String, String>,
    /// Measured on held-out demonstrations.
    pub validation: ValidationMetrics,
}

/// How well a model does on demonstrations that it was not trained on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ValidationMetrics {
    /// Mean traversability loss of the pairs, with the weight of far pairs.
    pub traversability_loss: f64,
    /// Share of the pairs whose most probable class is right, near and far pairs in equal numbers.
    pub traversability_accuracy: f64,
    /// Share of the far pairs that were taken for near ones.
    pub wormhole_rate: f64,
    /// The same share of those pairs of one demonstration that look most alike.
    #[serde(default)]
    pub look_alike_wormhole_rate: f64,
    /// Mean policy loss of the pairs and heads.
    pub policy_loss: f64,
    /// Share of the actions whose most probable class is right, averaged over the heads.
    pub policy_accuracy: f64,
    /// The same with goal states of the same phase in other held-out demonstrations of the task, as a
    /// robot is given them; `None` where no two held-out demonstrations go the same way.
    #[serde(default)]
    pub policy_accuracy_across: Option<f64>,
    /// Share of the pairs of a gripper that closed on nothing and one that holds its thing, of the same
    /// task and on the way to the same subgoal, that were taken for near; `None` where no held-out
    /// demonstration missed a grasp.
    #[serde(default)]
    pub missed_grasp_wormhole_rate: Option<f64>,
    /// Share of the variance of the motion to go that its head explains, the mean of all axes along which the
    /// demonstrations move; `None` where it was not learnt.
    #[serde(default)]
    pub motion_explained: Option<f64>,
    /// Median distance, in pixels, between where a landmark is told to be and where it is, of held-out states that
    /// show one; `None` where none were learnt.
    #[serde(default)]
    pub landmark_error_pixels: Option<f64>,
}

impl ModelManifest {
    /// Reads a manifest from its JSON text.
    ///
    /// # Errors
    /// [`ManifestError::Malformed`] for anything else, [`ManifestError::Version`] for another format,
    /// [`ManifestError::IsBaseline`] for the manifest of a baseline.
    pub fn from_json(json: &[u8]) -> Result<Self, ManifestError> {
        let head: ManifestHead = serde_json::from_slice(json)?;
        if head.kind.is_some() {
            return Err(ManifestError::IsBaseline);
        }
        if head.format_version != MODEL_FORMAT_VERSION {
            return Err(ManifestError::Version {
                found: head.format_version,
            });
        }
        Ok(serde_json::from_slice(json)?)
    }

    /// The manifest as indented JSON; the same manifest gives the same bytes.
    ///
    /// # Panics
    /// Never: every field has a JSON form.
    #[must_use]
    pub fn to_json(&self) -> Vec<u8> {
        indented_json(self).expect("a manifest has a JSON form")
    }

    /// Checks that the bytes of a file are those that the manifest was written with.
    ///
    /// # Errors
    /// [`ManifestError::FileUnknown`], [`ManifestError::DigestDiffers`].
    pub fn verify(&self, file: &str, bytes: &[u8]) -> Result<(), ManifestError> {
        verify(&self.files, file, bytes)
    }

    /// A digest of the model as a whole: of its specification, temperature and files, so that two
    /// models agree in it exactly when they compute the same.
    ///
    /// # Panics
    /// Never: every field has a JSON form.
    #[must_use]
    pub fn digest(&self) -> String {
        let what = (
            self.format_version,
            &self.spec,
            self.temperature,
            &self.files,
        );
        sha256_hex(&serde_json::to_vec(&what).expect("a manifest has a JSON form"))
    }
}

/// What tells manifests apart before anything else of them is read.
#[derive(Deserialize)]
pub(super) struct ManifestHead {
    pub(super) format_version: u32,
    /// Only baselines say what they are.
    #[serde(default)]
    pub(super) kind: Option<String>,
}

pub(super) fn verify(
    files: &BTreeMap<String, String>,
    file: &str,
    bytes: &[u8],
) -> Result<(), ManifestError> {
    let Some(expected) = files.get(file) else {
        return Err(ManifestError::FileUnknown {
            file: file.to_owned(),
            present: files.keys().cloned().collect::<Vec<_>>().join(", "),
        });
    };
    let found = sha256_hex(bytes);
    if found == *expected {
        return Ok(());
    }
    Err(ManifestError::DigestDiffers {
        file: file.to_owned(),
        expected: expected.clone(),
        found,
    })
}

/// Indented JSON, with an end to its last line.
///
/// # Errors
/// Where a value has no JSON form.
pub(crate) fn indented_json(value: &impl Serialize) -> Result<Vec<u8>, serde_json::Error> {
    let mut json = serde_json::to_vec_pretty(value)?;
    json.push(b'\n');
    Ok(json)
}

/// SHA-256 of files, by their names.
pub(crate) fn file_digests(files: &[(&str, Vec<u8>)]) -> BTreeMap<String, String> {
    files
        .iter()
        .map(|(name, bytes)| ((*name).to_owned(), sha256_hex(bytes)))
        .collect()
}

/// SHA-256 in lower-case hexadecimal.
#[must_use]
pub fn sha256_hex(bytes: &[u8]) -> String {
    use std::fmt::Write;
    Sha256::digest(bytes)
        .iter()
        .fold(String::with_capacity(64), |mut hex, byte| {
            let _ = write!(hex, "{byte:02x}");
            hex
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{ActionSpace, CameraSpec};

    fn manifest() -> ModelManifest {
        ModelManifest {
            format_version: MODEL_FORMAT_VERSION,
            spec: ModelSpec {
                cameras: vec![CameraSpec {
                    name: "head".into(),
                    height: 9,
                    width: 16,
                }],
                stack: 2,
                action_space: ActionSpace::Primitives {
                    names: vec!["left".into(), "right".into()],
                },
                d_max: 5,
                latent_dim: 8,
            },
            projection_width: 16,
            temperature: 1.25,
            files: [(ENCODER_FILE.to_owned(), sha256_hex(b"weights"))].into(),
            training: TrainingRecord {
                config: serde_json::json!({"steps": 3}),
                seed: 7,
                step: 3,
                datasets: [("toy".to_owned(), "ab".to_owned())].into(),
                validation: ValidationMetrics::default(),
            },
        }
    }

    #[test]
    fn json_round_trip_keeps_everything() {
        let written = manifest();
        let read = ModelManifest::from_json(&written.to_json()).unwrap();
        assert_eq!(read, written);
        assert_eq!(read.digest(), written.digest());
    }

    #[test]
    fn another_format_is_named_even_when_its_fields_differ() {
        let error = ModelManifest::from_json(br#"{"format_version": 99}"#).unwrap_err();
        assert!(matches!(error, ManifestError::Version { found: 99 }));
    }

    #[test]
    fn a_flipped_byte_is_refused_with_both_digests() {
        let manifest = manifest();
        manifest.verify(ENCODER_FILE, b"weights").unwrap();
        let error = manifest.verify(ENCODER_FILE, b"weightt").unwrap_err();
        assert!(error.to_string().contains(&sha256_hex(b"weightt")));
        assert!(error.to_string().contains(&sha256_hex(b"weights")));
        assert!(matches!(
            manifest.verify("other.onnx", b""),
            Err(ManifestError::FileUnknown { .. })
        ));
    }

    #[test]
    fn digest_follows_the_weights_and_not_the_training_record() {
        let first = manifest();
        let mut second = first.clone();
        second.training.seed = 8;
        assert_eq!(first.digest(), second.digest());
        second.files.insert(POLICY_FILE.into(), "00".into());
        assert_ne!(first.digest(), second.digest());
    }
}
