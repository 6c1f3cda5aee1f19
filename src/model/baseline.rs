use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::manifest::{
    ManifestError, ManifestHead, file_digests, indented_json, sha256_hex, verify,
};
use super::{ActionDistribution, Latents, ModelError};
use crate::trajectory::{ActionSpace, CameraSpec, State};

/// The version of a baseline's manifest that this crate writes and reads.
pub const BASELINE_FORMAT_VERSION: u32 = 1;
/// What a baseline's manifest calls itself, so that it is not taken for a model's.
pub(super) const BASELINE_KIND: &str = "baseline";

/// An imitation-learning method without a graph, which our method is compared with (Fu & Finn, section
/// IV-A).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum BaselineMethod {
    /// Behavior cloning: the latents of all cameras and of the goal image to an action.
    #[serde(rename = "bc")]
    Bc,
    /// Behavior cloning over a history, kept by a recurrent network (a GRU).
    #[serde(rename = "bc_rnn")]
    BcRnn,
    /// A transformer over tokens of a history of images, without the language of the original.
    #[serde(rename = "rt1")]
    Rt1,
    /// Behavior cloning on features of a visual encoder that was trained elsewhere and stays as it is.
    #[serde(rename = "mvp")]
    Mvp,
}

impl BaselineMethod {
    /// All methods with the names that [`parse`](Self::parse) knows.
    pub const NAMES: [(&'static str, Self); 4] = [
        ("bc", Self::Bc),
        ("bc_rnn", Self::BcRnn),
        ("rt1", Self::Rt1),
        ("mvp", Self::Mvp),
    ];

    /// The method of a name.
    #[must_use]
    pub fn parse(name: &str) -> Option<Self> {
        let mut all = Self::NAMES.iter();
        all.find(|(known, _)| *known == name)
            .map(|(_, method)| *method)
    }

    /// Its name in files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Bc => "bc",
            Self::BcRnn => "bc_rnn",
            Self::Rt1 => "rt1",
            Self::Mvp => "mvp",
        }
    }

    /// Its name in the paper's tables.
    #[must_use]
    pub fn described(self) -> &'static str {
        match self {
            Self::Bc => "BC",
            Self::BcRnn => "BC-RNN",
            Self::Rt1 => "RT-1",
            Self::Mvp => "MVP",
        }
    }
}

impl fmt::Display for BaselineMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How a frozen encoder wants its pictures, and what it gives.
///
/// The encoder is an ONNX network with one input `f32 [n, 3, height, width]` (red, green, blue) and one
/// output `f32 [n, feature_dim]`. A picture is stretched to the input's size, and each value `v` (0..=255) is
/// given as `(v - mean) / deviation`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrozenPictures {
    /// Name of the network's input.
    pub input: String,
    /// Name of the network's output.
    pub output: String,
    /// Rows of a picture.
    pub height: u32,
    /// Columns of a picture.
    pub width: u32,
    /// Taken off red, green and blue values of 0..=255.
    pub mean: [f32; 3],
    /// What is left is divided by this; above 0.
    pub deviation: [f32; 3],
    /// Values that one picture gives.
    pub feature_dim: usize,
}

/// What a baseline takes and gives; stored in its manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaselineSpec {
    /// The method.
    pub method: BaselineMethod,
    /// The cameras in the order of their latents.
    pub cameras: Vec<CameraSpec>,
    /// How many frames make a state.
    pub stack: usize,
    /// Its actions.
    pub action_space: ActionSpace,
    /// How many of the last states it acts on.
    pub history: usize,
    /// Values in a state's latent: all cameras together.
    pub latent_dim: usize,
    /// How the pictures of a frozen encoder are made; none where the encoder was trained with the policy.
    #[serde(default)]
    pub frozen: Option<FrozenPictures>,
}

/// How well a baseline does on held-out demonstrations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BaselineValidation {
    /// Mean cross-entropy of the actions in nats, averaged over the heads.
    pub loss: f64,
    /// Share of the actions whose most probable class is right, averaged over the heads; 0..=1.
    pub accuracy: f64,
}

/// How a baseline was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaselineRecord {
    /// The training's configuration as it was used.
    pub config: serde_json::Value,
    /// The seed of everything random.
    pub seed: u64,
    /// The optimiser step whose weights were kept.
    pub step: u64,
    /// Digests of the demonstrations, by the name of their set.
    pub datasets: BTreeMap<String, String>,
    /// Measured on held-out demonstrations.
    pub validation: BaselineValidation,
}

/// What a baseline's folder holds, and how it came about; written last, as `manifest.json`.
///
/// Beside it lie `encoder.onnx` (as [`ENCODER_FILE`](super::ENCODER_FILE), or a frozen encoder as
/// [`FrozenPictures`] says) and `policy.onnx`: inputs `history` `[n, history * latent_dim]`, the oldest state
/// first, and `goal` `[n, latent_dim]`, output `logits` `[n, sum of the head sizes]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaselineManifest {
    /// Always `baseline`.
    pub kind: String,
    /// Version of this format.
    pub format_version: u32,
    /// What the baseline takes and gives.
    pub spec: BaselineSpec,
    /// SHA-256 of each file, in lower-case hexadecimal, by file name.
    pub files: BTreeMap<String, String>,
    /// How it was trained.
    pub training: BaselineRecord,
}

