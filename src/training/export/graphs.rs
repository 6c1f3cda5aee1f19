use burn::tensor::Tensor;

use super::names::LATENT;
use super::onnx::{Attribute, OnnxGraph};
use crate::model::LANDMARK_VALUES;
use crate::training::TrainedModel;
use crate::training::batch::Pictures;
use crate::training::evaluation::values;
use crate::training::network::{
    CameraEncoder, Dense, FlowHead, HeadKind, Keypoints, Landmarks, MotionHead, PEAK_GAIN,
    ResidualBlock, Stage, coordinate_values, place_values,
};
use crate::training::patches::PatchGrid;

/// `encoder.onnx`: raw pixel values of each camera to the latent. Normalisation is inside.
pub fn encoder(model: &TrainedModel) -> Vec<u8> {
    let encoders = &model.network.encoders;
    let (pictures, latent_dim) = (model.pictures(), model.spec.latent_dim);
    if !model.network.joins_pixels() {
        return of_cameras(
            &pictures,
            latent_dim,
            model.network.motion.as_ref(),
            |graph, camera, grid, input| camera_encoder(graph, &encoders[camera], grid, input),
        );
    }
    let mut graph = OnnxGraph::default();
    let inputs = normalised_inputs(&mut graph, &pictures);
    let mut parts = Vec::new();
    for half in [Half::Left, Half::Reached] {
        let cameras = encoders.iter().zip(&pictures.grids).zip(&inputs);
        for ((encoder, grid), input) in cameras {
            parts.push(half_map(&mut graph, encoder, grid, input, half));
        }
    }
    let latent = concat(&mut graph, &parts);
    graph.output(LATENT, &latent, &[latent_dim]);
    graph.into_model("encoder")
}

/// A network from the raw pixel values of each camera to one latent; `encode` adds what turns the normalised
/// values of a camera into its part, and into landmarks that are not for the heads, and `told` what the latent tells
/// of the motion to go.
pub fn of_cameras(
    pictures: &Pictures,
    latent_dim: usize,
    told: Option<&MotionHead>,
    encode: impl Fn(&mut OnnxGraph, usize, &PatchGrid, &str) -> (String, Option<String>),
) -> Vec<u8> {
    let mut graph = OnnxGraph::default();
    let inputs = normalised_inputs(&mut graph, pictures);
    let cameras = pictures.grids.iter().zip(&inputs).enumerate();
    let (parts, landmarks): (Vec<String>, Vec<Option<String>>) = cameras
        .map(|(camera, (grid, input))| encode(&mut graph, camera, grid, input))
        .unzip();
    let mut latent = concat(&mut graph, &parts);
    if let Some(head) = told {
        let motion = motion(&mut graph, head, &latent);
        latent = concat(&mut graph, &[latent, motion]);
    }
    let landmarks = landmarks.into_iter().flatten();
    let all: Vec<String> = [latent].into_iter().chain(landmarks).collect();
    let latent = concat(&mut graph, &all);
    graph.output(LATENT, &latent, &[latent_dim]);
    graph.into_model("encoder")
}

/// The motion to go from the latent.
fn motion(graph: &mut OnnxGraph, head: &MotionHead, latent: &str) -> String {
    let hidden = dense(graph, &head.hidden, latent);
    let hidden = graph.node("Relu", &[&hidden], &[]);
    dense(graph, &head.output, &hidden)
}

/// An input for each camera, and its values normalised.
fn normalised_inputs(graph: &mut OnnxGraph, pictures: &Pictures) -> Vec<String> {
    let cameras = pictures.names.iter().zip(&pictures.grids);
    let inputs: Vec<String> = cameras
        .map(|(name, grid)| graph.input(name, &[3 * grid.stack, grid.height, grid.width]))
        .collect();
    let mut normalised = Vec::new();
    for (camera, input) in inputs.iter().enumerate() {
        let channels = 3 * pictures.grids[camera].stack;
        let normalisation = &pictures.normalisation[camera];
        let of_channels = |value: &dyn Fn(usize) -> f32| -> Vec<f32> {
            (0..channels).map(|c| value(c % 3)).collect()
        };
        let shape = [1, channels, 1, 1];
        let mean = graph.constant(&shape, &of_channels(&|c| normalisation.mean[c]));
        let deviation = graph.constant(&shape, &of_channels(&|c| normalisation.deviation[c]));
        let centred = graph.node("Sub", &[input, &mean], &[]);
        normalised.push(graph.node("Div", &[&centred, &deviation], &[]));
    }
    normalised
}

