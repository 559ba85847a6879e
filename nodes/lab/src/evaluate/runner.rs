//! Runs of jobs, several at once, whose results are kept as they come.

use crate::AnyError;
use rayon::ThreadPool;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

/// Receiver of the results of a job.
pub(super) type Found<'a, T> = dyn FnMut(T) -> Result<(), AnyError> + Send + 'a;

/// Runs `work` on each job, `at_once` of them at a time, in their order; `keep` gets each result, on this thread.
///
/// Jobs at once take the pools in turn: one pool each, or one for all of them.
///
/// # Errors
/// That of the first job or result that fails; no more jobs begin then.
pub(super) fn run_jobs<J: Sync, T: Send>(
    jobs: &[J],
    at_once: usize,
    pools: &[ThreadPool],
    work: impl Fn(&J, &mut Found<T>) -> Result<(), AnyError> + Sync,
    keep: &mut dyn FnMut(T) -> Result<(), AnyError>,
) -> Result<(), AnyError> {
    let next = AtomicUsize::new(0);
    let (sender, receiver) = mpsc::channel::<Result<T, AnyError>>();
    std::thread::scope(|scope| {
        for pool in pools.iter().cycle().take(at_once) {
            let (sender, next, work) = (sender.clone(), &next, &work);
            scope.spawn(move || {
                let mut found = |one| {
                    let sent = sender.send(Ok(one));
                    Ok(sent.map_err(|_| "nobody takes the results any more")?)
                };
                while let Some(job) = jobs.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(error) = pool.install(|| work(job, &mut found)) {
                        // The receiver is gone only after another error.
                        let _ = sender.send(Err(error));
                        return;
                    }
                }
            });
        }
        drop(sender);
        receiver.into_iter().try_for_each(|one| keep(one?))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pool;

    /// Results of 40 jobs, two each, on so many pools; job `fails` does.
    fn run(at_once: usize, pools: usize, fails: Option<u32>) -> Result<Vec<u32>, AnyError> {
        let pools: Vec<ThreadPool> = (0..pools).map(|_| pool(2).unwrap()).collect();
        let jobs: Vec<u32> = (0..40).collect();
        let work = |job: &u32, found: &mut Found<u32>| {
            if fails == Some(*job) {
                return Err(format!("job {job}").into());
            }
            found(2 * job)?;
            found(2 * job + 1)
        };
        let mut kept = Vec::new();
        let mut keep = |one| {
            kept.push(one);
            Ok(())
        };
        run_jobs(&jobs, at_once, &pools, work, &mut keep)?;
        Ok(kept)
    }

    #[test]
    fn each_job_is_run_once_and_one_at_a_time_in_order() {
        let all: Vec<u32> = (0..80).collect();
        assert_eq!(run(1, 1, None).unwrap(), all);
        for pools in [1, 3] {
            let mut kept = run(3, pools, None).unwrap();
            kept.sort_unstable();
            assert_eq!(kept, all);
        }
    }

    #[test]
    fn a_job_that_fails_ends_the_run() {
        for (at_once, pools) in [(1, 1), (3, 1), (3, 3)] {
            let error = run(at_once, pools, Some(7)).unwrap_err();
            assert_eq!(error.to_string(), "job 7");
        }
    }
}
