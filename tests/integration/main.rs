//! All integration tests in one binary, so that the dependencies are linked once.

mod architecture;
mod command;
mod diagnostics;
