//! The contract between the closed loop and a robot, simulated or real.

use thiserror::Error;

use crate::trajectory::{Action, ActionSpace, CameraSpec, Observation};

/// Why a robot could not be reset or could not act.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum EnvironmentError {
    /// The action does not fit the robot.
    #[error("the robot cannot do {action}: {reason}")]
    ActionRefused {
        /// The action, printed.
        action: String,
        /// Why it was refused.
        reason: String,
    },
    /// The robot or its simulation stopped answering.
    #[error("the robot failed: {reason}")]
    Failed {
        /// What happened.
        reason: String,
    },
}

/// A robot that can be reset, looked through and acted with.
///
/// Only images and actions cross this line: whatever else a simulator knows stays behind it.
pub trait Environment {
    /// The cameras of every observation. A closed loop wants those of its model
    /// ([`ModelSpec::cameras`](crate::model::ModelSpec::cameras)), in their sizes; others may be there, too.
    /// [`Observation::fitted`] brings pictures to these sizes as recordings are.
    fn cameras(&self) -> Vec<CameraSpec>;

    /// The actions that [`step`](Self::step) takes.
    fn action_space(&self) -> ActionSpace;

    /// Starts a new episode and returns its first observation. The same seed starts the same
    /// episode where the robot is simulated.
    ///
    /// # Errors
    /// [`EnvironmentError::Failed`] when the robot cannot be brought to a start.
    fn reset(&mut self, seed: u64) -> Result<Observation, EnvironmentError>;

    /// Acts for one time step and returns what is seen afterwards. An action `terminate`
    /// ([`ActionSpace::terminate`]) is one in which nothing moves: whoever runs the loop says when an episode ends.
    ///
    /// # Errors
    /// [`EnvironmentError`] when the action does not fit or the robot fails.
    fn step(&mut self, action: &Action) -> Result<Observation, EnvironmentError>;
}
