//! Motion during a scan, and points as seen from its end.

use nalgebra::{Isometry3, UnitQuaternion, Vector3, Vector6};
use rayon::prelude::*;

use crate::cloud::NO_TIME_NS;
use crate::pose::se3;

/// Number of poses of a sweep. Points are interpolated between them, with an error of `range (angle / 16)² / 8`: 0.3
/// mm at 60 m and 0.1 rad.
const STEPS: usize = 16;

/// Sample of a gyroscope: angular rate in the base frame, rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AngularRate {
    /// Time, ns.
    pub stamp_ns: i64,
    /// Rate about the axes of the base, rad/s.
    pub rate_rad_per_s: Vector3<f64>,
}

/// Poses of the base during a scan, relative to the pose at its end.
pub(super) struct Sweep {
    first_ns: i64,
    step_ns: f64,
    end_from_base: Vec<Isometry3<f64>>,
}

impl Sweep {
    /// Sweep at constant velocity (m/s and rad/s in the base frame), with the rotations of the gyroscope if there are
    /// samples.
    pub fn new(
        first_ns: i64,
        end_ns: i64,
        velocity: &Vector6<f64>,
        rates: &[AngularRate],
    ) -> Sweep {
        let step_ns = end_ns.saturating_sub(first_ns).max(0) as f64 / STEPS as f64;
        let pose = |step: usize| {
            let before_ns = step_ns * (STEPS - step) as f64;
            let mut pose = se3::exp(&(velocity * (-1e-9 * before_ns)));
            if !rates.is_empty() {
                let at_ns = end_ns.saturating_sub(before_ns as i64);
                pose.rotation = turn(rates, at_ns, end_ns).inverse();
            }
            pose
        };
        Sweep {
            first_ns,
            step_ns,
            end_from_base: (0..=STEPS).map(pose).collect(),
        }
    }

    /// Pose of the base at the beginning, in the frame of the base at the end.
    pub fn first(&self) -> Isometry3<f64> {
        self.end_from_base.first().copied().unwrap_or_default()
    }

    /// Points deskewed to the end of the sweep, metres; points without a time are unchanged.
    pub fn deskew(&self, points_m: &[Vector3<f64>], times_ns: Option<&[i64]>) -> Vec<Vector3<f64>> {
        let Some(times_ns) = times_ns.filter(|_| self.step_ns > 0.0) else {
            return points_m.to_vec();
        };
        let moved = points_m.par_iter().zip(times_ns);
        moved
            .map(|(point, time_ns)| self.place(point, *time_ns))
            .collect()
    }

    fn place(&self, point: &Vector3<f64>, time_ns: i64) -> Vector3<f64> {
        if time_ns == NO_TIME_NS {
            return *point;
        }
        let at = time_ns.saturating_sub(self.first_ns) as f64 / self.step_ns;
        let at = at.clamp(0.0, STEPS as f64);
        let step = (at as usize).min(STEPS - 1);
        let part = at - step as f64;
        let (Some(a), Some(b)) = (
            self.end_from_base.get(step),
            self.end_from_base.get(step + 1),
        ) else {
            return *point;
        };
        let seen = |pose: &Isometry3<f64>| pose.rotation * point + pose.translation.vector;
        seen(a) * (1.0 - part) + seen(b) * part
    }
}

/// Rotation of the base from one time to another by the samples between, each of which holds until the next.
pub(super) fn turn(rates: &[AngularRate], from_ns: i64, to_ns: i64) -> UnitQuaternion<f64> {
    let mut turned = UnitQuaternion::identity();
    for (i, rate) in rates.iter().enumerate() {
        let begin_ns = if i == 0 {
            from_ns
        } else {
            rate.stamp_ns.max(from_ns)
        };
        let next = rates.get(i + 1).map_or(to_ns, |next| next.stamp_ns);
        let seconds = next.min(to_ns).saturating_sub(begin_ns) as f64 * 1e-9;
        if seconds > 0.0 {
            turned *= UnitQuaternion::from_scaled_axis(rate.rate_rad_per_s * seconds);
        }
    }
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fixed_point_stays_one_point_while_the_sensor_moves() {
        let velocity = Vector6::new(8.0, 1.0, 0.0, 0.0, 0.1, 0.8);
        let target = Vector3::new(20.0, -7.0, 2.0);
        let times: Vec<i64> = (0..=100).map(|i| 5_000 + i * 1_000_000).collect();
        let end_ns = *times.last().unwrap();
        let seen = times.iter().map(|t| {
            let end_from_base = se3::exp(&(velocity * ((t - end_ns) as f64 * 1e-9)));
            end_from_base.inverse() * nalgebra::Point3::from(target)
        });
        let seen: Vec<_> = seen.map(|p| p.coords).collect();
        let sweep = Sweep::new(times[0], end_ns, &velocity, &[]);
        for point in sweep.deskew(&seen, Some(&times)) {
            assert!((point - target).norm() < 1e-3, "{point}");
        }
        let rates = times.iter().map(|t| AngularRate {
            stamp_ns: *t,
            rate_rad_per_s: velocity.fixed_rows::<3>(3).into_owned(),
        });
        let rates: Vec<_> = rates.collect();
        let mut straight = velocity;
        straight.fixed_rows_mut::<3>(3).fill(0.0);
        let sweep = Sweep::new(times[0], end_ns, &straight, &rates);
        for point in sweep.deskew(&seen, Some(&times)) {
            // The translation bends by half of the angle over 0.1 s, 0.04 rad of 0.8 m.
            assert!((point - target).norm() < 0.05, "{point}");
        }
        assert_eq!(sweep.deskew(&seen, None), seen);
    }
}
