use super::{Latents, ModelError, ModelSpec};
use crate::trajectory::State;

/// Turns states into latent vectors: the latents of all cameras one after another, in the order of
/// [`ModelSpec::cameras`] (Fu & Finn, section III-F).
pub trait Encoder {
    /// What the model was trained on.
    fn spec(&self) -> &ModelSpec;

    /// The latents of states, a row each, in the same order.
    ///
    /// # Errors
    /// [`ModelError::CameraMissing`] when a state lacks a camera or it has another size,
    /// [`ModelError::Engine`] when the network cannot be run.
    fn encode(&self, states: &[State]) -> Result<Latents, ModelError>;
}
