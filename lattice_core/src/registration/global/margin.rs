//! Margin of a pose over all others, and the probability that another is right.

use super::super::likelihood::Even;

/// Log-likelihood that is worth a natural logarithm of odds: observations are not independent.
pub(super) const SOFTNESS: f64 = 5.0;
/// Logarithm of the odds that the square of a unit is worth.
const SQUARE: f64 = 0.105;
/// Least unit of a margin.
const UNIT: f64 = 4.7;
/// The unit for each observation without a partner, which might have one elsewhere.
const PER_UNEXPLAINED: f64 = 0.075;
/// Unit of what stands out from chance.
const UNIT_OUT: f64 = 3.5;
/// Logarithm of the odds that the square of a standard deviation of what may be chance is worth.
const EVEN: f64 = 0.3;
/// Least such deviation.
const LEAST_CHANCE: f64 = 9.4;
/// Least probability that is told: there are too few simulated poses to measure smaller ones.
const LEAST_MEASURED: f64 = 1e-4;

/// Evidence for a pose against all others.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Margin {
    /// Log-likelihood above that of the different pose that is most probably right in its place.
    pub log: f64,
    /// Part of it from where the points fit both poses about as well, which may be chance.
    pub even: f64,
    /// Standard deviation that chance gives that part.
    pub chance: f64,
    /// Independent observations that have no partner at the pose; more for those that the map contradicts.
    pub unexplained: f64,
    /// Number of other places, in which each counts by how probable it is beside the most probable one.
    pub places: f64,
}

impl Margin {
    /// Over several other places, given the log-likelihood above each and how much of it may be chance; None over none.
    pub(super) fn over(
        places: impl IntoIterator<Item = (f64, Even)>,
        unexplained: f64,
    ) -> Option<Margin> {
        let one = |(log, Even { log: even, chance })| Margin {
            log,
            even,
            chance,
            unexplained,
            places: 1.0,
        };
        let mut all: Vec<Margin> = places.into_iter().map(one).collect();
        all.sort_by(|a, b| a.against().total_cmp(&b.against()));
        let most_likely = *all.first()?;
        let beside = |place: &Margin| (most_likely.against() - place.against()).exp();
        let others: f64 = all.iter().skip(1).map(beside).sum();
        Some(Margin {
            places: 1.0 + others,
            ..most_likely
        })
    }

    /// Probability that the pose is wrong, and another one right.
    ///
    /// Odds fall with the square of the margin, but no more than what chance does not make speaks for; the constants
    /// are fitted to simulated scenes and a room, see `docs/calibration.md`.
    pub fn p_wrong(&self) -> f64 {
        1.0 / (1.0 + (self.against() - self.without()).exp())
    }

    /// The margin at which the pose is wrong with a probability, if all that is added stands out from chance.
    pub fn at(&self, p_wrong: f64) -> f64 {
        let odds = ((1.0 - p_wrong) / p_wrong).ln() + self.without();
        let out = UNIT_OUT * root((odds - self.by_chance()) / SQUARE);
        (self.unit() * root(odds / SQUARE)).max(self.even + out)
    }

    /// Logarithm of the odds that it is wrong without a margin.
    fn without(&self) -> f64 {
        self.places.max(1.0).ln()
    }

    /// Logarithm of the odds against one other place.
    fn against(&self) -> f64 {
        let by_all = SQUARE * squared(self.log / self.unit());
        let by_what_stands_out = SQUARE * squared((self.log - self.even) / UNIT_OUT);
        by_all.min(by_what_stands_out + self.by_chance())
    }

    /// Logarithm of the odds against one other place by what may be chance.
    fn by_chance(&self) -> f64 {
        EVEN * squared(self.even / self.chance.max(LEAST_CHANCE))
    }

    fn unit(&self) -> f64 {
        UNIT.max(PER_UNEXPLAINED * self.unexplained)
    }
}

/// Square with the sign of the number.
fn squared(x: f64) -> f64 {
    x * x.abs()
}

/// The number of which [`squared`] is the square.
fn root(x: f64) -> f64 {
    x.abs().sqrt().copysign(x)
}

