//! Log-odds in fixed point.

use thiserror::Error;

/// Step of log-odds in fixed point.
pub const LOG_ODDS_STEP: f64 = 1.0 / 32.0;

/// Log-odds of an unknown cell.
pub(super) const UNKNOWN: i8 = i8::MIN;

/// Sensor model: probabilities of hits and misses; the defaults are those of OctoMap.
///
/// Log-odds `ln(p / (1 - p))` are rounded to steps of 1/32. With the defaults a hit adds 0.844, a miss subtracts
/// 0.406, and cells stay within -2 and 3.5.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Evidence {
    /// Occupancy probability after one hit, above 0.5.
    pub hit: f64,
    /// Occupancy probability after one miss, below 0.5.
    pub miss: f64,
    /// Minimum occupancy probability (clamping).
    pub least: f64,
    /// Maximum occupancy probability (clamping).
    pub most: f64,
    /// Occupancy threshold.
    pub threshold: f64,
}

impl Default for Evidence {
    fn default() -> Evidence {
        Evidence {
            hit: 0.7,
            miss: 0.4,
            least: 0.1192,
            most: 0.971,
            threshold: 0.5,
        }
    }
}

impl Evidence {
    /// Validates the probabilities.
    pub fn check(&self) -> Result<(), EvidenceError> {
        Steps::new(self).map(|_| ())
    }
}

/// Inconsistent probabilities.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
#[error(
    "hit {}, miss {}, least {}, most {}, threshold {}: all must be between 0.02 and 0.98, miss < 0.5 \
     < hit, least < threshold <= most and least < 0.5 < most, each by a log-odds of 1/32 or more",
    .0.hit, .0.miss, .0.least, .0.most, .0.threshold
)]
pub struct EvidenceError(pub Evidence);

/// Next log-odds for each current value.
#[derive(Clone, Debug)]
pub(super) struct Steps {
    after_hit: [i8; 256],
    after_miss: [i8; 256],
    pub(super) threshold: i8,
}

impl Steps {
    pub(super) fn new(evidence: &Evidence) -> Result<Steps, EvidenceError> {
        let error = EvidenceError(*evidence);
        let in_units = |p: f64| {
            let fits = (0.02..=0.98).contains(&p);
            let rounded = fits.then(|| (log_odds(p) / LOG_ODDS_STEP).round() as i32);
            rounded.ok_or(error)
        };
        let (up, down) = (in_units(evidence.hit)?, in_units(evidence.miss)?);
        let (low, high) = (in_units(evidence.least)?, in_units(evidence.most)?);
        let threshold = in_units(evidence.threshold)?;
        if up < 1 || down > -1 || low > -1 || high < 1 || low >= threshold || threshold > high {
            return Err(error);
        }
        let table = |add: i32| {
            let mut next = [UNKNOWN; 256];
            for (bits, next) in next.iter_mut().enumerate() {
                let now = bits as u8 as i8;
                let now = if now == UNKNOWN { 0 } else { i32::from(now) };
                *next = (now + add).clamp(low, high) as i8;
            }
            next
        };
        Ok(Steps {
            after_hit: table(up),
            after_miss: table(down),
            threshold: threshold as i8,
        })
    }

    #[inline(always)]
    pub(super) fn hit(&self, cell: &mut i8) {
        *cell = self.after_hit[usize::from(*cell as u8)];
    }

    #[inline(always)]
    pub(super) fn miss(&self, cell: &mut i8) {
        *cell = self.after_miss[usize::from(*cell as u8)];
    }
}

/// `ln(p / (1 - p))` by the series of 2 atanh(2 p - 1), bit-identical on every machine.
fn log_odds(p: f64) -> f64 {
    let x = 2.0 * p - 1.0;
    let (mut power, mut sum) = (x, 0.0);
    for k in 0..1000 {
        sum += power / f64::from(2 * k + 1);
        power *= x * x;
    }
    2.0 * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_the_logarithm() {
        for i in 20..=980 {
            let p = f64::from(i) / 1000.0;
            assert!((log_odds(p) - (p / (1.0 - p)).ln()).abs() < 1e-12, "{p}");
        }
    }

    #[test]
    fn the_defaults_are_those_of_octomap_within_the_rounding() {
        let steps = Steps::new(&Evidence::default()).unwrap();
        let mut cell = UNKNOWN;
        let mut after = |step: fn(&Steps, &mut i8), times: usize, expected: f64| {
            (0..times).for_each(|_| step(&steps, &mut cell));
            let found = f64::from(cell) * LOG_ODDS_STEP;
            assert!(
                (found - expected).abs() < 0.5 * LOG_ODDS_STEP,
                "{found} {expected}"
            );
        };
        after(Steps::hit, 1, 0.8473);
        after(Steps::hit, 10, 3.5110);
        after(Steps::miss, 1, 3.5110 - 0.4055);
        after(Steps::miss, 20, -2.0);
        assert_eq!(steps.threshold, 0);
    }

    #[test]
    fn what_does_not_go_together_is_refused() {
        let good = Evidence::default();
        for bad in [
            Evidence { hit: 0.5, ..good },
            Evidence { miss: 0.51, ..good },
            Evidence { most: 1.0, ..good },
            Evidence { least: 0.6, ..good },
        ] {
            assert!(Steps::new(&bad).is_err(), "{bad:?}");
        }
        for bad in [f64::NAN, 0.99, 0.1] {
            let (hit, threshold) = (bad, bad);
            assert!(Steps::new(&Evidence { hit, ..good }).is_err(), "{bad}");
            assert!(
                Steps::new(&Evidence { threshold, ..good }).is_err(),
                "{bad}"
            );
        }
    }
}
