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

/// The end of this process's standard input, and that of the process with it.
#[derive(Clone, Debug, Default)]
pub(super) struct EndOfInput {
    has_come: Arc<AtomicBool>,
    /// Whether somebody asks for it, who then stops what is at work.
    is_asked_for: Arc<AtomicBool>,
}

impl EndOfInput {
    /// Looks out for it where that is wanted; elsewhere it never comes.
    pub(super) fn watched(is_wanted: bool) -> Self {
        let end = Self::default();
        if is_wanted {
            let watched = end.clone();
            thread::spawn(move || watched.wait());
        }
        end
    }

    /// Whether it has come. The process ends with it until this is asked for the first time; from then on it is for who
    /// asks to stop.
    pub(super) fn has_come(&self) -> bool {
        self.is_asked_for.store(true, Ordering::SeqCst);
        self.has_come.load(Ordering::SeqCst)
    }

    fn wait(&self) {
        // Nobody writes there, and one that cannot be read has ended, too.
        let _ = io::copy(&mut io::stdin(), &mut io::sink());
        self.has_come.store(true, Ordering::SeqCst);
        if !self.is_asked_for.load(Ordering::SeqCst) {
            std::process::exit(ABANDONED);
        }
    }
}