/// Values `[n, ...]` one after another.
fn concat(graph: &mut OnnxGraph, parts: &[String]) -> String {
    let names: Vec<&str> = parts.iter().map(String::as_str).collect();
    match names.as_slice() {
        [one] => (*one).to_owned(),
        _ => graph.node("Concat", &names, &[Attribute::Int("axis", 1)]),
    }
}

/// The latent of one camera from its normalised values, and the landmarks where they are told.
pub fn camera_encoder(
    graph: &mut OnnxGraph,
    encoder: &CameraEncoder,
    grid: &PatchGrid,
    input: &str,
) -> (String, Option<String>) {
    let (weight, bias) = (encoder.stem.weight.val(), encoder.stem.bias.val());
    let seen = stem(graph, weight, Some(bias), grid, input);
    camera_latent(graph, encoder, &seen)
}

/// Which of the two states of a pair.
#[derive(Clone, Copy)]
enum Half {
    Left,
    Reached,
}

/// The first layer's map of a state as one of a pair, flattened.
fn half_map(
    graph: &mut OnnxGraph,
    encoder: &CameraEncoder,
    grid: &PatchGrid,
    input: &str,
    half: Half,
) -> String {
    let (from, to) = encoder.halves();
    let map = match half {
        Half::Left => stem(graph, from, Some(encoder.stem.bias.val()), grid, input),
        Half::Reached => stem(graph, to, None, grid, input),
    };
    graph.node("Flatten", &[&map], &[Attribute::Int("axis", 1)])
}

/// From what the first layer made of a state, or of a pair, to the latent, and to the landmarks where they are told.
fn camera_latent(
    graph: &mut OnnxGraph,
    encoder: &CameraEncoder,
    seen: &str,
) -> (String, Option<String>) {
    let maps = after_first_layer(graph, &encoder.stages, seen);
    let (first, x) = (&maps[1.min(maps.len() - 1)], &maps[maps.len() - 1]);
    let places = encoder.keypoints.as_ref().map(|found| {
        let size = [encoder.rows / 2, encoder.columns / 2];
        keypoints(graph, found, size, first)
    });
    let flat = graph.node("Flatten", &[x], &[Attribute::Int("axis", 1)]);
    let mut latent = latent(graph, encoder, &flat);
    if let Some(places) = places {
        latent = graph.node("Add", &[&latent, &places], &[]);
    }
    let size = [encoder.rows, encoder.columns];
    let told = (encoder.landmarks.as_ref()).map(|found| landmarks(graph, found, size, &maps));
    (latent, told)
}

