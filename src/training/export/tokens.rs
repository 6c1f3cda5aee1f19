use burn::tensor::Tensor;

use super::graphs::{convolution, feature_maps};
use super::onnx::{Attribute, OnnxGraph};
use crate::training::baseline::TokenEncoder;
use crate::training::evaluation::values;
use crate::training::network::{Dense, coordinate_values};
use crate::training::patches::PatchGrid;

/// The tokens of one camera, one after another, from its normalised values.
///
/// What a layer does with the channels of a cell and what it does with its place are added up; the places
/// are the same for every picture.
pub fn token_encoder(
    graph: &mut OnnxGraph,
    encoder: &TokenEncoder,
    grid: &PatchGrid,
    input: &str,
) -> String {
    let maps = feature_maps(graph, &encoder.stem, &encoder.stages, grid, input);
    let map = &maps[maps.len() - 1];
    let (rows, columns) = (
        encoder.rows >> encoder.stages.len(),
        encoder.columns >> encoder.stages.len(),
    );
    let cells = rows * columns;
    let places = coordinate_values(rows, columns);
    let attention = Split::of(&encoder.attention);
    let filters: Tensor<4> =
        attention
            .channels
            .transpose()
            .reshape([attention.outputs, attention.inputs, 1, 1]);
    let logits = convolution(graph, filters, encoder.attention.bias.val(), 1, 0, map);
    let shape = graph.shape(&[0, attention.outputs, cells]);
    let logits = graph.node("Reshape", &[&logits, &shape], &[]);
    let by_place = by_place(&attention.places, &places, attention.outputs);
    let by_place = graph.constant(&[1, attention.outputs, cells], &by_place);
    let logits = graph.node("Add", &[&logits, &by_place], &[]);
    let shares = graph.node("Softmax", &[&logits], &[Attribute::Int("axis", 2)]);

    let token = Split::of(&encoder.token);
    let shape = graph.shape(&[0, token.inputs, cells]);
    let map = graph.node("Reshape", &[map, &shape], &[]);
    let map = graph.node("Transpose", &[&map], &[Attribute::Ints("perm", &[0, 2, 1])]);
    let seen = graph.node("MatMul", &[&shares, &map], &[]);
    let weight = graph.constant(&[token.inputs, token.outputs], &values(token.channels));
    let of_channels = graph.node("MatMul", &[&seen, &weight], &[]);
    let places = graph.constant(&[cells, 2], &places);
    let found = graph.node("MatMul", &[&shares, &places], &[]);
    let weight = graph.constant(&[2, token.outputs], &token.places);
    let of_places = graph.node("MatMul", &[&found, &weight], &[]);
    let sum = graph.node("Add", &[&of_channels, &of_places], &[]);
    let bias = graph.constant(&[token.outputs], &values(encoder.token.bias.val()));
    let tokens = graph.node("Add", &[&sum, &bias], &[]);
    graph.node("Flatten", &[&tokens], &[Attribute::Int("axis", 1)])
}

/// The weights of a layer over the channels of a cell and its place, apart.
struct Split {
    channels: Tensor<2>,
    /// `[2, outputs]`.
    places: Vec<f32>,
    inputs: usize,
    outputs: usize,
}

impl Split {
    fn of(dense: &Dense) -> Self {
        let weight = dense.weight.val();
        let [all, outputs] = weight.dims();
        Self {
            channels: weight.clone().narrow(0, 0, all - 2),
            places: values(weight.narrow(0, all - 2, 2)),
            inputs: all - 2,
            outputs,
        }
    }
}

/// What the place of each cell adds, `[outputs, cells]`.
fn by_place(weights: &[f32], places: &[f32], outputs: usize) -> Vec<f32> {
    (0..outputs)
        .flat_map(|output| {
            places
                .chunks_exact(2)
                .map(move |xy| xy[0] * weights[output] + xy[1] * weights[outputs + output])
        })
        .collect()
}
