use std::sync::Mutex;
use std::thread;

use crate::cli::error::CliError;

/// Does the work of each job, so many at a time, in their order.
///
/// # Errors
/// That of a job. Jobs that run then are waited for, no further one is begun.
pub(super) fn side_by_side<J: Send>(
    jobs: impl IntoIterator<Item = J>,
    at_once: usize,
    work: impl Fn(J) -> Result<(), CliError> + Sync,
) -> Result<(), CliError> {
    let jobs: Vec<J> = jobs.into_iter().collect();
    // No more than have something to do.
    let at_once = at_once.min(jobs.len());
    // None once a job failed.
    let left = Mutex::new(Some(jobs.into_iter()));
    let left = || left.lock().expect("no one panics with it");
    // Not within the loop's condition, which would hold the lock while a job works.
    let next = || left().as_mut()?.next();
    let work_on = || -> Result<(), CliError> {
        while let Some(job) = next() {
            work(job).inspect_err(|_| *left() = None)?;
        }
        Ok(())
    };
    thread::scope(|scope| {
        let workers: Vec<_> = (0..at_once).map(|_| scope.spawn(work_on)).collect();
        let mut results = workers
            .into_iter()
            .map(|w| w.join().expect("no job panics"));
        results.try_for_each(|result| result)
    })
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
    fn no_more_threads_are_begun_than_there_are_jobs() {
        let done = AtomicUsize::new(0);
        let work = |_| {
            done.fetch_add(1, Ordering::Relaxed);
            Ok(())
        };
        side_by_side(0..3, usize::MAX, work).unwrap();
        assert_eq!(done.into_inner(), 3);
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
