//! Margin of a pose over all others, and the probability that another is right.

/// Log-likelihood that is worth a natural logarithm of odds: observations are not independent.
pub(super) const SOFTNESS: f64 = 5.0;
/// Least unit of a margin.
const UNIT: f64 = 4.5;
/// The unit for each standard deviation that chance gives the margin.
const PER_CHANCE: f64 = 0.5;
/// The same for each observation without a partner, which might have one elsewhere.
const PER_UNEXPLAINED: f64 = 0.08;
/// Logarithm of the odds against a pose without a margin: rooms that look alike often do from more than two places.
const TIE: f64 = 1.0;
/// Logarithm of the odds that the square of a unit is worth: chance makes margins that are normally distributed.
const SQUARE: f64 = 0.111;
/// Least probability that is told: there are too few simulated poses to measure smaller ones.
const LEAST_MEASURED: f64 = 1e-4;

/// Evidence for a pose against all others.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Margin {
    /// Log-likelihood above that of the best different pose.
    pub log: f64,
    /// Standard deviation of that, were both poses equally right.
    pub chance: f64,
    /// Independent observations that have no partner at the pose.
    pub unexplained: f64,
}

impl Margin {
    /// Probability that the pose is wrong, and another one right.
    ///
    /// Logistic in the square of the margin; its constants are fitted to simulated scenes, see `docs/calibration.md`.
    pub fn p_wrong(&self) -> f64 {
        let units = self.log / self.scale();
        1.0 / (1.0 + (SQUARE * units * units.abs() - TIE).exp())
    }

    /// The margin at which the pose is wrong with a probability.
    pub fn at(&self, p_wrong: f64) -> f64 {
        let square = (((1.0 - p_wrong) / p_wrong).ln() + TIE) / SQUARE;
        self.scale() * square.abs().sqrt().copysign(square)
    }

    fn scale(&self) -> f64 {
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
        };
        assert!(margin(0.0, 5.0, 10.0).p_wrong() > 0.5);
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
    fn a_probability_too_small_to_measure_is_told_as_that() {
        assert!(p_wrong_in_words(0.0042).ends_with("of 4e-3"));
        assert!(p_wrong_in_words(1e-69).ends_with("below 1e-4"));
    }
}
