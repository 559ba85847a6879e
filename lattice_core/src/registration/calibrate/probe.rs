//! Directions that surfaces leave weak, measured by moving the pose along them.

use nalgebra::{Isometry3, Point3, RowVector6, Vector6};

use super::candidates::{Candidate, Workbench};
use super::covariance::PoseCovariance;
use super::margin::SOFTNESS;
use super::types::{DirectionKind, WeakDirection};
use crate::pose::se3;

/// Standard deviation beyond which a direction is weak, as a share of the largest that is accepted.
const WEAK: f64 = 0.25;
/// Weak directions that are measured, at most.
const MEASURED: usize = 3;
/// Distances by which what is seen is moved, in spacings of the map.
const STEPS: [f64; 4] = [1.0, 2.0, 4.0, 8.0];

impl Workbench<'_> {
    /// The covariance of a candidate's pose with what its likelihood says of the directions that surfaces and gravity
    /// leave weak: the ends of a wall and its labels hold a pose along the wall.
    ///
    /// The likelihood is that of a normal distribution through its least drop, so that one valley is enough to leave
    /// a direction weak.
    pub fn probed(&self, candidate: &Candidate, surfaces: PoseCovariance) -> PoseCovariance {
        let (pose, middle) = (&candidate.map_from_headset, self.middle());
        let upright = surfaces.with_gravity(pose, self.options.gravity_sigma_rad);
        let held = upright.unwrap_or(surfaces);
        let mut weak = held.directions(pose, &middle);
        weak.retain(|d| d.sigma > WEAK * self.options.max_sigma(d.kind));
        let weak = weak.iter().take(MEASURED);
        weak.fold(surfaces, |covariance, weak| {
            let along = Direction::new(weak, pose, &middle, &held);
            let variance = self.variance(candidate, weak.kind, &along);
            match variance < weak.sigma.powi(2) {
                true => covariance.measured(&along, variance),
                false => covariance,
            }
        })
    }

    /// Variance of a direction by how much less likely poses along it are; infinite if one of them is not.
    fn variance(&self, candidate: &Candidate, kind: DirectionKind, along: &Direction) -> f64 {
        let reach_m = match kind {
            DirectionKind::Translation => 1.0,
            DirectionKind::Rotation => self.reach_m(),
        };
        let steps = STEPS.into_iter().flat_map(|step| [step, -step]);
        let variances = steps.map(|step| {
            let step = step * self.map.spacing_m / reach_m;
            let moved = candidate.map_from_headset * se3::exp(&(along.motion * step));
            let moved = self.judge(&self.fit, moved, candidate.method);
            let drop = candidate.total() - moved.total();
            match drop > 0.0 {
                true => 0.5 * SOFTNESS * step * step / drop,
                false => f64::INFINITY,
            }
        });
        variances.fold(0.0, f64::max)
    }

    /// Root mean square distance of the headset's points from their midst, metres.
    fn reach_m(&self) -> f64 {
        let (middle, points): (Point3<f64>, _) = (self.middle(), self.input.few.points_m());
        let sum: f64 = points.iter().map(|p| (p - middle).norm_squared()).sum();
        (sum / points.len().max(1) as f64)
            .sqrt()
            .max(self.map.spacing_m)
    }
}

/// A direction of the place of a source point, or of the orientation.
#[derive(Clone, Copy, Debug)]
struct Direction {
    /// Derivative of the place or the angle along it by a motion and a turn on the right of the pose.
    lever: RowVector6<f64>,
    /// Motion and turn that move the pose by a unit along it, and along all else as far as both go together.
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
    /// With a measurement of how far the pose is off along a direction of the place of a source point or of the
    /// orientation: its variance.
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
    use super::*;
    use nalgebra::{Matrix6, Vector3};

    #[test]
    fn a_measurement_tells_the_direction_that_was_weak() {
        let pose = Isometry3::new(Vector3::new(1.0, 2.0, 0.0), Vector3::z());
        let middle = Point3::new(2.0, 0.5, 0.0);
        let loose = PoseCovariance {
            at_source: Matrix6::identity() * 1e-4
                + Matrix6::from_diagonal(&Vector6::new(0.0, 4.0, 0.0, 0.0, 0.0, 0.0)),
        };
        let weak = loose.directions(&pose, &middle)[0];
        assert!((weak.sigma - 2.0).abs() < 1e-3);
        let direction = Direction::new(&weak, &pose, &middle, &loose);
        assert!(((direction.lever * direction.motion)[0] - 1.0).abs() < 1e-9);
        let told = loose.measured(&direction, 0.01 * 0.01);
        let after = told.directions(&pose, &middle);
        assert!(after[0].sigma < 0.03);
    }
}
