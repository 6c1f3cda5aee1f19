//! Commands of this program that it runs itself: they end when it is gone, however it ended.
//!
//! What the one who runs a command keeps of its standard input is closed with it by the system, so that the command need
//! only look out for the end of that.

use std::io;
use std::process::{Child, ChildStdin, Command, ExitStatus, Output, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Tells a command of this program to end with its standard input.
const FLAG: &str = "--ends-with-stdin";
/// How a command ends that nobody waits for.
const ABANDONED: i32 = 1;

/// Runs a command of this program to its end.
pub(super) fn status(command: &mut Command) -> io::Result<ExitStatus> {
    let (mut child, _open) = begun(command)?;
    child.wait()
}

/// The same, with what it prints.
pub(super) fn output(command: &mut Command) -> io::Result<Output> {
    let (child, _open) = begun(command.stdout(Stdio::piped()))?;
    child.wait_with_output()
}

/// A command that has begun, and its standard input, which is open until that is dropped.
fn begun(command: &mut Command) -> io::Result<(Child, Option<ChildStdin>)> {
    let mut child = command.arg(FLAG).stdin(Stdio::piped()).spawn()?;
    // Waiting for a child closes the input that is still its own.
    let open = child.stdin.take();
    Ok((child, open))
}

/// Ends this process when its standard input ends.
pub(super) fn end_with_input() {
    at_end_of_input(|| std::process::exit(ABANDONED));
}

/// The end of this process's standard input.
#[derive(Clone, Debug, Default)]
pub(super) struct EndOfInput(Arc<AtomicBool>);

impl EndOfInput {
    /// Looks out for it where that is asked for; elsewhere it never comes.
    pub(super) fn watched(is_asked_for: bool) -> Self {
        let end = Self::default();
        if is_asked_for {
            let has_come = Arc::clone(&end.0);
            at_end_of_input(move || has_come.store(true, Ordering::Relaxed));
        }
        end
    }

    pub(super) fn has_come(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

fn at_end_of_input(then: impl FnOnce() + Send + 'static) {
    thread::spawn(move || {
        // Nobody writes there, and one that cannot be read has ended, too.
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        then();
    });
}
