//! The command `catena`.

use std::process::ExitCode;

fn main() -> ExitCode {
    catena::cli::main()
}
