//! Calibration regression: logistic regression of observed on stated log-odds, over all stated probabilities.

use nalgebra::{Matrix2, Vector2};

use super::statistics::Z;

/// Minimum number of outcomes of each kind.
const LEAST: usize = 10;
/// Probability below which values are not distinguished.
const SMALLEST: f64 = 1e-9;
/// Maximum number of Newton steps, and the step length at convergence.
const STEPS: usize = 50;
const CONVERGED: f64 = 1e-7;

/// Logistic curve of observed over stated log-odds (Cox 1958): intercept 0 and slope 1 if both are equal.
#[derive(Clone, Copy, Debug)]
pub struct CalibrationCurve {
    parameters: Vector2<f64>,
    covariance: Matrix2<f64>,
}

impl CalibrationCurve {
    /// Fits the curve to stated probabilities and outcomes; `None` if there are too few of one kind.
    pub fn fit(outcomes: &[(f64, bool)]) -> Option<CalibrationCurve> {
        let were = outcomes.iter().filter(|(_, was)| *was).count();
        if were < LEAST || outcomes.len() - were < LEAST {
            return None;
        }
        let mut parameters = Vector2::new(0.0, 1.0);
        for _ in 0..STEPS {
            let (gradient, information) = derivatives(outcomes, &parameters);
            let covariance = information.try_inverse()?;
            let mut step = covariance * gradient;
            if step.norm() < CONVERGED {
                return Some(CalibrationCurve {
                    parameters,
                    covariance,
                });
            }
            // A full step may overshoot if few outcomes constrain the curve.
            let here = log_likelihood(outcomes, &parameters);
            while log_likelihood(outcomes, &(parameters + step)) < here {
                step *= 0.5;
                if step.norm() < CONVERGED {
                    return None;
                }
            }
            parameters += step;
        }
        None
    }

    /// Slope and its standard deviation.
    pub fn slope(&self) -> (f64, f64) {
        (self.parameters.y, self.covariance.m22.sqrt())
    }

    /// Observed probability for a stated one, between the ends of its 95 % interval.
    pub fn observed(&self, stated: f64) -> [f64; 3] {
        let at = Vector2::new(1.0, log_odds(stated));
        let half = Z * (self.covariance * at).dot(&at).sqrt();
        [-half, 0.0, half].map(|off| logistic(self.parameters.dot(&at) + off))
    }
}

/// Gradient of the log-likelihood, and its negative second derivatives.
fn derivatives(
    outcomes: &[(f64, bool)],
    parameters: &Vector2<f64>,
) -> (Vector2<f64>, Matrix2<f64>) {
    let mut sums = (Vector2::zeros(), Matrix2::zeros());
    for (stated, was) in outcomes {
        let at = Vector2::new(1.0, log_odds(*stated));
        let p = logistic(parameters.dot(&at));
        sums.0 += at * (f64::from(*was) - p);
        sums.1 += at * at.transpose() * (p * (1.0 - p));
    }
    sums
}

fn log_likelihood(outcomes: &[(f64, bool)], parameters: &Vector2<f64>) -> f64 {
    let of_one = |(stated, was): &(f64, bool)| {
        let log_odds = parameters.dot(&Vector2::new(1.0, log_odds(*stated)));
        let against = if *was { -log_odds } else { log_odds };
        -against.max(0.0) - (-against.abs()).exp().ln_1p()
    };
    outcomes.iter().map(of_one).sum()
}

fn log_odds(p: f64) -> f64 {
    let p = p.clamp(SMALLEST, 1.0 - SMALLEST);
    (p / (1.0 - p)).ln()
}

fn logistic(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Outcomes whose log-odds are `slope` times the stated ones, from 1:1 down to 1e-4.
    fn outcomes(slope: f64) -> Vec<(f64, bool)> {
        let random = &mut Stream::numbered(7, 1);
        let one = |_| {
            let stated = logistic(-9.2 * random.uniform());
            let was = random.uniform() < logistic(slope * log_odds(stated));
            (stated, was)
        };
        (0..8000).map(one).collect()
    }

    #[test]
    fn the_curve_is_that_of_the_outcomes() {
        for slope in [0.5, 1.0, 2.0] {
            let curve = CalibrationCurve::fit(&outcomes(slope)).unwrap();
            let (found, sigma) = curve.slope();
            assert!(
                (found - slope).abs() < 3.0 * sigma && sigma < 0.1 * slope,
                "{found} {sigma}"
            );
            let [low, p, high] = curve.observed(0.01);
            let right = logistic(slope * log_odds(0.01));
            assert!(low < p && p < high && right > 0.7 * low && right < 1.4 * high);
        }
    }

    #[test]
    fn too_few_outcomes_have_no_curve() {
        assert!(CalibrationCurve::fit(&[]).is_none());
        let never: Vec<(f64, bool)> = outcomes(1.0).into_iter().map(|(p, _)| (p, false)).collect();
        assert!(CalibrationCurve::fit(&never).is_none());
        // No curve of finite slope is the most likely one here.
        let split: Vec<(f64, bool)> = (1..100).map(|i| (f64::from(i) / 100.0, i > 50)).collect();
        assert!(CalibrationCurve::fit(&split).is_none());
    }
}
