mod checks;

use serde::{Deserialize, Serialize};

use super::NetworkVariant;
use super::landmarks::LandmarkConfig;
pub(super) use checks::{check_ends, check_shares, check_validation_share, demand};

/// Everything that decides a training; with the same demonstrations it gives the same weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrainingConfig {
    /// Seed of everything random.
    pub seed: u64,
    /// How many frames make a state.
    pub stack: usize,
    /// Number of traversability classes; class `d_max` means disconnected.
    pub d_max: usize,
    /// Weight of far pairs in the traversability loss (the paper's beta).
    pub far_weight: f32,
    /// Weight of the policy loss (the paper's alpha).
    pub policy_weight: f32,
    /// Weight of an auxiliary loss: each state is to tell what the robot still does, along each pair of primitives
    /// that undo each other, before its gripper next closes or opens. So encoders learn how far aside, ahead and
    /// above the thing lies that is to be taken, from every state on the way to it. 0 is the paper's way. Networks that
    /// join two states in their pixels have no latent of a state and go without.
    pub motion_weight: f32,
    /// Landmarks that encoders are to find, for robots whose geometry is known; none is the paper's way. Networks
    /// that join two states in their pixels go without.
    pub landmarks: Option<LandmarkConfig>,
    /// Share of the demonstrations of each task that is held out; at least one in all.
    pub validation_share: f64,
    /// Number of optimiser steps.
    pub steps: u64,
    /// Validate after so many steps.
    pub validate_every_steps: u64,
    /// Write a checkpoint after so many steps.
    pub checkpoint_every_steps: u64,
    /// Stop when so many validations in a row have brought nothing better.
    pub patience_validations: Option<u64>,
    /// Stop training after so many minutes; the learning rate falls to its end by then. The weights
    /// then depend on the speed of the machine.
    pub max_minutes: Option<f64>,
    /// Names of the cameras that the network sees, of those that the demonstrations have; empty means all.
    pub cameras: Vec<String>,
    /// The network.
    pub network: NetworkConfig,
    /// How states and pairs are drawn.
    pub sampling: SamplingConfig,
    /// Which actions the local policy learns.
    pub imitation: ImitationConfig,
    /// How images are varied.
    pub augmentation: AugmentationConfig,
    /// How weights are changed.
    pub optimiser: OptimiserConfig,
}

/// The network: the latent-flow network, or one of those that the paper compares it with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkConfig {
    /// Where two states meet.
    pub variant: NetworkVariant,
    /// The residual network of each camera.
    pub encoder: EncoderConfig,
    /// Width of the first layer of both heads; what a state is projected to.
    pub projection_width: usize,
    /// Width of the second layer of both heads.
    pub hidden_width: usize,
    /// Width of the hidden layer that tells the motion to go ([`TrainingConfig::motion_weight`]).
    pub motion_width: usize,
    /// Probability with which a value of a head's layer is set to 0 while training.
    pub dropout: f64,
}

/// The residual network that encodes the images of one camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EncoderConfig {
    /// Side of the square patches that the first layer sees, in pixels.
    pub stem_kernel: usize,
    /// Distance between neighbouring patches, in pixels.
    pub stem_stride: usize,
    /// Channels after the first layer.
    pub stem_channels: usize,
    /// Channels of each stage; a stage halves rows and columns and ends in a residual block.
    pub stage_channels: Vec<usize>,
    /// Keypoints whose places in the first stage's map join the latent; 0 means none.
    pub keypoints: usize,
    /// Values of the latent of one camera.
    pub latent_dim: usize,
    /// Probability with which a state skips a residual block while training.
    pub stochastic_depth: f64,
}

/// How states and pairs of a batch are drawn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SamplingConfig {
    /// States that are encoded in a step.
    pub states: usize,
    /// Pairs that are encoded in a step by a network that joins two states in their pixels: each third of
    /// them near, far and for the policy. As many as there are states is the same work a step.
    pub pixel_pairs: usize,
    /// Consecutive states that are drawn together, so that they hold near pairs; at least `d_max`.
    pub window: usize,
    /// Far pairs that are scored in a step.
    pub far_pairs: usize,
    /// Share of the windows that show a look-alike of another window: a moment of the same
    /// trajectory that looks most similar although it is `d_max` or more steps away.
    pub look_alike_share: f64,
    /// Share of the far pairs' weight that goes to hard ones: look-alikes, and pairs that lead
    /// backward in time. The rest is uniform as in the paper.
    pub hard_share: f64,
    /// Share of the windows that show the phase of another window in another demonstration of the same
    /// task. The local policy then also learns with goal states of other demonstrations, which is what it
    /// is given when it runs, and states of the same phase are not called far apart. Of more than 65
    /// demonstrations of a task each is compared with the 64 around it, and no far pair is drawn from two that
    /// were not compared. 0 is the paper's way.
    pub aligned_share: f64,
    /// Share of the policy's weight that goes to goal states of other demonstrations.
    pub aligned_policy_share: f64,
    /// Share of the states, and of the far pairs' weight, that goes to a gripper which closed on nothing
    /// beside one that holds its thing ([`ImitationConfig::missed_grasp_steps`] says what is a miss). Such
    /// states look alike and are the same phase of the task, but no few steps lead from one to the other;
    /// a planner that takes one for the other carries nothing. 0 is the paper's way.
    pub missed_grasp_share: f64,
}

