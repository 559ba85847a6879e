//! Margin of a pose over all others, and the probability that another is right.

/// Log-likelihood that is worth a natural logarithm of odds: observations are not independent.
pub(super) const SOFTNESS: f64 = 5.0;
/// Least unit of a margin.
const UNIT: f64 = 4.7;
/// The unit for each standard deviation that chance gives the margin.
const PER_CHANCE: f64 = 0.5;
/// The same for each observation without a partner, which might have one elsewhere.
const PER_UNEXPLAINED: f64 = 0.075;
/// Logarithm of the odds against a pose over one other place without a margin: more may have been missed.
const MISSED: f64 = 0.5;
/// Logarithm of the odds that the square of a unit is worth: chance makes margins that are normally distributed.
const SQUARE: f64 = 0.111;
/// Least probability that is told: there are too few simulated poses to measure smaller ones.
const LEAST_MEASURED: f64 = 1e-4;

/// Evidence for a pose against all others.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Margin {
    /// Log-likelihood above that of the different pose that is most probably right in its place.
    pub log: f64,
    /// Standard deviation of that, were both poses equally right.
    pub chance: f64,
    /// Independent observations that have no partner at the pose; more for those that the map contradicts.
    pub unexplained: f64,
    /// Number of other places, in which each counts by how probable it is beside the most probable one.
    pub places: f64,
}

impl Margin {
    /// Over several other places, given the log-likelihood above each and its standard deviation by chance; None over none.
    pub(super) fn over(
        places: impl IntoIterator<Item = (f64, f64)>,
        unexplained: f64,
    ) -> Option<Margin> {
        let one = |(log, chance)| Margin {
            log,
            chance,
            unexplained,
            places: 1.0,
        };
        let mut all: Vec<Margin> = places.into_iter().map(one).collect();
        all.sort_by(|a, b| a.against().total_cmp(&b.against()));
        let likeliest = *all.first()?;
        let beside = |place: &Margin| (likeliest.against() - place.against()).exp();
        let others: f64 = all.iter().skip(1).map(beside).sum();
        Some(Margin {
            places: 1.0 + others,
            ..likeliest
        })
    }

    /// Probability that the pose is wrong, and another one right.
    ///
    /// Odds fall with the square of the margin; its constants are fitted to simulated scenes and a room,
    /// see `docs/calibration.md`.
    pub fn p_wrong(&self) -> f64 {
        1.0 / (1.0 + (self.against() - self.without()).exp())
    }

    /// The margin at which the pose is wrong with a probability.
    pub fn at(&self, p_wrong: f64) -> f64 {
        let odds = ((1.0 - p_wrong) / p_wrong).ln() + self.without();
        self.unit() * (odds.abs() / SQUARE).sqrt().copysign(odds)
    }

    /// Logarithm of the odds that it is wrong without a margin.
    fn without(&self) -> f64 {
        MISSED + self.places.max(1.0).ln()
    }

    /// Logarithm of the odds against one other place.
    fn against(&self) -> f64 {
        let units = self.log / self.unit();
        SQUARE * units * units.abs()
    }

    fn unit(&self) -> f64 {
        let chance = PER_CHANCE * self.chance;
        UNIT.max(chance).max(PER_UNEXPLAINED * self.unexplained)
    }
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

    #[test]
    fn the_more_speaks_for_a_pose_the_less_is_it_wrong() {
        let margin = |log, chance, unexplained| Margin {
            log,
            chance,
            unexplained,
            places: 1.0,
        };
        let tie = margin(0.0, 5.0, 10.0).p_wrong();
        assert!((0.5..0.7).contains(&tie));
        let sure = margin(60.0, 5.0, 10.0);
        assert!(sure.p_wrong() < 0.01 && margin(30.0, 5.0, 10.0).p_wrong() > 0.01);
        // Chance and what is not explained both count against it.
        assert!(margin(60.0, 40.0, 10.0).p_wrong() > sure.p_wrong());
        assert!(margin(60.0, 5.0, 200.0).p_wrong() > sure.p_wrong());
        let least = sure.at(0.01);
        assert!((margin(least, 5.0, 10.0).p_wrong() - 0.01).abs() < 1e-12);
        assert!((margin(sure.at(0.9), 5.0, 10.0).p_wrong() - 0.9).abs() < 1e-12);
        // What stands by a start may be behind another.
        assert!(margin(-60.0, 5.0, 10.0).p_wrong() > 0.99);
        assert_eq!(margin(f64::INFINITY, 5.0, 10.0).p_wrong(), 0.0);
    }

    #[test]
    fn places_count_by_how_probable_they_are() {
        let p_wrong = |places: &[(f64, f64)]| {
            let margin = Margin::over(places.iter().copied(), 10.0);
            margin.unwrap().p_wrong()
        };
        let odds = |p: f64| p / (1.0 - p);
        // Of four places that fit alike the others are three times as probable as one of two.
        let four = odds(p_wrong(&[(0.0, 5.0); 3]));
        assert!((four / odds(p_wrong(&[(0.0, 5.0)])) - 3.0).abs() < 1e-9);
        let one = p_wrong(&[(25.0, 5.0)]);
        assert!((odds(p_wrong(&[(25.0, 5.0), (25.0, 5.0)])) / odds(one) - 2.0).abs() < 1e-9);
        assert!((p_wrong(&[(25.0, 5.0), (900.0, 5.0)]) - one).abs() < 1e-12);
        // A place that is behind by more may still be the likelier one, if chance is larger there.
        let margin = Margin::over([(50.0, 5.0), (60.0, 40.0)], 10.0).unwrap();
        assert_eq!((margin.log, margin.chance), (60.0, 40.0));
        assert!((margin.places - 1.0) < 0.1 && margin.places > 1.0);
        let least = margin.at(0.01);
        let there = Margin {
            log: least,
            ..margin
        };
        assert!((there.p_wrong() - 0.01).abs() < 1e-12);
        assert_eq!(Margin::over([], 10.0), None);
    }

    #[test]
    fn a_probability_too_small_to_measure_is_told_as_that() {
        assert!(p_wrong_in_words(0.0042).ends_with("of 4e-3"));
        assert!(p_wrong_in_words(1e-69).ends_with("below 1e-4"));
    }
}
