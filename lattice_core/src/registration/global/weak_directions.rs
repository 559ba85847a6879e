//! Weak directions of a pose: optimization of the pose and its variance along them by the likelihood.

use nalgebra::{Isometry3, Point3, RowVector6, Translation3, Vector6};
use rayon::prelude::*;

use super::super::likelihood::Fit;
use super::calibration::{DirectionKind, WeakDirection};
use super::candidates::{Candidate, RegistrationContext};
use super::covariance::PoseCovariance;
use super::error_model::covariance;
use super::margin::SOFTNESS;
use crate::pose::se3;

/// Standard deviation above which a direction is weak, as a fraction of its limit.
const WEAK: f64 = 0.25;
/// Maximum number of weak directions.
const MEASURED: usize = 3;
/// Displacement of the points in a rotation step, in spacings; surfaces constrain rotations better than translations.
const ROTATION_STEP: f64 = 0.25;
/// Number of steps to each side in the estimate of a variance.
const STEPS: u32 = 8;
/// Maximum odds of a step over none.
const MAX_ODDS: f64 = 1e6;
/// Step sizes of the line search, first pass.
const LARGE_STEPS: [f64; 5] = [8.0, 4.0, 2.0, 1.0, 0.5];
/// Step sizes of the line search, second pass.
const SMALL_STEPS: [f64; 3] = [2.0, 1.0, 0.5];

impl RegistrationContext<'_> {
    /// Reduces the variance along weak directions to that of the likelihood.
    ///
    /// The ends of a wall and its labels constrain a pose along the wall, which its surface alone does not.
    pub fn with_probed_variances(
        &self,
        candidate: &Candidate,
        surfaces: PoseCovariance,
    ) -> PoseCovariance {
        let weak = self.weak(candidate, &surfaces);
        weak.iter().fold(surfaces, |covariance, (weak, along)| {
            let variance = self.variance(candidate, weak.kind, along);
            match variance < weak.sigma.powi(2) {
                true => covariance.measured(along, variance),
                false => covariance,
            }
        })
    }

    /// Moves a candidate to the maximum of the likelihood along its weak directions, where registration drifts.
    pub fn optimize_weak_directions(&self, candidate: Candidate) -> Candidate {
        let begin = candidate.total();
        let far = self.optimize_by(candidate, &LARGE_STEPS);
        match far.total() > begin {
            // Other directions may be weak at the new pose.
            true => self.optimize_by(far, &SMALL_STEPS),
            false => far,
        }
    }

    /// Line search along each weak direction with the given step sizes.
    fn optimize_by(&self, candidate: Candidate, steps: &[f64]) -> Candidate {
        let Some(surfaces) = covariance(self, &candidate) else {
            return candidate;
        };
        let weak = self.weak(&candidate, &surfaces);
        weak.iter().fold(candidate, |best, (weak, along)| {
            let steps = steps.iter().map(|step| step * self.unit(weak.kind));
            steps.fold(best, |best, step| self.best_of_steps(best, along, step))
        })
    }

    /// The most likely of a candidate and its two neighbours at a step.
    fn best_of_steps(&self, candidate: Candidate, along: &Direction, step: f64) -> Candidate {
        let sides = [step, -step].map(|step| self.moved(&candidate, along, step));
        let likelier = |a: Candidate, b: Candidate| if b.total() > a.total() { b } else { a };
        sides.into_iter().fold(candidate, likelier)
    }

    /// Weak directions given surfaces and gravity, the weakest first of each kind.
    fn weak(
        &self,
        candidate: &Candidate,
        surfaces: &PoseCovariance,
    ) -> Vec<(WeakDirection, Direction)> {
        let (pose, centroid) = (&candidate.target_from_source, self.centroid());
        let upright = surfaces.with_gravity(pose, self.options.gravity_sigma_rad);
        let held = upright.as_ref().unwrap_or(surfaces);
        let mut weak = held.directions(pose, &centroid);
        weak.retain(|d| d.sigma > WEAK * self.options.max_sigma(d.kind));
        weak.truncate(MEASURED);
        let direction = |weak: WeakDirection| (weak, Direction::new(&weak, pose, &centroid, held));
        weak.into_iter().map(direction).collect()
    }

    fn moved(&self, candidate: &Candidate, along: &Direction, step: f64) -> Candidate {
        let moved = candidate.target_from_source * se3::exp(&(along.motion * step));
        self.evaluate(&self.fit, moved, candidate.method)
    }

    /// Variance along a direction about a pose, from the likelihoods of poses along it.
    fn variance(&self, candidate: &Candidate, kind: DirectionKind, along: &Direction) -> f64 {
        let unit = self.unit(kind);
        let drop = |step| candidate.total() - self.moved(candidate, along, step).total();
        variance_of_steps(unit, drop)
    }

    /// Variance of a vertical translation about a pose by a likelihood model of the source, m^2.
    pub fn vertical_variance(&self, candidate: &Candidate, fit: &Fit<'_>) -> f64 {
        let pose = &candidate.target_from_source;
        let total = |up_m: f64| {
            let moved = Translation3::new(0.0, 0.0, up_m) * pose;
            self.evaluate(fit, moved, candidate.method).total()
        };
        let here = total(0.0);
        variance_of_steps(self.map.spacing_m, |up_m| here - total(up_m))
    }

    /// Step along a direction: one spacing of the map, or the rotation that moves the points by [`ROTATION_STEP`] of
    /// it.
    fn unit(&self, kind: DirectionKind) -> f64 {
        match kind {
            DirectionKind::Translation => self.map.spacing_m,
            DirectionKind::Rotation => ROTATION_STEP * self.map.spacing_m / self.reach_m(),
        }
    }

    /// RMS distance of the source points from their centroid, metres.
    pub fn reach_m(&self) -> f64 {
        let (centroid, points): (Point3<f64>, _) = (self.centroid(), self.source.coarse.points_m());
        let sum: f64 = points.iter().map(|p| (p - centroid).norm_squared()).sum();
        (sum / points.len().max(1) as f64)
            .sqrt()
            .max(self.map.spacing_m)
    }
}