impl BaselineManifest {
    /// A manifest of files with their contents.
    #[must_use]
    pub fn new(spec: BaselineSpec, files: &[(&str, Vec<u8>)], training: BaselineRecord) -> Self {
        Self {
            kind: BASELINE_KIND.to_owned(),
            format_version: BASELINE_FORMAT_VERSION,
            spec,
            files: file_digests(files),
            training,
        }
    }

    /// Reads a manifest from its JSON text.
    ///
    /// # Errors
    /// [`ManifestError::Malformed`] for anything else, [`ManifestError::NoBaseline`] for a model's manifest,
    /// [`ManifestError::BaselineVersion`] for another format.
    pub fn from_json(json: &[u8]) -> Result<Self, ManifestError> {
        let head: ManifestHead = serde_json::from_slice(json)?;
        if head.kind.as_deref() != Some(BASELINE_KIND) {
            return Err(ManifestError::NoBaseline);
        }
        if head.format_version != BASELINE_FORMAT_VERSION {
            return Err(ManifestError::BaselineVersion {
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

    /// A digest of the baseline as a whole: two agree in it exactly when they compute the same.
    ///
    /// # Panics
    /// Never: every field has a JSON form.
    #[must_use]
    pub fn digest(&self) -> String {
        let what = (self.format_version, &self.spec, &self.files);
        sha256_hex(&serde_json::to_vec(&what).expect("a manifest has a JSON form"))
    }
}

/// A visual encoder that was trained elsewhere, such as on many pictures of the world (MVP in Fu & Finn,
/// section IV-A).
pub trait FeatureEncoder {
    /// How it wants its pictures, and what it gives.
    fn pictures(&self) -> &FrozenPictures;

    /// The ONNX file.
    fn file(&self) -> &[u8];

    /// Features of the newest frame of states, a row each: `feature_dim` values of each of the cameras, one
    /// camera after another.
    ///
    /// # Errors
    /// [`ModelError::CameraMissing`] when a state lacks a camera, [`ModelError::Engine`] when the network
    /// cannot be run.
    fn features(&self, states: &[State], cameras: &[CameraSpec]) -> Result<Latents, ModelError>;
}

/// A policy that acts on what it saw last and on a picture of the end of its task, without a plan
/// (Fu & Finn, section IV-A).
pub trait ReactivePolicy {
    /// What it takes and gives.
    fn spec(&self) -> &BaselineSpec;

    /// The latents of states, a row each, in the same order.
    ///
    /// # Errors
    /// [`ModelError::CameraMissing`] when a state lacks a camera or it has another size,
    /// [`ModelError::Engine`] when the network cannot be run.
    fn encode(&self, states: &[State]) -> Result<Latents, ModelError>;

    /// The action probabilities after the last states, whose latents are the rows of `history` (oldest
    /// first, [`BaselineSpec::history`] of them), on the way to the state with latent `goal`.
    ///
    /// # Errors
    /// [`ModelError::Length`] for more or fewer values, [`ModelError::Engine`] when the network cannot be run.
    fn act(&self, history: &Latents, goal: &[f32]) -> Result<ActionDistribution, ModelError>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ENCODER_FILE, ModelManifest};

    fn manifest() -> BaselineManifest {
        let spec = BaselineSpec {
            method: BaselineMethod::BcRnn,
            cameras: Vec::new(),
            stack: 2,
            action_space: ActionSpace::Primitives {
                names: vec!["left".into(), "right".into()],
            },
            history: 10,
            latent_dim: 8,
            frozen: None,
        };
        let record = BaselineRecord {
            config: serde_json::json!({"steps": 3}),
            seed: 7,
            step: 3,
            datasets: BTreeMap::new(),
            validation: BaselineValidation::default(),
        };
        BaselineManifest::new(spec, &[(ENCODER_FILE, b"weights".to_vec())], record)
    }

    #[test]
    fn names_are_those_of_serde_and_are_found_again() {
        for (name, method) in BaselineMethod::NAMES {
            assert_eq!(method.name(), name);
            assert_eq!(BaselineMethod::parse(name), Some(method));
            let json = serde_json::to_string(&method).unwrap();
            assert_eq!(json, format!("\"{name}\""));
        }
        assert_eq!(BaselineMethod::parse("ours"), None);
    }

    #[test]
    fn json_round_trip_keeps_everything_and_other_bytes_are_refused() {
        let written = manifest();
        let read = BaselineManifest::from_json(&written.to_json()).unwrap();
        assert_eq!(read, written);
        read.verify(ENCODER_FILE, b"weights").unwrap();
        assert!(read.verify(ENCODER_FILE, b"weightt").is_err());
        let other = br#"{"kind": "baseline", "format_version": 9}"#;
        let error = BaselineManifest::from_json(other).unwrap_err();
        assert!(matches!(error, ManifestError::BaselineVersion { found: 9 }));
    }

    #[test]
    fn a_model_and_a_baseline_are_not_taken_for_each_other() {
        let error = ModelManifest::from_json(&manifest().to_json()).unwrap_err();
        assert!(error.to_string().contains("--policy"), "{error}");
        let error = BaselineManifest::from_json(br#"{"format_version": 1}"#).unwrap_err();
        assert!(error.to_string().contains("--method"), "{error}");
    }
}
