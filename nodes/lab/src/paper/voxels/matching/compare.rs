//! Medians and tails of paired trials, with intervals by the bootstrap (Efron 1979).

use super::trials::Trials;
use crate::evaluate::quantile;
use crate::paper::streams::{Purpose, stream};

/// Quantiles of the errors that are compared.
pub(super) const SHARES: [f64; 2] = [0.5, 0.95];
/// The lattice that others are compared with: cubic.
const CUBIC: usize = 0;

/// A number with the middle 95 % of its bootstrap.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Estimate {
    pub(super) value: f64,
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Estimate {
    fn new(value: f64, drawn: &[f64]) -> Estimate {
        let at = |share| quantile(drawn.iter().copied(), share).unwrap_or(f64::NAN);
        Estimate {
            value,
            low: at(0.025),
            high: at(0.975),
        }
    }
}

/// Median and 95th percentile of each lattice in one scene: of the trials, then of each resample of
/// them. One resample takes the same trials for all lattices.
pub(super) struct Quantiles {
    found: [[f64; 6]; 2],
    drawn: Vec<[[f64; 6]; 2]>,
}

impl Quantiles {
    /// Quantiles of scene `number`, with so many resamples.
    pub(super) fn of(trials: &Trials, seed: u64, number: usize, resamples: usize) -> Quantiles {
        let errors = [0, 1, 2, 3, 4, 5].map(|lattice| trials.errors_m(lattice));
        let n = errors.first().map_or(0, Vec::len);
        let mut stream = stream(seed, Purpose::Bootstrap, number);
        let mut resample = |_| {
            let drawn = (0..n).map(|_| (stream.uniform() * n as f64) as usize);
            quantiles(&errors, drawn)
        };
        Quantiles {
            found: quantiles(&errors, 0..n),
            drawn: (0..resamples).map(&mut resample).collect(),
        }
    }

    /// Quantile `share` (a number of [`SHARES`]) of a lattice, metres.
    pub(super) fn estimate(&self, share: usize, lattice: usize) -> Estimate {
        let drawn: Vec<f64> = self.drawn.iter().map(|q| q[share][lattice]).collect();
        Estimate::new(self.found[share][lattice], &drawn)
    }
}

fn quantiles(errors: &[Vec<f64>; 6], places: impl Iterator<Item = usize>) -> [[f64; 6]; 2] {
    let places: Vec<usize> = places.collect();
    let mut found = [[f64::NAN; 6]; 2];
    for (lattice, errors) in errors.iter().enumerate() {
        let taken = places.iter().filter_map(|&i| errors.get(i).copied());
        let mut taken: Vec<f64> = taken.collect();
        taken.sort_by(f64::total_cmp);
        for (share, found) in SHARES.into_iter().zip(&mut found) {
            found[lattice] = quantile(taken.iter().copied(), share).unwrap_or(f64::NAN);
        }
    }
    found
}

/// Change of a quantile of a lattice against that of cubic, %: the mean (of logarithms) over
/// scenes, which are independent of each other.
pub(super) fn change(scenes: &[&Quantiles], share: usize, lattice: usize) -> Estimate {
    let ratio = |q: &[[f64; 6]; 2]| (q[share][lattice] / q[share][CUBIC]).ln();
    let percent = |sum: f64| 100.0 * ((sum / scenes.len() as f64).exp() - 1.0);
    let found = scenes.iter().map(|scene| ratio(&scene.found)).sum();
    let resamples = scenes.iter().map(|scene| scene.drawn.len()).min();
    let resample = |i| {
        let ratios = scenes.iter().filter_map(|scene| scene.drawn.get(i));
        percent(ratios.map(ratio).sum())
    };
    let drawn: Vec<f64> = (0..resamples.unwrap_or(0)).map(resample).collect();
    Estimate::new(percent(found), &drawn)
}

#[cfg(test)]
mod tests {
    use super::super::trials::Outcome;
    use super::*;
    use crate::random::Stream;

    /// Errors uniform up to a limit for each lattice; the same draws for all.
    fn trials(limits: [f64; 6], n: usize, seed: u64) -> Trials {
        let mut stream = Stream::numbered(seed, 0);
        let draws: Vec<f64> = (0..n).map(|_| stream.uniform()).collect();
        let outcome = |error_m| Outcome {
            error_m,
            evaluations: 1,
        };
        Trials {
            by_lattice: limits.map(|most| draws.iter().map(|d| outcome(most * d)).collect()),
        }
    }

    #[test]
    fn pairs_of_equal_ratio_have_no_spread() {
        let trials = trials([1.0, 0.8, 1.0, 1.2, 1.0, 1.0], 200, 1);
        let one = Quantiles::of(&trials, 3, 0, 200);
        for share in [0, 1] {
            for (lattice, expected) in [(1, -20.0), (2, 0.0), (3, 20.0)] {
                let found = change(&[&one, &one], share, lattice);
                for value in [found.value, found.low, found.high] {
                    assert!((value - expected).abs() < 1e-9, "{found:?}");
                }
            }
            let quantile = one.estimate(share, 0);
            assert!(quantile.low < quantile.value && quantile.value < quantile.high);
        }
    }

    #[test]
    fn intervals_hold_the_truth_as_often_as_they_say() {
        let holds = |seed: u64| {
            let quantiles = Quantiles::of(&trials([1.0; 6], 150, seed), seed, 0, 200);
            let median = quantiles.estimate(0, 0);
            median.low <= 0.5 && median.high >= 0.5
        };
        let held = (0..200).filter(|seed| holds(*seed)).count();
        assert!((178..=199).contains(&held), "{held} of 200");
    }
}
