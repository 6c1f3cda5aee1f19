//! The command `catena`.

use std::process::ExitCode;

/// A step of a training makes and drops hundreds of megabytes of tensors; this allocator keeps them at hand instead
/// of returning them to the system each time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    catena::cli::main()
}
