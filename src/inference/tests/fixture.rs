use std::collections::BTreeMap;
use std::sync::Arc;

use tempfile::TempDir;

use super::onnx::Network;
use crate::model::{
    ENCODER_FILE, MANIFEST_FILE, MODEL_FORMAT_VERSION, ModelManifest, ModelSpec, POLICY_FILE,
    PROJECTION_FILE, TRAVERSABILITY_FILE, TrainingRecord, ValidationMetrics, sha256_hex,
};
use crate::trajectory::{ActionDimension, ActionSpace, CameraSpec, Image, Observation, State};

/// Two cameras, two frames, three colours.
pub const DIM: usize = 12;
pub const TEMPERATURE: f32 = 2.0;
const CLASSES: usize = 3;
const ACTIONS: usize = 5;

/// The latent is the mean of every plane.
fn encoder() -> Vec<u8> {
    Network::default()
        .input("head", &[6, 2, 3])
        .input("wrist", &[6, 4, 3])
        .node("GlobalAveragePool", &["head"], "head_mean")
        .node("GlobalAveragePool", &["wrist"], "wrist_mean")
        .node("Flatten", &["head_mean"], "head_row")
        .node("Flatten", &["wrist_mean"], "wrist_row")
        .node("Concat", &["head_row", "wrist_row"], "latent")
        .output("latent", &[DIM])
        .model()
}

/// A state as `from` is its negative, as `to` it is itself.
fn projection() -> Vec<u8> {
    let diagonal = |value: f32| -> Vec<f32> {
        (0..DIM * DIM)
            .map(|i| if i % (DIM + 1) == 0 { value } else { 0.0 })
            .collect()
    };
    Network::default()
        .input("latent", &[DIM])
        .constant("negative", &[DIM, DIM], &diagonal(-1.0))
        .constant("itself", &[DIM, DIM], &diagonal(1.0))
        .constant("nothing", &[DIM], &[0.0; DIM])
        .node("Gemm", &["latent", "negative", "nothing"], "from")
        .node("Gemm", &["latent", "itself", "nothing"], "to")
        .output("from", &[DIM])
        .output("to", &[DIM])
        .model()
}

/// The first logit is the first value of the difference where it is positive; the others are 0.
fn traversability() -> Vec<u8> {
    let mut weights = [0.0; DIM * CLASSES];
    weights[0] = 1.0;
    Network::default()
        .input("from", &[DIM])
        .input("to", &[DIM])
        .constant("weights", &[DIM, CLASSES], &weights)
        .constant("bias", &[CLASSES], &[0.0; CLASSES])
        .node("Add", &["from", "to"], "difference")
        .node("Relu", &["difference"], "positive")
        .node("Gemm", &["positive", "weights", "bias"], "logits")
        .output("logits", &[CLASSES])
        .model()
}

/// The last logit is the first value of the difference; the others are 0.
fn policy() -> Vec<u8> {
    let mut weights = [0.0; DIM * ACTIONS];
    weights[ACTIONS - 1] = 1.0;
    Network::default()
        .input("from", &[DIM])
        .input("goal", &[DIM])
        .constant("weights", &[DIM, ACTIONS], &weights)
        .constant("bias", &[ACTIONS], &[0.0; ACTIONS])
        .node("Sub", &["goal", "from"], "difference")
        .node("Gemm", &["difference", "weights", "bias"], "logits")
        .output("logits", &[ACTIONS])
        .model()
}

fn spec() -> ModelSpec {
    let camera = |name: &str, height| CameraSpec {
        name: name.to_owned(),
        height,
        width: 3,
    };
    let dimension = |name: &str, bins| ActionDimension::uniform(name, -1.0, 1.0, bins);
    ModelSpec {
        cameras: vec![camera("head", 2), camera("wrist", 4)],
        stack: 2,
        action_space: ActionSpace::Binned {
            dimensions: vec![dimension("x", 2), dimension("y", 3)],
        },
        d_max: CLASSES,
        latent_dim: DIM,
    }
}

fn write(networks: [(&str, Vec<u8>); 4]) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut files = BTreeMap::new();
    for (name, bytes) in networks {
        files.insert(name.to_owned(), sha256_hex(&bytes));
        std::fs::write(folder.path().join(name), bytes).expect("writing a network");
    }
    let manifest = ModelManifest {
        format_version: MODEL_FORMAT_VERSION,
        spec: spec(),
        projection_width: DIM,
        temperature: TEMPERATURE,
        files,
        training: TrainingRecord {
            config: serde_json::Value::Null,
            seed: 0,
            step: 0,
            datasets: BTreeMap::new(),
            validation: ValidationMetrics::default(),
        },
    };
    std::fs::write(folder.path().join(MANIFEST_FILE), manifest.to_json()).expect("writing it");
    folder
}

pub fn model_folder() -> TempDir {
    write([
        (ENCODER_FILE, encoder()),
        (PROJECTION_FILE, projection()),
        (TRAVERSABILITY_FILE, traversability()),
        (POLICY_FILE, policy()),
    ])
}

pub fn model_folder_with_swapped_networks() -> TempDir {
    write([
        (ENCODER_FILE, encoder()),
        (PROJECTION_FILE, projection()),
        (TRAVERSABILITY_FILE, traversability()),
        (POLICY_FILE, traversability()),
    ])
}

/// A state whose planes are uniform: red has the value given, green one and blue two more.
pub fn grey_state(head: u8, wrist: u8) -> State {
    let image = |height: u32, red: u8| {
        let pixels = [red, red + 1, red + 2].repeat(height as usize * 3);
        Image::new(height, 3, pixels).expect("it is full")
    };
    let observation = Observation::new([
        ("wrist".to_owned(), image(4, wrist)),
        ("head".to_owned(), image(2, head)),
    ]);
    State::from_history(&[Arc::new(observation)], 2)
}
