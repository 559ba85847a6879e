//! Margin of a pose over its alternatives, and the probability of error, p_wrong.

use super::super::likelihood::IndistinctDifference;

/// Log-likelihood per unit of log-odds: observations are correlated.
pub(super) const SOFTNESS: f64 = 5.0;
/// Log-odds of the squared margin, in units.
const LOG_ODDS_PER_SQUARE: f64 = 0.105;
/// Minimum unit of the margin.
const MIN_UNIT: f64 = 4.7;
/// Unit of the margin per outlier, which may be an inlier of an alternative.
const UNIT_PER_OUTLIER: f64 = 0.075;
/// Unit of the distinct part of the margin.
const DISTINCT_UNIT: f64 = 3.5;
/// Log-odds of the squared indistinct part, in standard deviations.
const INDISTINCT_PER_SQUARE: f64 = 0.3;
/// Minimum standard deviation of the indistinct part.
const MIN_INDISTINCT_SIGMA: f64 = 9.4;
/// Smallest reported probability: too few poses were simulated to measure smaller ones.
const MIN_MEASURED: f64 = 1e-4;

/// Evidence for a pose against its alternatives.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Margin {
    /// Log-likelihood ratio to the most probable alternative.
    pub log_ratio: f64,
    /// Part of the ratio from regions that fit both poses about equally well.
    pub indistinct: f64,
    /// Standard deviation of that part if both poses are equally right.
    pub indistinct_sigma: f64,
    /// Number of independent outliers; those that the map contradicts count threefold.
    pub outliers: f64,
    /// Effective number of alternatives, each weighted by its probability relative to the most probable one.
    pub alternatives: f64,
}

impl Margin {
    /// Combines the log-likelihood ratios to several alternatives; `None` if there are none.
    pub(super) fn over(
        alternatives: impl IntoIterator<Item = (f64, IndistinctDifference)>,
        outliers: f64,
    ) -> Option<Margin> {
        let one = |(log_ratio, indistinct): (f64, IndistinctDifference)| Margin {
            log_ratio,
            indistinct: indistinct.difference,
            indistinct_sigma: indistinct.sigma,
            outliers,
            alternatives: 1.0,
        };
        let mut all: Vec<Margin> = alternatives.into_iter().map(one).collect();
        all.sort_by(|a, b| a.log_odds_over_one().total_cmp(&b.log_odds_over_one()));
        let most_likely = *all.first()?;
        let weight =
            |other: &Margin| (most_likely.log_odds_over_one() - other.log_odds_over_one()).exp();
        let others: f64 = all.iter().skip(1).map(weight).sum();
        Some(Margin {
            alternatives: 1.0 + others,
            ..most_likely
        })
    }

    /// Probability that the pose is wrong and an alternative is right.
    ///
    /// Log-odds grow with the square of the margin, limited by its distinct part. The constants are fitted to
    /// simulated scenes and a room, see `docs/decisions/0024-p-wrong.md`.
    pub fn p_wrong(&self) -> f64 {
        1.0 / (1.0 + (self.log_odds_over_one() - self.log_alternatives()).exp())
    }

    /// Log-likelihood ratio at which `p_wrong` is reached if all further evidence is distinct.
    pub fn threshold(&self, p_wrong: f64) -> f64 {
        let odds = ((1.0 - p_wrong) / p_wrong).ln() + self.log_alternatives();
        let distinct =
            DISTINCT_UNIT * signed_root((odds - self.indistinct_log_odds()) / LOG_ODDS_PER_SQUARE);
        (self.unit() * signed_root(odds / LOG_ODDS_PER_SQUARE)).max(self.indistinct + distinct)
    }

    /// Log-odds of an error at a margin of zero.
    fn log_alternatives(&self) -> f64 {
        self.alternatives.max(1.0).ln()
    }

    /// Log-odds over one alternative.
    fn log_odds_over_one(&self) -> f64 {
        let by_total = LOG_ODDS_PER_SQUARE * signed_square(self.log_ratio / self.unit());
        let by_distinct =
            LOG_ODDS_PER_SQUARE * signed_square((self.log_ratio - self.indistinct) / DISTINCT_UNIT);
        by_total.min(by_distinct + self.indistinct_log_odds())
    }

    /// Log-odds over one alternative from the indistinct part.
    fn indistinct_log_odds(&self) -> f64 {
        INDISTINCT_PER_SQUARE
            * signed_square(self.indistinct / self.indistinct_sigma.max(MIN_INDISTINCT_SIGMA))
    }

    /// Log-likelihood per unit of the margin.
    fn unit(&self) -> f64 {
        MIN_UNIT.max(UNIT_PER_OUTLIER * self.outliers)
    }
}