/// Which actions of a demonstration are not to be imitated.
///
/// A person misses a grasp now and then, sees it, opens the gripper and tries again. How they came back is
/// worth learning, how they missed is not. Missed grasps are found from the actions: a closing that is
/// taken back within a few steps, before any subgoal was reached. The states stay in every other loss.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ImitationConfig {
    /// Most steps from a closing to the opening that takes it back; 0 imitates everything.
    pub missed_grasp_steps: usize,
    /// Steps before such a closing that are not imitated either.
    pub lead_steps: usize,
}

/// How images are varied while training; the same for all frames of a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AugmentationConfig {
    /// Largest shift of an image in either direction, in pixels.
    pub shift_pixels: usize,
    /// Largest relative change of brightness; 0.2 multiplies by 0.8 to 1.2.
    pub brightness: f32,
    /// Largest relative change of each colour channel.
    pub tint: f32,
    /// Share of the batches in which left and right change places: in all pictures and in the actions. For
    /// robots whose cameras and gripper look the same from either side, and whose actions are primitives
    /// with `left` and `right` in their names. What a demonstration shows of one side is then learnt of the
    /// other too.
    pub mirror_share: f64,
}

/// How weights are changed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OptimiserConfig {
    /// Largest learning rate.
    pub learning_rate: f64,
    /// The learning rate ends at this share of the largest.
    pub final_share: f64,
    /// Steps over which the learning rate rises from 0.
    pub warmup_steps: u64,
    /// `AdamW`'s decoupled weight decay.
    pub weight_decay: f32,
    /// Largest norm of the gradient of each weight tensor.
    pub clip_norm: f32,
    /// Share of the averaged weights that is kept at each step; 0 means no averaging.
    pub average_decay: f64,
}

impl Default for TrainingConfig {
    fn default() -> Self {
        Self {
            seed: 1,
            stack: 2,
            d_max: 5,
            far_weight: 5.0,
            policy_weight: 5.0,
            motion_weight: 0.0,
            landmarks: None,
            validation_share: 0.1,
            steps: 5_000,
            validate_every_steps: 250,
            checkpoint_every_steps: 250,
            patience_validations: None,
            max_minutes: None,
            cameras: Vec::new(),
            network: NetworkConfig::default(),
            sampling: SamplingConfig::default(),
            imitation: ImitationConfig::default(),
            augmentation: AugmentationConfig::default(),
            optimiser: OptimiserConfig::default(),
        }
    }
}

impl Default for NetworkConfig {
    fn default() -> Self {
        Self {
            variant: NetworkVariant::LatentFlow,
            encoder: EncoderConfig::default(),
            projection_width: 256,
            hidden_width: 128,
            motion_width: 64,
            dropout: 0.3,
        }
    }
}

impl Default for EncoderConfig {
    fn default() -> Self {
        Self {
            stem_kernel: 6,
            stem_stride: 4,
            stem_channels: 24,
            stage_channels: vec![32, 64, 96],
            keypoints: 0,
            latent_dim: 96,
            stochastic_depth: 0.3,
        }
    }
}

impl Default for SamplingConfig {
    fn default() -> Self {
        Self {
            states: 96,
            pixel_pairs: 96,
            window: 6,
            far_pairs: 1_024,
            look_alike_share: 0.0,
            hard_share: 0.0,
            aligned_share: 0.0,
            aligned_policy_share: 0.0,
            missed_grasp_share: 0.0,
        }
    }
}

impl Default for AugmentationConfig {
    fn default() -> Self {
        Self {
            shift_pixels: 4,
            brightness: 0.2,
            tint: 0.05,
            mirror_share: 0.0,
        }
    }
}

impl Default for OptimiserConfig {
    fn default() -> Self {
        Self {
            learning_rate: 1e-3,
            final_share: 0.01,
            warmup_steps: 200,
            weight_decay: 1e-2,
            clip_norm: 1.0,
            average_decay: 0.998,
        }
    }
}

impl TrainingConfig {
    /// Whether states are to tell the motion to go.
    #[must_use]
    pub fn tells_motion(&self) -> bool {
        self.motion_weight > 0.0 && !self.network.variant.joins_pixels()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_misspelt_field_is_refused() {
        assert!(serde_json::from_str::<TrainingConfig>(r#"{"stepz": 3}"#).is_err());
    }
}