/// Second moment about 0 along a direction, given the decrease of the log-likelihood at a step.
fn variance_of_steps(unit: f64, drop: impl Fn(f64) -> f64 + Sync) -> f64 {
    let sides = (1..=STEPS).flat_map(|i| [f64::from(i), -f64::from(i)]);
    let steps: Vec<f64> = sides.map(|step| step * unit).collect();
    let steps = steps.par_iter().map(|step| (*step, drop(*step) / SOFTNESS));
    variance(unit, &steps.collect::<Vec<_>>())
}

/// Second moment about 0 along a direction, given the steps and their decrease of the log-odds.
fn variance(unit: f64, steps: &[(f64, f64)]) -> f64 {
    let (mut all, mut moment) = (1.0, 0.0);
    let mut narrow = 0.0_f64;
    for (step, drop) in steps {
        let likely = (-drop).exp().min(MAX_ODDS);
        all += likely;
        moment += likely * step * step;
        // A peak between two steps is approximated by a normal distribution.
        if step.abs() < 1.5 * unit {
            let peak = 0.5 * step * step / drop.max(f64::MIN_POSITIVE);
            narrow = narrow.max(peak.min(step * step));
        }
    }
    (moment / all).max(narrow)
}

/// Direction of a translation of the centroid or of a rotation.
#[derive(Clone, Copy, Debug)]
struct Direction {
    /// Derivative of the translation or the angle along it by a right perturbation of the pose (rho, phi).
    lever: RowVector6<f64>,
    /// Perturbation that moves the pose by one unit along it, together with correlated directions.
    motion: Vector6<f64>,
}

impl Direction {
    fn new(
        weak: &WeakDirection,
        target_from_source: &Isometry3<f64>,
        about: &Point3<f64>,
        covariance: &PoseCovariance,
    ) -> Direction {
        let axis = target_from_source.inverse_transform_vector(&weak.axis);
        let mut lever = RowVector6::zeros();
        match weak.kind {
            DirectionKind::Translation => {
                lever.fixed_columns_mut::<3>(0).tr_copy_from(&axis);
                let turning = about.coords.cross(&axis);
                lever.fixed_columns_mut::<3>(3).tr_copy_from(&turning);
            }
            DirectionKind::Rotation => lever.fixed_columns_mut::<3>(3).tr_copy_from(&axis),
        }
        let along = covariance.at_source * lever.transpose();
        let variance = (lever * along)[0].max(f64::MIN_POSITIVE);
        Direction {
            lever,
            motion: along / variance,
        }
    }
}