/// Square with the sign of `x`.
fn signed_square(x: f64) -> f64 {
    x * x.abs()
}

/// Inverse of [`signed_square`].
fn signed_root(x: f64) -> f64 {
    x.abs().sqrt().copysign(x)
}

/// Formats the probability of error, bounded below by 1e-4.
pub fn describe_p_wrong(p_wrong: f64) -> String {
    match p_wrong {
        p if p < MIN_MEASURED => format!("probability of error below {MIN_MEASURED:.0e}"),
        p => format!("probability of error {p:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A margin whose difference is distinct.
    fn margin(log_ratio: f64, outliers: f64) -> Margin {
        Margin {
            log_ratio,
            indistinct_sigma: 5.0,
            outliers,
            alternatives: 1.0,
            ..Margin::default()
        }
    }

    #[test]
    fn p_wrong_falls_with_the_log_ratio() {
        let tie = margin(0.0, 10.0).p_wrong();
        assert_eq!(tie, 0.5);
        let sure = margin(60.0, 10.0);
        assert!(sure.p_wrong() < 0.01 && margin(30.0, 10.0).p_wrong() > 0.01);
        // Outliers reduce the evidence.
        assert!(margin(60.0, 200.0).p_wrong() > sure.p_wrong());
        assert!((margin(sure.threshold(0.01), 10.0).p_wrong() - 0.01).abs() < 1e-12);
        assert!((margin(sure.threshold(0.9), 10.0).p_wrong() - 0.9).abs() < 1e-12);
        // The pose from a guess may be behind an alternative.
        assert!(margin(-60.0, 10.0).p_wrong() > 0.99);
        assert_eq!(margin(f64::INFINITY, 10.0).p_wrong(), 0.0);
    }

    #[test]
    fn an_indistinct_difference_is_not_enough() {
        let indistinct = |log_ratio: f64, indistinct: f64, indistinct_sigma: f64| Margin {
            indistinct,
            indistinct_sigma,
            ..margin(log_ratio, 0.0)
        };
        assert!(margin(40.0, 0.0).p_wrong() < 0.01);
        // 3.5 standard deviations of the indistinct part, as alike places sometimes reach.
        assert!(indistinct(42.0, 42.0, 12.0).p_wrong() > 0.01);
        assert!(indistinct(60.0, 60.0, 12.0).p_wrong() < 0.01);
        // With an indistinct part, a distinct part suffices that suffices alone.
        assert!(indistinct(60.0, 20.0, 12.0).p_wrong() < 0.01);
        for margin in [indistinct(42.0, 42.0, 12.0), indistinct(9.0, 20.0, 12.0)] {
            let log_ratio = margin.threshold(0.01);
            let there = Margin {
                log_ratio,
                ..margin
            };
            assert!((there.p_wrong() - 0.01).abs() < 1e-12);
        }
    }

    #[test]
    fn alternatives_count_by_their_probability() {
        let p_wrong = |places: &[(f64, f64)]| {
            let indistinct = |difference, sigma| IndistinctDifference { difference, sigma };
            let places = places
                .iter()
                .map(|(log, by_chance)| (*log, indistinct(*by_chance, 12.0)));
            Margin::over(places, 10.0).unwrap().p_wrong()
        };
        let odds = |p: f64| p / (1.0 - p);
        // Of four equal poses, the other three are three times as probable as the other one of two.
        let four = odds(p_wrong(&[(0.0, 0.0); 3]));
        assert!((four / odds(p_wrong(&[(0.0, 0.0)])) - 3.0).abs() < 1e-9);
        let one = p_wrong(&[(25.0, 0.0)]);
        assert!((odds(p_wrong(&[(25.0, 0.0), (25.0, 0.0)])) / odds(one) - 2.0).abs() < 1e-9);
        assert!((p_wrong(&[(25.0, 0.0), (900.0, 0.0)]) - one).abs() < 1e-12);
        // An alternative further behind may be more probable if the difference is indistinct.
        let (clear, by_chance) = (
            IndistinctDifference::default(),
            IndistinctDifference {
                difference: 40.0,
                sigma: 20.0,
            },
        );
        let margin = Margin::over([(30.0, clear), (40.0, by_chance)], 10.0).unwrap();
        assert_eq!((margin.log_ratio, margin.indistinct), (40.0, 40.0));
        assert!(margin.alternatives < 1.1 && margin.alternatives > 1.0);
        assert_eq!(Margin::over([], 10.0), None);
    }

    #[test]
    fn a_probability_too_small_to_measure_is_a_bound() {
        assert!(describe_p_wrong(0.0042).ends_with("error 4e-3"));
        assert!(describe_p_wrong(1e-69).ends_with("below 1e-4"));
    }
}
