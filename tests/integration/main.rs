//! All integration tests in one binary, so that the dependencies are linked once.

mod architecture;
mod broken_graphs;
mod command;
mod diagnostics;
mod language;
mod schemas;
