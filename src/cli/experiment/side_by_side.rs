use std::sync::Mutex;
use std::thread;

use crate::cli::error::CliError;

/// Does the work of each job, so many at a time, in their order.
///
/// # Errors
/// The first one that a job ends with. Jobs that run then are waited for, no further one is begun.
pub(super) fn side_by_side<J: Send>(
    jobs: impl IntoIterator<Item = J, IntoIter: Send>,
    at_once: usize,
    work: impl Fn(J) -> Result<(), CliError> + Sync,
) -> Result<(), CliError> {
    let jobs = Mutex::new(jobs.into_iter().fuse());
    let error = Mutex::new(None);
    let next = || {
        let failed = error.lock().expect("no one panics with it");
        failed
            .is_none()
            .then(|| jobs.lock().expect("no one panics with it").next())?
    };
    thread::scope(|scope| {
        for _ in 0..at_once.max(1) {
            scope.spawn(|| {
                while let Some(job) = next() {
                    if let Err(found) = work(job) {
                        error
                            .lock()
                            .expect("no one panics with it")
                            .get_or_insert(found);
                    }
                }
            });
        }
    });
    error
        .into_inner()
        .expect("no one panicked with it")
        .map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests {
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn jobs_run_beside_each_other() {
        // Each waits for another one, so that they never end one after the other.
        let meeting = Barrier::new(2);
        let done = AtomicUsize::new(0);
        let work = |_| {
            meeting.wait();
            done.fetch_add(1, Ordering::Relaxed);
            Ok(())
        };
        side_by_side(0..6, 2, work).unwrap();
        assert_eq!(done.into_inner(), 6);
    }

    #[test]
    fn nothing_is_begun_after_an_error() {
        let begun = Mutex::new(Vec::new());
        let work = |job: usize| {
            begun.lock().unwrap().push(job);
            if job == 1 {
                return Err(CliError::UnknownMethod {
                    found: "second".to_owned(),
                    known: String::new(),
                });
            }
            Ok(())
        };
        let error = side_by_side(0..4, 1, work).unwrap_err().to_string();
        assert!(error.contains("second"), "{error}");
        assert_eq!(begun.into_inner().unwrap(), [0, 1]);
    }
}
