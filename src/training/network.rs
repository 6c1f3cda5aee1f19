//! The latent-flow network (Fu & Finn, section III-F): a residual network a camera, and two heads that see the
//! latents of two states and their difference; and the networks that the paper compares it with.

mod convolution;
mod encoder;
mod head;
mod initialiser;
mod keypoints;
mod landmarks;
mod motion_head;

pub use convolution::StandardisedConvolution;
pub use encoder::{CameraEncoder, ResidualBlock, Stage, feature_maps};
pub use head::{Dense, FlowHead};
pub use initialiser::Initialiser;
pub use keypoints::{Keypoints, coordinate_values};
pub use landmarks::{Landmarks, PEAK_GAIN, PLACE_GAIN, place_values};
pub use motion_head::MotionHead;

use burn::module::Module;
use burn::tensor::activation::relu;
use burn::tensor::{Device, Tensor};

use super::NetworkConfig;
use super::patches::PatchGrid;
use crate::model::LANDMARK_VALUES;
use crate::training::encodings::beside_each_other;
use crate::training::masks::HeadMasks;

/// Encoders of all cameras and the two heads. A training makes one, and [`TrainedModel`](super::TrainedModel) holds it.
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
    /// Tells the motion to go, which joins the latents; none where it is not learnt.
    pub motion: Option<MotionHead>,
}

/// One of the two heads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeadKind {
    /// Steps from one state to another.
    Traversability,
    /// The action that leads there.
    Policy,
}

/// What a network is to give.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputSizes {
    /// Traversability classes.
    pub d_max: usize,
    /// Classes of all action dimensions together.
    pub action_classes: usize,
    /// Values of the motion to go; 0 leaves its head out.
    pub motion_axes: usize,
    /// Landmarks that each camera tells; 0 leaves them out.
    pub landmarks: usize,
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
    pub(super) fn new(
        grids: &[PatchGrid],
        config: &NetworkConfig,
        sizes: OutputSizes,
        seed: u64,
        device: &Device,
    ) -> Self {
        let mut init = Initialiser::new(seed, device);
        let OutputSizes {
            d_max,
            action_classes,
            motion_axes,
            landmarks,
        } = sizes;
        let encoded = grids.len() * config.encoder.latent_dim;
        let latent_dim = encoded + motion_axes;
        let (encoder, variant) = (&config.encoder, config.variant);
        Self {
            encoders: grids
                .iter()
                .map(|grid| CameraEncoder::new(grid, encoder, variant, landmarks, &mut init))
                .collect(),
            traversability: FlowHead::new(latent_dim, config, d_max, &mut init),
            policy: FlowHead::new(latent_dim, config, action_classes, &mut init),
            motion: (motion_axes > 0)
                .then(|| MotionHead::new(encoded, config.motion_width, motion_axes, &mut init)),
        }
    }

    /// Whether two states are joined in their pixels.
    #[must_use]
    pub fn joins_pixels(&self) -> bool {
        self.encoders.iter().any(CameraEncoder::joins_pixels)
    }

    /// One of the heads.
    #[must_use]
    pub(super) fn head(&self, kind: HeadKind) -> &FlowHead {
        match kind {
            HeadKind::Traversability => &self.traversability,
            HeadKind::Policy => &self.policy,
        }
    }

    /// Latents `[states, latent_dim]` from the patches of each camera (`[states, positions, patch_len]`):
    /// cameras one after another, then the motion to go where it is learnt, then each camera's landmarks where they
    /// are told, which the heads do not see. Where states are joined in their pixels, all cameras' maps of the states
    /// as those that are left, then all of them as those to be reached. `block_masks` switch residual blocks
    /// off while training.
    #[must_use]
    pub fn encode(
        &self,
        patches: Vec<Tensor<3>>,
        block_masks: Option<&[Vec<Tensor<4>>]>,
    ) -> Tensor<2> {
        if self.joins_pixels() {
            let (left, reached): (Vec<_>, Vec<_>) = (self.encoders.iter().zip(patches))
                .map(|(encoder, patches)| encoder.both_maps(patches))
                .unzip();
            return Tensor::cat([left, reached].concat(), 1);
        }
        let encode = |camera: usize| {
            let masks = block_masks.map(|m| m[camera].as_slice());
            self.encoders[camera].forward(patches[camera].clone(), masks)
        };
        let (latents, landmarks): (Vec<_>, Vec<_>) = beside_each_other(self.encoders.len(), encode)
            .into_iter()
            .unzip();
        let seen = self.with_motion(Tensor::cat(latents, 1));
        let parts = [Some(seen)].into_iter().chain(landmarks);
        Tensor::cat(parts.flatten().collect(), 1)
    }

    /// What the encoder of one camera makes of its patches, where states are not joined in their pixels: a latent,
    /// and the logits of landmarks after it.
    #[must_use]
    pub fn encode_camera(
        &self,
        camera: usize,
        patches: &[Tensor<3>],
        block_masks: Option<&[Vec<Tensor<4>>]>,
    ) -> Tensor<2> {
        let masks = block_masks.map(|m| m[camera].as_slice());
        self.encoders[camera].forward_with_logits(patches[camera].clone(), masks)
    }

    /// Parts what [`encode_camera`](Self::encode_camera) gave of all cameras, one after another, into their latents
    /// and the logits of each camera's landmarks, `[states, count, cells]`.
    #[must_use]
    pub fn part(&self, encoded: &Tensor<2>) -> (Tensor<2>, Vec<Tensor<3>>) {
        let (mut latents, mut logits, mut start) = (Vec::new(), Vec::new(), 0);
        let states = encoded.dims()[0];
        for encoder in &self.encoders {
            let Some(landmarks) = &encoder.landmarks else {
                return (encoded.clone(), Vec::new());
            };
            let width = encoder.latent_dim();
            latents.push(encoded.clone().narrow(1, start, width));
            let (count, cells) = (landmarks.count(), encoder.rows * encoder.columns);
            let flat = encoded.clone().narrow(1, start + width, count * cells);
            logits.push(flat.reshape([states, count, cells]));
            start += width + count * cells;
        }
        (Tensor::cat(latents, 1), logits)
    }

    /// What latents hold of each camera's landmarks, `[states, 3 * count]`; empty where none are told.
    #[must_use]
    pub fn landmarks_of(&self, latents: &Tensor<2>) -> Vec<Tensor<2>> {
        let mut start = self.policy.from.val().dims()[0];
        let landmarks = self.encoders.iter().filter_map(|e| e.landmarks.as_ref());
        landmarks
            .map(|landmarks| {
                let width = LANDMARK_VALUES * landmarks.count();
                start += width;
                latents.clone().narrow(1, start - width, width)
            })
            .collect()
    }

    /// The motion to go added to what the encoders made of states, where it is learnt.
    #[must_use]
    pub fn with_motion(&self, encoded: Tensor<2>) -> Tensor<2> {
        match &self.motion {
            Some(head) => Tensor::cat(vec![encoded.clone(), head.forward(encoded)], 1),
            None => encoded,
        }
    }

    /// The motion to go that latents hold, `[n, axes]`; none where it is not learnt.
    #[must_use]
    pub fn motion_of(&self, latents: &Tensor<2>) -> Option<Tensor<2>> {
        let axes = self.motion.as_ref()?.axes();
        let seen = self.policy.from.val().dims()[0];
        Some(latents.clone().narrow(1, seen - axes, axes))
    }

    /// What each state brings to a pair when it is left, and when it is to be reached: `[states, width]`
    /// twice, from latents.
    #[must_use]
    pub(super) fn project(&self, head: HeadKind, latents: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
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
    pub(super) fn score(
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
