//! The latent-flow network (Fu & Finn, section III-F): a residual network a camera, and two heads that see the
//! latents of two states and their difference.

mod convolution;
mod encoder;
mod head;
mod initialiser;
mod keypoints;

pub use convolution::StandardisedConvolution;
pub use encoder::{CameraEncoder, ResidualBlock, Stage, feature_maps};
pub use head::{Dense, FlowHead};
pub use initialiser::Initialiser;
pub use keypoints::{Keypoints, coordinate_values};

use burn::module::Module;
use burn::tensor::{Device, Tensor};

use super::NetworkConfig;
use super::patches::PatchGrid;

/// Encoders of all cameras and the two heads.
#[derive(Module, Debug)]
pub struct LatentFlowNetwork {
    /// One for each camera, in the order of the cameras.
    pub encoders: Vec<CameraEncoder>,
    /// Predicts the traversability class of a pair.
    pub traversability: FlowHead,
    /// Predicts the action of a pair; the classes of all action dimensions one after another.
    pub policy: FlowHead,
}

impl LatentFlowNetwork {
    /// A network with random weights: the same seed gives the same weights.
    #[must_use]
    pub fn new(
        grids: &[PatchGrid],
        config: &NetworkConfig,
        d_max: usize,
        action_classes: usize,
        seed: u64,
        device: &Device,
    ) -> Self {
        let mut init = Initialiser::new(seed, device);
        let latent_dim = grids.len() * config.encoder.latent_dim;
        Self {
            encoders: grids
                .iter()
                .map(|grid| CameraEncoder::new(grid, &config.encoder, &mut init))
                .collect(),
            traversability: FlowHead::new(latent_dim, config, d_max, &mut init),
            policy: FlowHead::new(latent_dim, config, action_classes, &mut init),
        }
    }

    /// Latents `[states, latent_dim]`, cameras one after another, from the patches of each camera
    /// (`[states, positions, patch_len]`). `block_masks` switch residual blocks off while training.
    #[must_use]
    pub fn encode(
        &self,
        patches: Vec<Tensor<3>>,
        block_masks: Option<&[Vec<Tensor<4>>]>,
    ) -> Tensor<2> {
        let latents = self
            .encoders
            .iter()
            .zip(patches)
            .enumerate()
            .map(|(camera, (encoder, patches))| {
                encoder.forward(patches, block_masks.map(|m| m[camera].as_slice()))
            })
            .collect();
        Tensor::cat(latents, 1)
    }
}
