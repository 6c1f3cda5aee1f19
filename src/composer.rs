//! YAML as written to checked compositions: tasks in an order, where their graphs are, which final
//! state is chosen, what to do on a shortcut.
//!
//! [`compose`] reads a file and gives a [`Composition`] or [`Diagnostics`]: *all* faults of the file and
//! of the tasks that it names, each with its line underlined, the nearest valid name and a way out.
//! A deserializer stops at the first fault, so files are read into a tree whose nodes know their places,
//! and the specs ([`TaskSpec`], [`CompositionSpec`]: as written) are read off that tree. Only sound
//! specs become a [`ResolvedTask`] and a [`Composition`].
//!
//! Of simulated worlds only the callers know what can be set in them: [`compose_named_knowing`] takes it as data
//! ([`KnownWorld`]), so that what does not fit is told with all other faults.
//!
//! Paths in files are relative to the project's root, the folder that holds `tasks/`; task `NAME` is
//! `tasks/NAME.yaml`.
//!
//! No graph is loaded here: [`Composition::check_against`] is for whoever has loaded them.

mod builder;
mod check;
mod compose;
mod composition;
mod composition_spec;
mod diagnostic;
mod diagnostics;
mod environment_config;
mod order_spec;
mod planner_spec;
mod reader;
mod region_spec;
mod regions;
mod resolved_task;
mod source;
mod spec_check;
mod task_spec;
mod way_out;
mod world;
mod yaml;

pub use builder::CompositionBuilder;
pub use compose::{
    compose, compose_named, compose_named_knowing, compose_source, load_task_named, task_names,
};
pub use composition::Composition;
pub use composition_spec::{Calibration, CompositionSpec, Limits, OnShortcut, StartSpec};
pub use diagnostic::{Diagnostic, SecondPlace, Severity};
pub use diagnostics::{Diagnostics, Rendering};
pub use environment_config::EnvironmentConfig;
pub use region_spec::RegionSpec;
pub use resolved_task::{ResolvedTask, load_task};
pub use source::{Located, Origin, Place, Source};
pub use task_spec::{FoundBy, SubgoalSpec, TaskSpec};
pub use world::{KnownWorld, Setting, SettingKind};
