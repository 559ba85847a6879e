//! Trials that have nothing in common but how they are kept.

use std::sync::mpsc;

use rayon::prelude::*;

use super::Results;
use super::results::name;
use super::settings::Cell;
use super::trial::{OURS, Trial};
use crate::{AnyError, pool};

/// Runs the trials that the results do not have yet, in this order, on `threads` threads.
///
/// `progress` hears of trials done, of all that are left.
pub(super) fn run_many<T: Sync>(
    trials: Vec<(Cell, T)>,
    run: impl Fn(&Cell, &T) -> Result<Trial, AnyError> + Sync,
    results: &mut Results,
    threads: usize,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<(), AnyError> {
    let done = results.done();
    let mut left = trials;
    left.retain(|(cell, _)| !done.contains(&name(cell, OURS)));
    let pool = pool(threads)?;
    let (sender, receiver) = mpsc::channel();
    std::thread::scope(|scope| {
        let (left, run) = (&left, &run);
        scope.spawn(move || {
            pool.install(|| {
                left.par_iter().with_max_len(1).for_each(|(cell, trial)| {
                    // The receiver is gone only after an error.
                    let _ = sender.send(run(cell, trial));
                });
            });
        });
        for (i, trial) in receiver.into_iter().enumerate() {
            results.add(trial?)?;
            progress(i + 1, left.len());
        }
        Ok(())
    })
}
