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