/// The values of landmarks, `[n, 3 * count]`, from the maps of the first layer and of each stage.
fn landmarks(
    graph: &mut OnnxGraph,
    landmarks: &Landmarks,
    [rows, columns]: [usize; 2],
    maps: &[String],
) -> String {
    let (count, cells) = (landmarks.count(), rows * columns);
    let flat = graph.shape(&[0, count, cells]);
    let own = on_each_cell(graph, &landmarks.own, &maps[0]);
    let own = graph.node("Reshape", &[&own, &flat], &[]);
    let hidden = on_each_cell(graph, &landmarks.hidden, &maps[1]);
    let hidden = graph.node("Relu", &[&hidden], &[]);
    let quarters = on_each_cell(graph, &landmarks.quarters, &hidden);
    let apart = graph.shape(&[0, 2, 2, count, rows / 2, columns / 2]);
    let quarters = graph.node("Reshape", &[&quarters, &apart], &[]);
    let order = [Attribute::Ints("perm", &[0, 3, 4, 1, 5, 2])];
    let quarters = graph.node("Transpose", &[&quarters], &order);
    let quarters = graph.node("Reshape", &[&quarters, &flat], &[]);
    let mut logits = graph.node("Add", &[&own, &quarters], &[]);
    if let Some(around) = &landmarks.around {
        let side = 4;
        let few = on_each_cell(graph, around, &maps[2]);
        let blocks = graph.shape(&[0, count, rows / side, 1, columns / side, 1]);
        let few = graph.node("Reshape", &[&few, &blocks], &[]);
        let nothing = graph.constant(&[1, 1, 1, side, 1, side], &vec![0.0; side * side]);
        let many = graph.node("Add", &[&few, &nothing], &[]);
        let many = graph.node("Reshape", &[&many, &flat], &[]);
        logits = graph.node("Add", &[&logits, &many], &[]);
    }
    let shares = graph.node("Softmax", &[&logits], &[Attribute::Int("axis", 2)]);
    let places = graph.constant(&[cells, 2], &place_values(rows, columns));
    let found = graph.node("MatMul", &[&shares, &places], &[]);
    let squares = graph.node("Mul", &[&shares, &shares], &[]);
    let gain = graph.constant(&[cells, 1], &vec![PEAK_GAIN; cells]);
    let peak = graph.node("MatMul", &[&squares, &gain], &[]);
    let told = graph.node("Concat", &[&found, &peak], &[Attribute::Int("axis", 2)]);
    let width = graph.shape(&[0, LANDMARK_VALUES * count]);
    graph.node("Reshape", &[&told, &width], &[])
}

/// A layer on each cell of a map: a 1x1 convolution.
fn on_each_cell(graph: &mut OnnxGraph, layer: &Dense, input: &str) -> String {
    let [inputs, outputs] = layer.weight.val().dims();
    let filters: Tensor<4> = (layer.weight.val().transpose()).reshape([outputs, inputs, 1, 1]);
    convolution(graph, filters, layer.bias.val(), 1, 0, input)
}

/// The maps of the first layer and of each stage, `[n, channels, rows, columns]`.
pub fn feature_maps(
    graph: &mut OnnxGraph,
    first_layer: &Dense,
    stages: &[Stage],
    grid: &PatchGrid,
    input: &str,
) -> Vec<String> {
    let (weight, bias) = (first_layer.weight.val(), first_layer.bias.val());
    let seen = stem(graph, weight, Some(bias), grid, input);
    after_first_layer(graph, stages, &seen)
}

/// The same from what the first layer made of a state, or of a pair.
fn after_first_layer(graph: &mut OnnxGraph, stages: &[Stage], seen: &str) -> Vec<String> {
    let mut maps = vec![graph.node("Relu", &[seen], &[])];
    for (index, stage) in stages.iter().enumerate() {
        let merged = merge(graph, &stage.merge, &maps[index]);
        let merged = graph.node("Relu", &[&merged], &[]);
        maps.push(residual_block(graph, &stage.block, &merged));
    }
    maps
}

/// Softmax over the cells of a map, and the mean place under it.
fn keypoints(
    graph: &mut OnnxGraph,
    keypoints: &Keypoints,
    [rows, columns]: [usize; 2],
    input: &str,
) -> String {
    let [_, count] = keypoints.logits.weight.val().dims();
    let logits = on_each_cell(graph, &keypoints.logits, input);
    let cells = rows * columns;
    let shape = graph.shape(&[0, count, cells]);
    let logits = graph.node("Reshape", &[&logits, &shape], &[]);
    let shares = graph.node("Softmax", &[&logits], &[Attribute::Int("axis", 2)]);
    let places = graph.constant(&[cells, 2], &coordinate_values(rows, columns));
    let found = graph.node("MatMul", &[&shares, &places], &[]);
    let found = graph.node("Flatten", &[&found], &[Attribute::Int("axis", 1)]);
    dense(graph, &keypoints.latent, &found)
}

