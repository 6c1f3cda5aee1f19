use super::baseline::layer_norm;
use super::graphs::dense;
use super::onnx::{Attribute, OnnxGraph};
use crate::training::baseline::{Block, CausalTransformer};
use crate::training::evaluation::values;
use crate::training::network::Dense;

/// Logits after the last state, from the latents of all states in a row and of the goal.
pub fn transformer(
    graph: &mut OnnxGraph,
    transformer: &CausalTransformer,
    history: &str,
    goal: &str,
) -> String {
    let (tokens, width) = (transformer.tokens, transformer.width());
    let all = (1 + transformer.history()) * tokens;
    let sizes = Sizes {
        all,
        width,
        heads: transformer.heads,
    };
    let row = graph.node("Concat", &[goal, history], &[Attribute::Int("axis", 1)]);
    let shape = graph.shape(&[0, all, width]);
    let sequence = graph.node("Reshape", &[&row, &shape], &[]);
    let places = graph.constant(&[1, all, width], &values(transformer.places.val()));
    let mask = graph.constant(&[1, 1, all, all], &transformer.mask_values());
    let mut x = graph.node("Add", &[&sequence, &places], &[]);
    for layer in &transformer.blocks {
        x = block(graph, layer, &x, &mask, &sizes);
    }
    let last = graph.columns(&x, all - tokens..all);
    let mean = graph.node(
        "ReduceMean",
        &[&last],
        &[Attribute::Ints("axes", &[1]), Attribute::Int("keepdims", 0)],
    );
    let even = layer_norm(graph, &transformer.norm, &mean, 1);
    dense(graph, &transformer.output, &even)
}

struct Sizes {
    all: usize,
    width: usize,
    heads: usize,
}

fn block(graph: &mut OnnxGraph, block: &Block, x: &str, mask: &str, sizes: &Sizes) -> String {
    let even = layer_norm(graph, &block.attention_norm, x, 2);
    let query = split(graph, &block.query, &even, sizes, &[0, 2, 1, 3]);
    let key = split(graph, &block.key, &even, sizes, &[0, 2, 3, 1]);
    let value = split(graph, &block.value, &even, sizes, &[0, 2, 1, 3]);
    let fits = graph.node("MatMul", &[&query, &key], &[]);
    let part = sizes.width / sizes.heads;
    let scale = graph.constant(&[1], &[1.0 / (part as f32).sqrt()]);
    let fits = graph.node("Mul", &[&fits, &scale], &[]);
    let fits = graph.node("Add", &[&fits, mask], &[]);
    let shares = graph.node("Softmax", &[&fits], &[Attribute::Int("axis", 3)]);
    let looked = graph.node("MatMul", &[&shares, &value], &[]);
    let perm = [Attribute::Ints("perm", &[0, 2, 1, 3])];
    let looked = graph.node("Transpose", &[&looked], &perm);
    let shape = graph.shape(&[0, sizes.all, sizes.width]);
    let looked = graph.node("Reshape", &[&looked, &shape], &[]);
    let joined = each(graph, &block.joined, &looked);
    let x = graph.node("Add", &[x, &joined], &[]);
    let even = layer_norm(graph, &block.cell_norm, &x, 2);
    let wide = each(graph, &block.wider, &even);
    let wide = graph.node("Relu", &[&wide], &[]);
    let narrow = each(graph, &block.narrower, &wide);
    graph.node("Add", &[&x, &narrow], &[])
}

/// A layer on each token, its outputs by heads: `[n, all, width]` to four dimensions in the order `perm` of
/// `[n, all, heads, part]`.
fn split(graph: &mut OnnxGraph, dense: &Dense, x: &str, sizes: &Sizes, perm: &[usize]) -> String {
    let whole = each(graph, dense, x);
    let shape = graph.shape(&[0, sizes.all, sizes.heads, sizes.width / sizes.heads]);
    let parts = graph.node("Reshape", &[&whole, &shape], &[]);
    graph.node("Transpose", &[&parts], &[Attribute::Ints("perm", perm)])
}

/// A layer on each token, `[n, all, in]` to `[n, all, out]`.
fn each(graph: &mut OnnxGraph, dense: &Dense, x: &str) -> String {
    let shape = dense.weight.val().dims();
    let weight = graph.constant(&shape, &values(dense.weight.val()));
    let bias = graph.constant(&[shape[1]], &values(dense.bias.val()));
    let product = graph.node("MatMul", &[x, &weight], &[]);
    graph.node("Add", &[&product, &bias], &[])
}
