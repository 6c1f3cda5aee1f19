//! The closed loop: see, localise, choose a goal state, act, and watch for shortcuts.
//!
//! A run sees camera images and the robot's own actions, nothing else. It tells what it does through
//! [`RolloutObserver`] and typed [`Event`]s; pictures and files are made elsewhere.

mod approach;
mod controller;
mod episode;
mod error;
mod event;
mod hypotheses;
mod model;
mod monitor;
mod nearby;
mod options;
mod place;
mod reactive;
mod reflex;
mod run;
mod running;
mod step;

pub use controller::{Controller, Decision};
pub use episode::{Episode, EpisodeEnd};
pub use error::RolloutError;
pub use event::Event;
pub use model::{MonitorModel, RolloutModel};
pub use monitor::{Monitor, Sight};
pub use options::RolloutOptions;
pub use reactive::{ReactiveObserver, ReactiveRollout, ReactiveStep};
pub use run::Rollout;
pub use step::{RolloutObserver, StepRecord, StepTimes};