/// The first layer: a matrix over patches while training, here the same as a convolution.
fn stem(
    graph: &mut OnnxGraph,
    weight: Tensor<2>,
    bias: Option<Tensor<1>>,
    grid: &PatchGrid,
    input: &str,
) -> String {
    let [_, channels] = weight.dims();
    let shape = [channels, 3 * grid.stack, grid.kernel, grid.kernel];
    let weight = graph.constant(&shape, &values(weight.transpose()));
    let bias = bias.map(|bias| graph.constant(&[channels], &values(bias)));
    let inputs: Vec<&str> = [input, &weight]
        .into_iter()
        .chain(bias.as_deref())
        .collect();
    graph.node(
        "Conv",
        &inputs,
        &[
            Attribute::Ints("kernel_shape", &[grid.kernel; 2]),
            Attribute::Ints("strides", &[grid.stride; 2]),
            Attribute::Ints("pads", &grid.padding()),
        ],
    )
}

/// Four cells to one: a 2x2 convolution of stride 2.
fn merge(graph: &mut OnnxGraph, merge: &Dense, input: &str) -> String {
    let [inputs, channels] = merge.weight.val().dims();
    let filters: Tensor<4> = merge
        .weight
        .val()
        .reshape([2, 2, inputs / 4, channels])
        .permute([3, 2, 0, 1]);
    convolution(graph, filters, merge.bias.val(), 2, 0, input)
}

fn residual_block(graph: &mut OnnxGraph, block: &ResidualBlock, input: &str) -> String {
    let neighbours = &block.neighbours;
    let bias = neighbours.bias.val();
    let seen = convolution(graph, neighbours.filters(), bias, 1, 1, input);
    let seen = graph.node("Relu", &[&seen], &[]);
    let branch = on_each_cell(graph, &block.cell, &seen);
    let sum = graph.node("Add", &[input, &branch], &[]);
    graph.node("Relu", &[&sum], &[])
}

/// A convolution with square strides and the same padding on all sides.
pub fn convolution(
    graph: &mut OnnxGraph,
    filters: Tensor<4>,
    bias: Tensor<1>,
    stride: usize,
    padding: usize,
    input: &str,
) -> String {
    let shape = filters.dims();
    let weight = graph.constant(&shape, &values(filters));
    let bias = graph.constant(&[shape[0]], &values(bias));
    graph.node(
        "Conv",
        &[input, &weight, &bias],
        &[
            Attribute::Ints("kernel_shape", &shape[2..]),
            Attribute::Ints("strides", &[stride; 2]),
            Attribute::Ints("pads", &[padding; 4]),
        ],
    )
}

/// The layer that makes the latent. Burn flattens channels last, ONNX channels first.
fn latent(graph: &mut OnnxGraph, encoder: &CameraEncoder, flat: &str) -> String {
    let [inputs, outputs] = encoder.latent.weight.val().dims();
    let cells = (encoder.rows * encoder.columns) >> (2 * encoder.stages.len());
    let weight: Tensor<3> = encoder
        .latent
        .weight
        .val()
        .reshape([cells, inputs / cells, outputs])
        .swap_dims(0, 1);
    let weight = graph.constant(&[inputs, outputs], &values(weight));
    let bias = graph.constant(&[outputs], &values(encoder.latent.bias.val()));
    graph.node("Gemm", &[flat, &weight, &bias], &[])
}

/// `[n, in]` to `[n, out]`.
pub fn dense(graph: &mut OnnxGraph, dense: &Dense, input: &str) -> String {
    let shape = dense.weight.val().dims();
    let weight = graph.constant(&shape, &values(dense.weight.val()));
    let bias = graph.constant(&[shape[1]], &values(dense.bias.val()));
    graph.node("Gemm", &[input, &weight, &bias], &[])
}

/// `projection.onnx`: a latent to what it brings to a pair.
pub fn projection(model: &TrainedModel) -> Vec<u8> {
    let mut graph = OnnxGraph::default();
    let latent = graph.input(LATENT, &[model.spec.latent_dim]);
    let (from, to) = project(
        &mut graph,
        model,
        HeadKind::Traversability,
        [&latent, &latent],
    );
    let width = model.projection_width();
    graph.output("from", &from, &[width]);
    graph.output("to", &to, &[width]);
    graph.into_model("projection")
}

