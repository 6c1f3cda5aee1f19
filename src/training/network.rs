//! The latent-flow network (Fu & Finn, section III-F): a residual network a camera, and two heads that see the
//! latents of two states and their difference; and the networks that the paper compares it with.

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
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

use super::NetworkConfig;
use super::patches::PatchGrid;
use crate::training::masks::HeadMasks;

/// Encoders of all cameras and the two heads.
///
/// What is computed once a state are its *latents*: what the encoders make of it, or, where two states are
/// joined in their pixels, what their first layers make of it as the state that is left and as the one that
/// is to be reached. What is computed once a pair begins with the sum of two *projections*.
#[derive(Module, Debug)]
pub struct LatentFlowNetwork {
    /// One for each camera, in the order of the cameras.
    pub encoders: Vec<CameraEncoder>,
    /// Predicts the traversability class of a pair.
    pub traversability: FlowHead,
    /// Predicts the action of a pair; the classes of all action dimensions one after another.
    pub policy: FlowHead,
}

/// One of the two heads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadKind {
    /// Steps from one state to another.
    Traversability,
    /// The action that leads there.
    Policy,
}

/// What is left out of the pairs of a batch while training.
#[derive(Clone, Copy, Debug)]
pub struct PairMasks<'a> {
    /// Values of the head.
    pub head: &'a HeadMasks,
    /// Residual blocks of each camera, where pairs are encoded.
    pub blocks: &'a [Vec<Tensor<4>>],
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
                .map(|grid| CameraEncoder::new(grid, &config.encoder, config.variant, &mut init))
                .collect(),
            traversability: FlowHead::new(latent_dim, config, d_max, &mut init),
            policy: FlowHead::new(latent_dim, config, action_classes, &mut init),
        }
    }

    /// Whether two states are joined in their pixels.
    #[must_use]
    pub fn joins_pixels(&self) -> bool {
        self.encoders.iter().any(CameraEncoder::joins_pixels)
    }

    /// One of the heads.
    #[must_use]
    pub fn head(&self, kind: HeadKind) -> &FlowHead {
        match kind {
            HeadKind::Traversability => &self.traversability,
            HeadKind::Policy => &self.policy,
        }
    }

    /// Latents `[states, latent_dim]` from the patches of each camera (`[states, positions, patch_len]`):
    /// cameras one after another. Where states are joined in their pixels, all cameras' maps of the states
    /// as those that are left, then all of them as those to be reached. `block_masks` switch residual blocks
    /// off while training.
    #[must_use]
    pub fn encode(
        &self,
        patches: Vec<Tensor<3>>,
        block_masks: Option<&[Vec<Tensor<4>>]>,
    ) -> Tensor<2> {
        let each = self.encoders.iter().zip(patches);
        if self.joins_pixels() {
            let (left, reached): (Vec<_>, Vec<_>) = each
                .map(|(encoder, patches)| encoder.both_maps(patches))
                .unzip();
            return Tensor::cat([left, reached].concat(), 1);
        }
        let latents = each
            .enumerate()
            .map(|(camera, (encoder, patches))| {
                encoder.forward(patches, block_masks.map(|m| m[camera].as_slice()))
            })
            .collect();
        Tensor::cat(latents, 1)
    }

    /// What each state brings to a pair when it is left, and when it is to be reached: `[states, width]`
    /// twice, from latents.
    #[must_use]
    pub fn project(&self, head: HeadKind, latents: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        if !self.joins_pixels() {
            return self.head(head).project(latents);
        }
        let width = latents.dims()[1] / 2;
        (
            latents.clone().narrow(1, 0, width),
            latents.narrow(1, width, width),
        )
    }

    /// Logits `[pairs, outputs]` of pairs of projections.
    #[must_use]
    pub fn score(
        &self,
        head: HeadKind,
        from: Tensor<2>,
        to: Tensor<2>,
        masks: Option<PairMasks<'_>>,
    ) -> Tensor<2> {
        let head = self.head(head);
        let head_masks = masks.map(|m| m.head);
        if !self.joins_pixels() {
            return head.score(from + to, head_masks);
        }
        let maps = relu(from + to);
        let mut start = 0;
        let latents = (self.encoders.iter().enumerate())
            .map(|(camera, encoder)| {
                let size = encoder.map_len();
                let map = maps.clone().narrow(1, start, size);
                start += size;
                encoder.of_map(map, masks.map(|m| m.blocks[camera].as_slice()))
            })
            .collect();
        head.score(head.project_pair(Tensor::cat(latents, 1)), head_masks)
    }
}
