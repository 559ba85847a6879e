//! Work on all cores whose result does not depend on how many there are.

use rayon::prelude::*;

/// Tasks of each core between two words about progress.
const GROUP: usize = 4;

/// `task` of 0 to `n`, in that order; `progress` is told how much is done, from 0 to 1.
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
        let mut told = Vec::new();
        let squares = in_parallel(101, &mut |done| told.push(done), |i| i * i);
        assert_eq!(squares, (0..101).map(|i| i * i).collect::<Vec<_>>());
        assert!(told.is_sorted() && told.last() == Some(&1.0));
        assert!(in_parallel(0, &mut |_| {}, |i| i).is_empty());
    }
}
