//! Catena chains long-horizon robot behaviour out of demonstrations of single tasks.
//!
//! Demonstrations become per-task topological graphs, a learned traversability function adds edges
//! between trajectories and between tasks, and a composition says in which order tasks are to be done.
//! The method is that of Fu & Finn, *Data-Efficient Learning for Mobile Manipulation using
//! Vision-Based Topological Planning*; `ARCHITECTURE.md` says how the rooms of this crate depend on
//! each other.
//!
//! Start with [`composer::compose`], [`planner::Planner`] and [`rollout::Rollout`].

pub mod cli;
pub mod composer;
pub mod environment;
pub mod experiment;
pub mod graph;
pub mod inference;
pub mod model;
pub mod planner;
pub mod rollout;
pub mod serve;
pub mod simulator;
pub mod storage;
pub mod task;
pub mod training;
pub mod trajectory;
pub mod view;
mod wording;
