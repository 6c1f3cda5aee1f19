use serde::Serialize;

use crate::task::Subgoal;
use crate::trajectory::{ActionSpace, CameraSpec};

/// What a client learns when it connects to a policy server.
#[derive(Serialize)]
pub(super) struct Metadata<'a> {
    pub(super) server: &'static str,
    pub(super) version: &'static str,
    pub(super) composition: &'a str,
    pub(super) description: &'a str,
    /// Each as its name and the size that images are resized to.
    pub(super) cameras: &'a [CameraSpec],
    pub(super) action_space: &'a ActionSpace,
    pub(super) tasks: &'a [String],
    pub(super) subgoals: &'a [Subgoal],
    pub(super) step_limit: usize,
    pub(super) model: &'a str,
    pub(super) graphs: &'a [String],
    /// What runs the networks.
    pub(super) engine: &'a str,
}