impl PoseCovariance {
    /// Kalman update with a measurement of variance `variance` along a direction.
    fn measured(&self, direction: &Direction, variance: f64) -> PoseCovariance {
        let along = self.at_source * direction.lever.transpose();
        let spread = (direction.lever * along)[0] + variance;
        let at_source = self.at_source - along * along.transpose() / spread;
        PoseCovariance {
            at_source: 0.5 * (at_source + at_source.transpose()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::CalibrationMap;
    use super::super::request::{CalibrationOptions, CalibrationRequest, SourceCloud};
    use super::super::source::PreparedSource;
    use super::*;
    use crate::registration::SemanticCloud;
    use nalgebra::{Matrix6, Vector3};

    #[test]
    fn a_measurement_tells_the_direction_that_was_weak() {
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 0.0), Vector3::z());
        let centroid = Point3::new(2.0, 0.5, 0.0);
        let loose = PoseCovariance {
            at_source: Matrix6::identity() * 1e-4
                + Matrix6::from_diagonal(&Vector6::new(0.0, 4.0, 0.0, 0.0, 0.0, 0.0)),
        };
        let weak = loose.directions(&pose, &centroid)[0];
        assert!((weak.sigma - 2.0).abs() < 1e-3);
        let direction = Direction::new(&weak, &pose, &centroid, &loose);
        assert!(((direction.lever * direction.motion)[0] - 1.0).abs() < 1e-9);
        let told = loose.measured(&direction, 0.01 * 0.01);
        let after = told.directions(&pose, &centroid);
        assert!(after[0].sigma < 0.03);
    }

    #[test]
    fn a_peak_has_the_variance_of_a_normal_distribution_and_a_valley_beside_it_widens_it() {
        let unit = 0.05;
        let steps = |drop: &dyn Fn(f64) -> f64| -> Vec<(f64, f64)> {
            let sides = (1..=STEPS).flat_map(|i| [f64::from(i), -f64::from(i)]);
            sides.map(|i| (i * unit, drop(i * unit))).collect()
        };
        for sigma in [0.01, 0.03, 0.05, 0.1] {
            let normal = variance(unit, &steps(&|step| 0.5 * (step / sigma).powi(2)));
            let ratio = normal.sqrt() / sigma;
            assert!((0.8..1.1).contains(&ratio), "{sigma}: {ratio}");
        }
        let another = |step: f64| if (step - 0.3).abs() < 0.01 { 0.0 } else { 9.0 };
        assert!(variance(unit, &steps(&another)).sqrt() > 0.15);
        assert!(variance(unit, &steps(&|_| f64::NEG_INFINITY)).is_finite());
    }

    /// Points 4 cm apart on a wall at x = 2 m with a flat box on it, as far as they are within the bounds of y and z.
    fn wall(y_m: f64, z_m: f64) -> SemanticCloud {
        let places = (-60..=60).flat_map(|y| (-60..=60).map(move |z| (y, z)));
        let places = places.map(|(y, z)| (0.04 * f64::from(y), 0.04 * f64::from(z)));
        let within = places.filter(|(y, z)| y.abs() < y_m && z.abs() < z_m);
        let point = |(y, z): (f64, f64)| {
            let before_m = if y.abs() < 0.5 && z.abs() < 0.3 {
                0.1
            } else {
                0.0
            };
            Point3::new(2.0 - before_m, y, z)
        };
        SemanticCloud::unlabelled(within.map(point).collect())
    }

    #[test]
    fn a_pose_that_slid_along_a_wall_climbs_back() {
        let map = CalibrationMap::new(wall(2.4, 1.4), 0.05).unwrap();
        let options = CalibrationOptions::default();
        let scan = SourceCloud {
            cloud: wall(1.4, 0.9),
            sensor_m: Some(Point3::origin()),
        };
        let request = CalibrationRequest {
            source_clouds: &[scan],
            start: None,
            confusion: None,
        };
        let source = PreparedSource::new(&request, &options, 0.05).unwrap();
        let context = RegistrationContext::new(&map, &source, &options, None);
        let off_m = |candidate: &Candidate| candidate.target_from_source.translation.vector.norm();
        for slide in [Vector3::y() * 0.3, Vector3::y() * -0.45, Vector3::z() * 0.2] {
            let slid = context.evaluate(
                &context.fit,
                Isometry3::new(slide, Vector3::zeros()),
                "search",
            );
            let back = context.optimize_weak_directions(slid.clone());
            assert!(
                back.total() > slid.total() && off_m(&back) < 0.05,
                "{slide}: {}",
                off_m(&back)
            );
        }
    }
}
