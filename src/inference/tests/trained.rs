//! What the trainer exports computes here what it computed there.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::near;
use crate::inference::{EngineChoice, Model};
use crate::model::{Encoder, LocalPolicy, Traversability};
use crate::training::{
    Dataset, LandmarkConfig, NetworkVariant, Preset, ReferenceOutputs, TrainedModel,
    TrainingConfig, export,
};
use crate::trajectory::{
    Action, ActionSpace, DemonstrationSet, Image, Observation, State, Step, Trajectory,
};

const STEPS: usize = 21;

/// Two cameras of different sizes, with pictures in which every pixel differs.
pub fn demonstration() -> Trajectory {
    seen_by(["wrist", "head"])
}

fn seen_by(cameras: [&str; 2]) -> Trajectory {
    let image = |height: u32, width: u32, step: usize| {
        let rgb: Vec<u8> = (0..(height * width * 3) as usize)
            .map(|i| ((i * 37 + step * 101 + i / 7 * step) % 256) as u8)
            .collect();
        Image::new(height, width, rgb).expect("it is full")
    };
    let steps = (0..STEPS)
        .map(|step| {
            let observation = Observation::new([
                (cameras[0].to_owned(), image(16, 16, step + 50)),
                (cameras[1].to_owned(), image(16, 24, step)),
            ]);
            Step {
                time_secs: step as f64,
                observation: Arc::new(observation),
                action: Action::Primitive(step % 3),
            }
        })
        .collect();
    Trajectory {
        id: "one".to_owned(),
        task: "toy".to_owned(),
        action_space: ActionSpace::Primitives {
            names: ["left", "right", "stay"].map(String::from).to_vec(),
        },
        steps,
        markers: Vec::new(),
    }
}

pub fn softmax(row: &[f32], temperature: f32) -> Vec<f32> {
    let weights: Vec<f32> = row.iter().map(|v| (v / temperature).exp()).collect();
    let sum: f32 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

pub fn assert_near(what: &str, found: &[f32], expected: &[f32]) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (i, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!(near(*a, *b), "{what} {i}: {a} here, {b} in training");
    }
}

/// A folder with an exported network of random weights, the same in every process, and states for it.
pub fn exported() -> (tempfile::TempDir, Vec<State>) {
    let (trained, states, ..) = trained(demonstration(), &Preset::Tiny.config());
    let folder = tempfile::tempdir().expect("a temporary folder");
    export(&trained, BTreeMap::new(), folder.path()).expect("the folder can be written");
    (folder, states)
}

fn trained(
    trajectory: Trajectory,
    config: &TrainingConfig,
) -> (TrainedModel, Vec<State>, Vec<(u32, u32)>, ReferenceOutputs) {
    let states: Vec<State> = (0..STEPS)
        .map(|s| trajectory.state(s, config.stack))
        .collect();
    let again = Trajectory {
        id: "two".to_owned(),
        ..trajectory.clone()
    };
    let set = DemonstrationSet::new("toy", vec![trajectory, again]).expect("they agree");
    let data = Dataset::new(&[set]).expect("a set that agrees with itself");
    let mut model = TrainedModel::untrained(&data, config);
    model.temperature = 1.7;
    let pairs: Vec<(u32, u32)> = (0..STEPS as u32)
        .map(|i| (i, i * 5 % STEPS as u32))
        .collect();
    let reference = model
        .reference_outputs(&states, &pairs)
        .expect("the states fit");
    (model, states, pairs, reference)
}

#[test]
fn exported_networks_agree_with_burn() {
    for (_, variant) in NetworkVariant::NAMES {
        let mut config = Preset::Tiny.config();
        config.network.variant = variant;
        agrees_with_burn(&config);
    }
}

#[test]
fn a_network_that_tells_the_motion_to_go_agrees_with_burn() {
    let mut config = Preset::Tiny.config();
    config.motion_weight = 1.0;
    agrees_with_burn(&config);
}

#[test]
fn a_network_that_finds_landmarks_agrees_with_burn() {
    for stages in [vec![8], vec![8, 8]] {
        let mut config = Preset::Tiny.config();
        config.landmarks = Some(LandmarkConfig::bedroom());
        config.network.encoder.stage_channels = stages;
        agrees_with_burn(&config);
    }
}

#[test]
fn cameras_that_are_called_like_values_and_weights_agree_with_burn() {
    for cameras in [["v1", "w0"], ["w3", "v4"]] {
        agrees_when_shown(seen_by(cameras), &Preset::Tiny.config());
    }
}

fn agrees_with_burn(config: &TrainingConfig) {
    agrees_when_shown(demonstration(), config);
}

fn agrees_when_shown(trajectory: Trajectory, config: &TrainingConfig) {
    let (trained, states, pairs, reference) = trained(trajectory, config);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path().join("model");
    export(&trained, BTreeMap::new(), &folder).expect("the folder can be written");
    let model = Model::load(&folder, EngineChoice::Auto).expect("a model that was just exported");

    let latents = model.encode(&states).expect("the states fit");
    assert_near("latent", latents.values(), reference.latents.values());
    let projections = model.project(&latents).expect("the latents fit");
    assert_near("from", projections.from.values(), reference.from.values());
    assert_near("to", projections.to.values(), reference.to.values());
    let steps = model
        .predict(&projections, &projections, &pairs)
        .expect("the rows exist");
    for (pair, (from, to)) in pairs.iter().enumerate() {
        let expected = softmax(reference.traversability.row(pair), 1.7);
        assert_near("traversability", steps.row(pair), &expected);
        let (from, to) = (latents.row(*from as usize), latents.row(*to as usize));
        let actions = model.act(from, to).expect("the latents fit");
        assert_near(
            "policy",
            &actions.heads[0],
            &softmax(reference.policy.row(pair), 1.0),
        );
    }
}
