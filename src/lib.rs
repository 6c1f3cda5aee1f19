//! Catena chains long-horizon robot behaviour out of demonstrations of single tasks.
//!
//! Demonstrations become per-task topological graphs, a learned traversability function adds edges
//! between trajectories and between tasks, and a composition says in which order tasks are to be done.
//! The method is that of Fu & Finn, *Data-Efficient Learning for Mobile Manipulation using
//! Vision-Based Topological Planning*; `ARCHITECTURE.md` says how the rooms of this crate depend on
//! each other.
//!
//! A composition of tasks, planned on the graphs of its tasks and run closed-loop. Your own robot is another
//! [`environment::Environment`], networks of your own are other implementations of the traits in [`model`].
//!
#![cfg_attr(feature = "simulator", doc = "```no_run")]
#![cfg_attr(not(feature = "simulator"), doc = "```ignore")]
//! use std::path::Path;
//!
//! use catena::composer::compose;
//! use catena::inference::EngineChoice;
//! use catena::loading::LoadedComposition;
//! use catena::rollout::{Rollout, RolloutModel, RolloutOptions};
//! use catena::simulator::{Bedroom, BedroomConfig, BedroomTask};
//!
//! let root = Path::new(".");
//! let composition = compose(&root.join("tasks/sequences/sock_then_trash.yaml"), root)?;
//!
//! // The model, and one graph a task, joined where the model sees a way from one task to the next.
//! let loaded = LoadedComposition::load(composition, EngineChoice::Auto)?;
//! let planner = loaded.own_planner()?;
//! println!("{}", planner.audit(&planner.plan_from_start()?));
//!
//! let parts = RolloutModel {
//!     encoder: &loaded.model,
//!     traversability: &loaded.model,
//!     policy: &loaded.model,
//!     landmarks: loaded.model.landmarks(),
//! };
//! let options = RolloutOptions {
//!     max_steps: loaded.composition.limits.steps as usize,
//!     on_shortcut: loaded.composition.on_shortcut,
//!     ..RolloutOptions::default()
//! };
//! let mut room = Bedroom::new(BedroomConfig::paper(BedroomTask::Sock));
//! let episode = Rollout::new(parts, planner, options)?.run(&mut room, 111, &mut ())?;
//! println!("{:?} after {} steps", episode.end, episode.steps);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Start with [`composer::compose`], [`loading::LoadedComposition`], [`planner::Planner`] and [`rollout::Rollout`];
//! [`rollout::Monitor`] says of a robot that somebody else drives which subgoals it reached and skipped,
//! [`rollout::Controller`] is the loop for programs that hold the robot themselves, [`storage::Recordings`] reads
//! recordings, [`view`] draws.

// What only the rooms above take of those below is idle where these are left out.
#![cfg_attr(not(feature = "cli"), allow(dead_code, unused_imports))]

#[cfg(feature = "cli")]
pub mod cli;
pub mod composer;
pub mod environment;
#[cfg(feature = "simulator")]
pub mod experiment;
pub mod graph;
mod hidden;
pub mod inference;
pub mod loading;
mod lock;
pub mod model;
pub mod planner;
pub mod rollout;
#[cfg(feature = "serve")]
pub mod serve;
#[cfg(feature = "simulator")]
pub mod simulator;
pub mod storage;
pub mod task;
#[cfg(feature = "train")]
pub mod training;
pub mod trajectory;
#[cfg(feature = "view")]
pub mod view;
mod wording;
