use burn::tensor::Device;

use super::TrainedModel;
use super::evaluation::{encode, score, values};
use super::network::HeadKind;
use crate::model::Latents;
use crate::trajectory::{State, TrajectoryError};

/// What Burn computes for some states and pairs: what an exported model has to agree with.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceOutputs {
    /// `latent` of `encoder.onnx`.
    pub latents: Latents,
    /// `from` of `projection.onnx`.
    pub from: Latents,
    /// `to` of `projection.onnx`.
    pub to: Latents,
    /// `logits` of `traversability.onnx`, a row a pair, not divided by the temperature.
    pub traversability: Latents,
    /// `logits` of `policy.onnx`, a row a pair.
    pub policy: Latents,
}

impl TrainedModel {
    /// Burn's outputs for states, and for pairs of indices of these states.
    ///
    /// # Errors
    /// [`TrajectoryError::CameraMissing`] when a state lacks a camera.
    ///
    /// # Panics
    /// If there is no state, a pair names a state that is not there, or an image has another size.
    pub fn reference_outputs(
        &self,
        states: &[State],
        pairs: &[(u32, u32)],
    ) -> Result<ReferenceOutputs, TrajectoryError> {
        let device = Device::flex();
        let latents = encode(&self.network, states, &self.pictures(), &device)?;
        let (from, to) = (self.network).project(HeadKind::Traversability, latents.clone());
        let width = self.projection_width();
        let actions = self.spec.action_space.head_sizes().iter().sum();
        let of = |head| score(&self.network, head, &latents, pairs, &device);
        Ok(ReferenceOutputs {
            traversability: Latents::from_values(self.spec.d_max, of(HeadKind::Traversability)),
            policy: Latents::from_values(actions, of(HeadKind::Policy)),
            from: Latents::from_values(width, values(from)),
            to: Latents::from_values(width, values(to)),
            latents: Latents::from_values(self.spec.latent_dim, values(latents)),
        })
    }
}
