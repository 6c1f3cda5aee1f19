use super::graphs::dense;
use super::onnx::OnnxGraph;
use crate::training::baseline::GatedUnit;
use crate::training::evaluation::values;

/// The memory after the last of `steps` states of `dim` values, from all of them in a row; the recurrence is
/// written out, step after step, in operators that every engine knows.
pub fn gated_unit(
    graph: &mut OnnxGraph,
    unit: &GatedUnit,
    history: &str,
    [steps, dim]: [usize; 2],
) -> String {
    let width = unit.width();
    let mut memory: Option<String> = None;
    for step in 0..steps {
        let state = graph.columns(history, step * dim..(step + 1) * dim);
        let x = dense(graph, &unit.input, &state);
        // A memory of zeros leaves the bias alone.
        let h = match &memory {
            Some(memory) => dense(graph, &unit.hidden, memory),
            None => graph.constant(&[1, 3 * width], &values(unit.hidden.bias.val())),
        };
        memory = Some(next(graph, &x, &h, memory.as_deref(), width));
    }
    memory.expect("a history has a state")
}

/// `n + k * (h - n)` with the gates of what is seen and of what is remembered.
fn next(graph: &mut OnnxGraph, x: &str, h: &str, memory: Option<&str>, width: usize) -> String {
    let mut parts = |index: usize| {
        let range = index * width..(index + 1) * width;
        (graph.columns(x, range.clone()), graph.columns(h, range))
    };
    let (reset, keep, new) = (parts(0), parts(1), parts(2));
    let mut gate = |(x, h): (String, String)| {
        let sum = graph.node("Add", &[&x, &h], &[]);
        graph.node("Sigmoid", &[&sum], &[])
    };
    let (reset, keep) = (gate(reset), gate(keep));
    let remembered = graph.node("Mul", &[&reset, &new.1], &[]);
    let sum = graph.node("Add", &[&new.0, &remembered], &[]);
    let new = graph.node("Tanh", &[&sum], &[]);
    let change = match memory {
        Some(memory) => graph.node("Sub", &[memory, &new], &[]),
        None => graph.node("Neg", &[&new], &[]),
    };
    let kept = graph.node("Mul", &[&keep, &change], &[]);
    graph.node("Add", &[&new, &kept], &[])
}