/// `traversability.onnx`: projections of two states to logits.
pub fn traversability(model: &TrainedModel) -> Vec<u8> {
    let mut graph = OnnxGraph::default();
    let width = model.projection_width();
    let from = graph.input("from", &[width]);
    let to = graph.input("to", &[width]);
    let logits = score(&mut graph, model, HeadKind::Traversability, [&from, &to]);
    graph.output("logits", &logits, &[model.spec.d_max]);
    graph.into_model("traversability")
}

/// `policy.onnx`: latents of two states to logits of the action classes.
pub fn policy(model: &TrainedModel) -> Vec<u8> {
    let mut graph = OnnxGraph::default();
    let from = graph.input("from", &[model.spec.latent_dim]);
    let goal = graph.input("goal", &[model.spec.latent_dim]);
    let (from, to) = project(&mut graph, model, HeadKind::Policy, [&from, &goal]);
    let logits = score(&mut graph, model, HeadKind::Policy, [&from, &to]);
    let classes = model.spec.action_space.head_sizes().iter().sum();
    graph.output("logits", &logits, &[classes]);
    graph.into_model("policy")
}

fn project(
    graph: &mut OnnxGraph,
    model: &TrainedModel,
    head: HeadKind,
    [left, reached]: [&str; 2],
) -> (String, String) {
    if model.network.joins_pixels() {
        let width = model.projection_width();
        return (
            graph.columns(left, 0..width),
            graph.columns(reached, width..2 * width),
        );
    }
    let head = model.network.head(head);
    let (from, to) = head.split();
    let shape = from.dims();
    // What comes after that in a latent is for others.
    let seen = |graph: &mut OnnxGraph, latent: &str| {
        if shape[0] < model.spec.latent_dim {
            graph.columns(latent, 0..shape[0])
        } else {
            latent.to_owned()
        }
    };
    let (left, reached) = (seen(graph, left), seen(graph, reached));
    let from = graph.constant(&shape, &values(from));
    let to = graph.constant(&shape, &values(to));
    let bias = graph.constant(&[shape[1]], &values(head.bias.val()));
    (
        graph.node("Gemm", &[&left, &from, &bias], &[]),
        graph.node("MatMul", &[&reached, &to], &[]),
    )
}

fn score(
    graph: &mut OnnxGraph,
    model: &TrainedModel,
    head: HeadKind,
    [from, to]: [&str; 2],
) -> String {
    let head = model.network.head(head);
    let sum = graph.node("Add", &[from, to], &[]);
    if !model.network.joins_pixels() {
        return after_projection(graph, head, &sum);
    }
    let mut start = 0;
    let mut latents = Vec::new();
    for encoder in &model.network.encoders {
        let len = encoder.map_len();
        let map = graph.columns(&sum, start..start + len);
        start += len;
        let channels = len / (encoder.rows * encoder.columns);
        let shape = graph.shape(&[0, channels, encoder.rows, encoder.columns]);
        let map = graph.node("Reshape", &[&map, &shape], &[]);
        latents.push(camera_latent(graph, encoder, &map).0);
    }
    let latent = concat(graph, &latents);
    let shape = head.from.val().dims();
    let weight = graph.constant(&shape, &values(head.from.val()));
    let bias = graph.constant(&[shape[1]], &values(head.bias.val()));
    let projected = graph.node("Gemm", &[&latent, &weight, &bias], &[]);
    after_projection(graph, head, &projected)
}

fn after_projection(graph: &mut OnnxGraph, head: &FlowHead, projected: &str) -> String {
    let first = graph.node("Relu", &[projected], &[]);
    let hidden = dense(graph, &head.hidden, &first);
    let hidden = graph.node("Relu", &[&hidden], &[]);
    dense(graph, &head.output, &hidden)
}