/// Probability that a pose is wrong, in words; below 1e-4 no number is told.
pub fn p_wrong_in_words(p_wrong: f64) -> String {
    match p_wrong {
        p if p < LEAST_MEASURED => format!("wrong with a probability below {LEAST_MEASURED:.0e}"),
        p => format!("wrong with a probability of {p:.0e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A margin that stands out from chance.
    fn margin(log: f64, unexplained: f64) -> Margin {
        Margin {
            log,
            chance: 5.0,
            unexplained,
            places: 1.0,
            ..Margin::default()
        }
    }

    #[test]
    fn the_more_speaks_for_a_pose_the_less_is_it_wrong() {
        let tie = margin(0.0, 10.0).p_wrong();
        assert_eq!(tie, 0.5);
        let sure = margin(60.0, 10.0);
        assert!(sure.p_wrong() < 0.01 && margin(30.0, 10.0).p_wrong() > 0.01);
        // What is not explained counts against it.
        assert!(margin(60.0, 200.0).p_wrong() > sure.p_wrong());
        assert!((margin(sure.at(0.01), 10.0).p_wrong() - 0.01).abs() < 1e-12);
        assert!((margin(sure.at(0.9), 10.0).p_wrong() - 0.9).abs() < 1e-12);
        // What stands by a start may be behind another.
        assert!(margin(-60.0, 10.0).p_wrong() > 0.99);
        assert_eq!(margin(f64::INFINITY, 10.0).p_wrong(), 0.0);
    }

    #[test]
    fn what_chance_makes_is_not_enough() {
        let even = |log: f64, even: f64, chance: f64| Margin {
            even,
            chance,
            ..margin(log, 0.0)
        };
        assert!(margin(40.0, 0.0).p_wrong() < 0.01);
        // Three deviations and a half of what may be chance, as places that are alike have now and then.
        assert!(even(42.0, 42.0, 12.0).p_wrong() > 0.01);
        assert!(even(60.0, 60.0, 12.0).p_wrong() < 0.01);
        // With it what stands out is enough that alone would be too.
        assert!(even(60.0, 20.0, 12.0).p_wrong() < 0.01);
        for margin in [even(42.0, 42.0, 12.0), even(9.0, 20.0, 12.0)] {
            let log = margin.at(0.01);
            let there = Margin { log, ..margin };
            assert!((there.p_wrong() - 0.01).abs() < 1e-12);
        }
    }

    #[test]
    fn places_count_by_how_probable_they_are() {
        let p_wrong = |places: &[(f64, f64)]| {
            let even = |log, chance| Even { log, chance };
            let places = places
                .iter()
                .map(|(log, by_chance)| (*log, even(*by_chance, 12.0)));
            Margin::over(places, 10.0).unwrap().p_wrong()
        };
        let odds = |p: f64| p / (1.0 - p);
        // Of four places that fit alike the others are three times as probable as one of two.
        let four = odds(p_wrong(&[(0.0, 0.0); 3]));
        assert!((four / odds(p_wrong(&[(0.0, 0.0)])) - 3.0).abs() < 1e-9);
        let one = p_wrong(&[(25.0, 0.0)]);
        assert!((odds(p_wrong(&[(25.0, 0.0), (25.0, 0.0)])) / odds(one) - 2.0).abs() < 1e-9);
        assert!((p_wrong(&[(25.0, 0.0), (900.0, 0.0)]) - one).abs() < 1e-12);
        // A place that is behind by more may still be the likelier one, if chance may have made that.
        let (clear, by_chance) = (
            Even::default(),
            Even {
                log: 40.0,
                chance: 20.0,
            },
        );
        let margin = Margin::over([(30.0, clear), (40.0, by_chance)], 10.0).unwrap();
        assert_eq!((margin.log, margin.even), (40.0, 40.0));
        assert!(margin.places < 1.1 && margin.places > 1.0);
        assert_eq!(Margin::over([], 10.0), None);
    }

    #[test]
    fn a_probability_too_small_to_measure_is_told_as_that() {
        assert!(p_wrong_in_words(0.0042).ends_with("of 4e-3"));
        assert!(p_wrong_in_words(1e-69).ends_with("below 1e-4"));
    }
}
