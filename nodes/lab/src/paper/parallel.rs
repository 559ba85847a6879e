//! Work on all cores whose result does not depend on how many there are.

use rayon::prelude::*;

/// Tasks of each core between two words about progress.
const GROUP: usize = 4;

/// Results of `task` of 0 to `n`, in that order; `progress` gets the share done.
pub fn in_parallel<T: Send>(
    n: usize,
    progress: &mut dyn FnMut(f64),
    task: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let group = GROUP * rayon::current_num_threads().max(1);
    let mut results = Vec::with_capacity(n);
    while results.len() < n {
        let end = (results.len() + group).min(n);
        let more = (results.len()..end).into_par_iter().map(&task);
        results.extend(more.collect::<Vec<T>>());
        progress(end as f64 / n as f64);
    }
    results
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_and_progress_ends_at_1() {
        let mut shares = Vec::new();
        let squares = in_parallel(101, &mut |done| shares.push(done), |i| i * i);
        assert_eq!(squares, (0..101).map(|i| i * i).collect::<Vec<_>>());
        assert!(shares.is_sorted() && shares.last() == Some(&1.0));
        assert!(in_parallel(0, &mut |_| {}, |i| i).is_empty());
    }
}
