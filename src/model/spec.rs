use serde::{Deserialize, Serialize};

use crate::trajectory::{ActionSpace, CameraSpec};

/// What a model takes and gives; stored in its manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelSpec {
    /// The cameras in the order of their latents.
    pub cameras: Vec<CameraSpec>,
    /// How many frames make a state, at least 1.
    pub stack: usize,
    /// The actions of the local policy.
    pub action_space: ActionSpace,
    /// Number of traversability classes, at least 2: class `k` below `d_max` means `k` time steps, class `d_max`
    /// that the states are as many or more apart, or disconnected.
    pub d_max: usize,
    /// Values in a state's latent, at least 1: all cameras together.
    pub latent_dim: usize,
}
