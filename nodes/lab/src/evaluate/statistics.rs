//! Shares, medians and quantiles with their intervals.

use serde::Serialize;

/// Normal quantile of a two-sided 95 % interval.
pub(super) const Z: f64 = 1.959_963_984_540_054;

/// A share of trials, with the 95 % interval of Wilson (1927).
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Share {
    pub k: usize,
    pub n: usize,
    /// The share k / n; None of no trials.
    pub share: Option<f64>,
    pub low: f64,
    pub high: f64,
}

impl Share {
    pub fn of(holds: impl IntoIterator<Item = bool>) -> Share {
        let (mut k, mut n) = (0, 0);
        for one in holds {
            n += 1;
            k += usize::from(one);
        }
        Share::new(k, n)
    }

    /// Text such as "75.0 % of 4 [30.1, 95.4]" with `digits` decimals; a dash without values.
    pub fn text(&self, digits: usize) -> String {
        let Some(share) = self.share else {
            return "-".to_owned();
        };
        let [share, low, high] = [share, self.low, self.high].map(|value| 100.0 * value);
        format!(
            "{share:.digits$} % of {} [{low:.digits$}, {high:.digits$}]",
            self.n
        )
    }

    pub fn new(k: usize, n: usize) -> Share {
        let unknown = Share {
            k,
            n,
            share: None,
            low: 0.0,
            high: 1.0,
        };
        if n == 0 {
            return unknown;
        }
        let (count, share) = (n as f64, k as f64 / n as f64);
        let z2 = Z * Z / count;
        let middle = (share + z2 / 2.0) / (1.0 + z2);
        let half = Z * (share * (1.0 - share) / count + z2 / (4.0 * count)).sqrt() / (1.0 + z2);
        Share {
            share: Some(share),
            low: (middle - half).max(0.0),
            high: (middle + half).min(1.0),
            ..unknown
        }
    }
}

/// Fewest values of which an interval of the median can hold 95 %.
pub const LEAST_FOR_INTERVAL: usize = 6;

/// An interval that holds the median of what the values were drawn from in 95 % of all draws or more,
/// whatever its distribution: ranks by the binomial of one half (Conover 1999, section 3.2).
///
/// For fewer than [`LEAST_FOR_INTERVAL`] values it spans all of them and holds less often; None of no values.
pub fn median_interval(values: impl IntoIterator<Item = f64>) -> Option<[f64; 2]> {
    let values = sorted(values);
    let n = values.len();
    // Logarithm of the chance that k of n lie below the median, from k = 0 on.
    let mut chance = n as f64 * 0.5_f64.ln();
    let (mut below, mut outside) = (0.0, 0);
    for k in 0..n / 2 {
        below += chance.exp();
        if below > 0.025 {
            break;
        }
        outside = k;
        chance += ((n - k) as f64 / (k + 1) as f64).ln();
    }
    let last = n.checked_sub(1 + outside)?;
    Some([*values.get(outside)?, *values.get(last)?])
}

pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    quantile(values, 0.5)
}

/// A quantile from 0 to 1, linear between the values; None of nothing.
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let values = sorted(values);
    let at = share.clamp(0.0, 1.0) * values.len().checked_sub(1)? as f64;
    let (low, high) = (values.get(at as usize)?, values.get(at.ceil() as usize)?);
    Some(low + (high - low) * at.fract())
}

pub fn distinct(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values = sorted(values);
    values.dedup();
    values
}

fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Least and greatest of some values; infinite of no values.
pub fn extent(values: impl IntoIterator<Item = f64>) -> [f64; 2] {
    let ends = [f64::INFINITY, f64::NEG_INFINITY];
    let wider = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
    values.into_iter().fold(ends, wider)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals_are_those_of_the_tables() {
        // Newcombe 1998, table I.
        for (k, n, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let share = Share::new(k, n);
            let off = (share.low - low).abs().max((share.high - high).abs());
            assert!(off < 5e-5, "{share:?}");
        }
        assert_eq!(Share::of([]).share, None);
        assert_eq!(Share::of([true, false]).share, Some(0.5));
    }

    #[test]
    fn intervals_of_the_median_have_the_ranks_of_the_binomial() {
        // Ranks, counted from 1, of the narrowest intervals that hold 95 %: they hold 96.9, 96.1, 95.9,
        // 95.7, 96.7 and 95.3 %.
        for (n, low) in [(6, 1), (9, 2), (20, 6), (30, 10), (50, 18), (2000, 956)] {
            let high = n + 1 - low;
            let values = (1..=n).rev().map(f64::from);
            let expected = [f64::from(low), f64::from(high)];
            assert_eq!(median_interval(values), Some(expected), "{n}");
        }
        assert_eq!(median_interval([2.0, 1.0, 3.0]), Some([1.0, 3.0]));
        assert_eq!(median_interval([]), None);
    }

    #[test]
    fn quantiles_lie_between_the_values() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0]), Some(2.5));
        assert_eq!(quantile([0.0, 10.0, 20.0], 0.9), Some(18.0));
        assert_eq!(median([]), None);
    }
}
