use burn::tensor::{Device, Tensor};

use super::BaselineNetwork;
use super::batch::BatchInput;
use super::dropout::Dropout;
use super::source::Source;
use crate::training::encodings::Encodings;
use crate::training::loss::{indices, policy_entropies, weights};

/// The cross-entropy of the actions of a step, in nats, averaged over the heads, and what the encoders made of the
/// states. Over all steps it is the mean over all states, each of the same weight.
pub fn loss_of(
    input: BatchInput,
    network: &BaselineNetwork,
    source: &Source,
    heads: &[usize],
    mut dropout: Option<&mut Dropout>,
    device: &Device,
) -> (Tensor<1>, Encodings) {
    let encodings = source.latents(
        input.inputs,
        input.states,
        network,
        dropout.as_deref_mut(),
        device,
    );
    let latents = encodings.latents();
    let windows = input.goals.len();
    let history = windowed(&latents, &input.rows, windows, device);
    let goals = latents.select(0, indices(&input.goals, device));
    let logits = network.policy.forward(history, goals, dropout);
    let scored = logits.select(0, indices(&input.scored, device));
    let entropies = policy_entropies(&scored, &input.classes, heads);
    let loss = (entropies * weights(&input.weights, device)).sum() / windows as f64;
    (loss, encodings)
}

/// Rows of latents as windows, `[windows, history, latent_dim]`.
pub fn windowed(latents: &Tensor<2>, rows: &[i32], windows: usize, device: &Device) -> Tensor<3> {
    let dim = latents.dims()[1];
    let picked = latents.clone().select(0, indices(rows, device));
    picked.reshape([windows, rows.len() / windows, dim])
}
