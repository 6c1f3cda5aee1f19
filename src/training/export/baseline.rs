use std::collections::BTreeMap;
use std::path::Path;

use super::folder::write_folder;
use super::graphs::{camera_encoder, dense, of_cameras};
use super::onnx::{Attribute, OnnxGraph};
use super::{gated_unit, tokens, transformer};
use crate::model::{BaselineManifest, BaselineRecord, ENCODER_FILE, POLICY_FILE};
use crate::training::TrainingError;
use crate::training::baseline::{LayerNorm, NORM_EPSILON, Perceptron, TrainedBaseline};
use crate::training::evaluation::values;

/// Writes a baseline as ONNX files with a manifest, and returns the manifest. A frozen encoder is copied as
/// it is.
///
/// The folder takes the place of an older one as for [`export`](fn@crate::training::export). `datasets` are digests of the
/// demonstrations by the name of their set; they are kept in the manifest.
///
/// # Errors
/// [`TrainingError::Io`] when a file cannot be written, [`TrainingError::ModelInUse`] while another process writes the
/// folder.
///
/// # Panics
/// Never: a configuration has a JSON form.
pub fn export_baseline(
    baseline: &TrainedBaseline,
    datasets: BTreeMap<String, String>,
    folder: &Path,
) -> Result<BaselineManifest, TrainingError> {
    let encoder = match &baseline.frozen {
        Some(file) => file.clone(),
        None => encoder(baseline),
    };
    let files = [(ENCODER_FILE, encoder), (POLICY_FILE, policy(baseline))];
    let record = BaselineRecord {
        config: serde_json::to_value(&baseline.config).expect("a configuration has a JSON form"),
        seed: baseline.config.seed,
        step: baseline.step,
        datasets,
        validation: baseline.validation,
    };
    let manifest = BaselineManifest::new(baseline.spec.clone(), &files, record);
    write_folder(folder, &files, &manifest.to_json())?;
    Ok(manifest)
}

/// `encoder.onnx`: raw pixel values of each camera to the latent.
fn encoder(baseline: &TrainedBaseline) -> Vec<u8> {
    let network = &baseline.network;
    of_cameras(
        &baseline.pictures(),
        baseline.spec.latent_dim,
        None,
        |graph, camera, grid, input| {
            if let Some(encoder) = network.encoders.get(camera) {
                return camera_encoder(graph, encoder, grid, input);
            }
            let encoder = &network.token_encoders[camera];
            (tokens::token_encoder(graph, encoder, grid, input), None)
        },
    )
}

/// `policy.onnx`: latents of the last states and of the goal to the logits of the actions.
fn policy(baseline: &TrainedBaseline) -> Vec<u8> {
    let mut graph = OnnxGraph::default();
    let (spec, network) = (&baseline.spec, &baseline.network.policy);
    let history = graph.input("history", &[spec.history * spec.latent_dim]);
    let goal = graph.input("goal", &[spec.latent_dim]);
    let logits = if let Some(of_tokens) = &network.transformer {
        transformer::transformer(&mut graph, of_tokens, &history, &goal)
    } else {
        let now = match &network.memory {
            Some(unit) => {
                gated_unit::gated_unit(&mut graph, unit, &history, [spec.history, spec.latent_dim])
            }
            None => history,
        };
        let perceptron_of = network.perceptron.as_ref();
        let found = perceptron_of.map(|p| perceptron(&mut graph, p, &now, &goal));
        found.expect("all but RT-1 have a perceptron")
    };
    let classes = spec.action_space.head_sizes().iter().sum();
    graph.output("logits", &logits, &[classes]);
    graph.into_model("policy")
}

fn perceptron(graph: &mut OnnxGraph, perceptron: &Perceptron, now: &str, goal: &str) -> String {
    let mut even = |x: &str| match &perceptron.norm {
        Some(norm) => layer_norm(graph, norm, x, 1),
        None => x.to_owned(),
    };
    let (now, goal) = (even(now), even(goal));
    let both = graph.node("Concat", &[&now, &goal], &[Attribute::Int("axis", 1)]);
    let first = dense(graph, &perceptron.first, &both);
    let first = graph.node("Relu", &[&first], &[]);
    let second = dense(graph, &perceptron.second, &first);
    let second = graph.node("Relu", &[&second], &[]);
    dense(graph, &perceptron.output, &second)
}

/// A layer norm along the last axis, in the operators that every engine knows.
pub fn layer_norm(graph: &mut OnnxGraph, norm: &LayerNorm, x: &str, axis: usize) -> String {
    let along = [Attribute::Ints("axes", &[axis])];
    let mean = graph.node("ReduceMean", &[x], &along);
    let centred = graph.node("Sub", &[x, &mean], &[]);
    let squares = graph.node("Mul", &[&centred, &centred], &[]);
    let variance = graph.node("ReduceMean", &[&squares], &along);
    let epsilon = graph.constant(&[1], &[NORM_EPSILON]);
    let finite = graph.node("Add", &[&variance, &epsilon], &[]);
    let deviation = graph.node("Sqrt", &[&finite], &[]);
    let even = graph.node("Div", &[&centred, &deviation], &[]);
    let width = norm.gain.val().dims()[0];
    let gain = graph.constant(&[width], &values(norm.gain.val()));
    let bias = graph.constant(&[width], &values(norm.bias.val()));
    let scaled = graph.node("Mul", &[&even, &gain], &[]);
    graph.node("Add", &[&scaled, &bias], &[])
}
