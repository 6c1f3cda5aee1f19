//! What a robot saw and did: images, observations, states, actions, trajectories.
//!
//! The lowest room of the house: it knows neither files nor networks.

mod action;
mod beyond;
mod binning;
mod compared;
mod demonstration;
mod error;
mod geometry;
mod geometry_fault;
mod image;
mod observation;

pub use action::{Action, ActionSpace};
pub use binning::{ActionDimension, Binning, Decoding, DimensionBinning, Spacing};
pub(crate) use compared::told_apart;
pub use demonstration::{DemonstrationSet, Marker, Step, Trajectory};
pub use error::TrajectoryError;
pub use geometry::{CameraMount, Displacement, Lens, MountedOn, Posture, RobotGeometry};
pub(crate) use image::printed_cameras;
pub use image::{CameraSpec, Image};
pub use observation::{Observation, State};
