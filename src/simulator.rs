//! A simulated bedroom with a mobile manipulator: physics, cameras, tasks, and an operator who demonstrates
//! them.
//!
//! Stands in for the robot and the room of Fu & Finn (section V). A grasp holds, a drawer opens and
//! a sock falls into the box because physics says so. Only images and primitives cross
//! [`Environment`](crate::environment::Environment); [`Truth`] and [`Insight`] are for scores and
//! for the [`Operator`].

mod bedroom;
pub mod decor;
mod kinematics;
pub mod layout;
mod operator;
mod palette;
mod primitive;
mod ranges;
pub mod render;
mod robot;
mod truth;
mod variation;
mod world;

pub use bedroom::{Bedroom, BedroomConfig, CAMERA_HEIGHT, CAMERA_WIDTH, HEAD_CAMERA, WRIST_CAMERA};
pub use kinematics::{Joints, Tool};
pub use operator::{
    Demonstration, Habits, HabitsError, LONGEST_STEPS, Operator, Practice, demonstrate,
    demonstrate_on,
};
pub use primitive::Primitive;
pub(crate) use primitive::{DRIVE_STEP_M, TOOL_STEP_M, TURN_STEP_RAD, WRIST_STEP_RAD};
pub use ranges::VariationError;
pub use robot::{HEAD_FOV_RAD, HOME, WRIST_FOV_RAD};
pub use truth::{Insight, Truth};
pub use variation::{BedroomTask, Leftovers, Level, Variation};
pub use world::{Graspable, PRIMITIVE_SECS};
