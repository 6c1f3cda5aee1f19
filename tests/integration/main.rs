//! All integration tests in one binary, so that the dependencies are linked once. Those that call the command wait for
//! its feature.

mod architecture;
#[cfg(feature = "cli")]
mod bad_input;
#[cfg(feature = "cli")]
mod broken_graphs;
#[cfg(feature = "cli")]
mod command;
mod diagnostics;
#[cfg(feature = "cli")]
mod experiments;
#[cfg(feature = "cli")]
mod frozen_encoder;
#[cfg(feature = "cli")]
mod language;
mod loading;
#[cfg(feature = "cli")]
mod schemas;
#[cfg(feature = "cli")]
mod table_row;
#[cfg(feature = "cli")]
mod training;
