//! All integration tests in one binary, so that the dependencies are linked once.

mod architecture;
mod bad_input;
mod broken_graphs;
mod command;
mod diagnostics;
mod language;
mod schemas;
mod training;
