//! What a robot saw and did: images, observations, states, actions, trajectories.
//!
//! The lowest room of the house: it knows neither files nor networks.

mod action;
mod demonstration;
mod error;
mod image;
mod observation;

pub use action::{Action, ActionDimension, ActionSpace};
pub use demonstration::{DemonstrationSet, Marker, Step, Trajectory};
pub use error::TrajectoryError;
pub use image::{CameraSpec, Image};
pub use observation::{Observation, State};
