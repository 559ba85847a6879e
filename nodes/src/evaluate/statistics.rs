//! Small statistics.

use serde::Serialize;

/// Normal quantile of a two-sided 95 % interval.
const Z: f64 = 1.959_963_984_540_054;

/// How many of how many, with the 95 % interval of Wilson (1927).
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Share {
    /// How many.
    pub k: usize,
    /// Of how many.
    pub n: usize,
    /// k / n; None of none.
    pub share: Option<f64>,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Share {
    /// Of those for which something holds.
    pub fn of(holds: impl IntoIterator<Item = bool>) -> Share {
        let (mut k, mut n) = (0, 0);
        for one in holds {
            n += 1;
            k += usize::from(one);
        }
        Share::new(k, n)
    }

    /// `k` of `n`.
    pub fn new(k: usize, n: usize) -> Share {
        if n == 0 {
            return Share {
                k,
                n,
                share: None,
                low: 0.0,
                high: 1.0,
            };
        }
        let (count, share) = (n as f64, k as f64 / n as f64);
        let z2 = Z * Z / count;
        let middle = (share + z2 / 2.0) / (1.0 + z2);
        let half = Z * (share * (1.0 - share) / count + z2 / (4.0 * count)).sqrt() / (1.0 + z2);
        Share {
            k,
            n,
            share: Some(share),
            low: (middle - half).max(0.0),
            high: (middle + half).min(1.0),
        }
    }
}

/// The median; None of nothing.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    quantile(values, 0.5)
}

/// A quantile from 0 to 1, linear between the values; None of nothing.
pub fn quantile(values: impl IntoIterator<Item = f64>, share: f64) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let at = share.clamp(0.0, 1.0) * values.len().checked_sub(1)? as f64;
    let (low, high) = (
        values.get(at.floor() as usize)?,
        values.get(at.ceil() as usize)?,
    );
    Some(low + (high - low) * at.fract())
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
            assert!(
                (share.low - low).abs() < 5e-5 && (share.high - high).abs() < 5e-5,
                "{share:?}"
            );
        }
        assert_eq!(Share::of([]).share, None);
        assert_eq!(Share::of([true, false]).share, Some(0.5));
    }

    #[test]
    fn quantiles_lie_between_the_values() {
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median([4.0, 1.0]), Some(2.5));
        assert_eq!(quantile([0.0, 10.0, 20.0], 0.9), Some(18.0));
        assert_eq!(median([]), None);
    }
}
