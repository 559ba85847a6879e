//! Motion between scans as a gyroscope and wheel odometry measure it.

use std::collections::VecDeque;

use lattice_core::odometry::AngularRate;
use lattice_core::pose::{
    PoseBuffer, PoseBufferOptions, PushOutcome, StampedPose, TransformBuffer,
};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::Imu;
use nalgebra::{Isometry3, Vector3};

use crate::convert::geometry;

/// Maximum time between two gyroscope samples that are integrated: a turn that changes by 10 rad/s² is then known to 1°, ns.
const MAX_RATE_GAP_NS: i64 = 60_000_000;
/// Maximum rate of a sample: twice the range of common gyroscopes (2000 °/s), rad/s.
const MAX_RATE_RAD_PER_S: f64 = 70.0;
/// Age from which samples are dropped, ns.
const KEPT_NS: i64 = 5_000_000_000;
/// Limit of samples.
const MAX_SAMPLES: usize = 20_000;
/// Age of the newest sample from which an input counts as ended, ns.
const ENDED_NS: i64 = 1_000_000_000;

/// Samples of a gyroscope and poses of wheels, of the last seconds.
pub(super) struct Motions {
    rates: VecDeque<AngularRate>,
    wheels: PoseBuffer,
}

impl Motions {
    /// Motions without samples.
    pub fn new() -> Self {
        Self {
            rates: VecDeque::new(),
            wheels: PoseBuffer::new(PoseBufferOptions::default()),
        }
    }

    /// Adds a sample of a gyroscope. `Err`: the reason why it is not used.
    pub fn on_imu(
        &mut self,
        imu: &Imu,
        base: &str,
        mounts: &mut TransformBuffer,
    ) -> Result<(), String> {
        if imu.angular_velocity_covariance.first() == Some(&-1.0) {
            return Err(
                "angular velocity covariance is -1: the Imu has no gyroscope (REP 145)".into(),
            );
        }
        let rate = &imu.angular_velocity;
        let rate = Vector3::new(rate.x, rate.y, rate.z);
        let norm = rate.norm();
        if norm.is_nan() || norm > MAX_RATE_RAD_PER_S {
            return Err(format!(
                "turns at {norm} rad/s, up to {MAX_RATE_RAD_PER_S} are plausible; expected rad/s, not °/s"
            ));
        }
        let stamp_ns = imu.header.stamp.to_ns();
        let base_from_imu = mount(&imu.header.frame_id, base, stamp_ns, mounts)?;
        if let Some(newest) = self.rates.back()
            && stamp_ns <= newest.stamp_ns
        {
            if newest.stamp_ns.saturating_sub(stamp_ns) <= ENDED_NS {
                return Err("is no later than the sample before".into());
            }
            self.rates.clear();
        }
        self.rates.push_back(AngularRate {
            stamp_ns,
            rate_rad_per_s: base_from_imu.rotation * rate,
        });
        let is_old = |oldest: &AngularRate| stamp_ns.saturating_sub(oldest.stamp_ns) > KEPT_NS;
        while self.rates.len() > MAX_SAMPLES || self.rates.front().is_some_and(is_old) {
            self.rates.pop_front();
        }
        Ok(())
    }

    /// Adds a pose of wheel odometry. `Err`: the reason why it is not used.
    pub fn on_wheels(
        &mut self,
        wheels: &Odometry,
        base: &str,
        mounts: &mut TransformBuffer,
    ) -> Result<(), String> {
        let stamp_ns = wheels.header.stamp.to_ns();
        let odom_from_child = geometry::isometry_from_pose(&wheels.pose.pose)
            .ok_or("position or quaternion is not finite, or zero")?;
        let base_from_child = mount(&wheels.child_frame_id, base, stamp_ns, mounts)?;
        let pose = StampedPose {
            stamp_ns,
            map_from_base: odom_from_child * base_from_child.inverse(),
        };
        match self.wheels.push(pose) {
            PushOutcome::Accepted | PushOutcome::JumpedBack => Ok(()),
            PushOutcome::OutOfOrder => Err("is no later than the pose before".into()),
            PushOutcome::NotFinite => Err("position or quaternion is not finite".into()),
        }
    }

    /// Tests whether an input has samples of the last second, but none at or after a time.
    pub fn is_awaited(&self, end_ns: i64) -> bool {
        let newest = [
            self.rates.back().map(|rate| rate.stamp_ns),
            self.wheels.newest_ns(),
        ];
        let awaited = |newest: i64| newest < end_ns && end_ns.saturating_sub(newest) <= ENDED_NS;
        newest.into_iter().flatten().any(awaited)
    }

    /// Samples of the gyroscope that cover a span of time; none if they leave a gap.
    pub fn rates(&self, from_ns: i64, to_ns: i64) -> Vec<AngularRate> {
        let first = self.rates.partition_point(|rate| rate.stamp_ns <= from_ns);
        let covering = self.rates.iter().skip(first.saturating_sub(1));
        let covering = covering.take_while(|rate| rate.stamp_ns < to_ns).copied();
        let covering: Vec<AngularRate> = covering.collect();
        let times = covering.iter().map(|rate| rate.stamp_ns);
        let from = std::iter::once(from_ns).chain(times.clone());
        let to = times.chain(std::iter::once(to_ns));
        let has_gap = from
            .zip(to)
            .any(|(a, b)| b.saturating_sub(a) > MAX_RATE_GAP_NS);
        if has_gap { Vec::new() } else { covering }
    }

    /// Motion of the wheels between two times, `from_from_to`.
    pub fn wheels(&self, from_ns: i64, to_ns: i64) -> Option<Isometry3<f64>> {
        let (from, to) = (self.wheels.at(from_ns).ok()?, self.wheels.at(to_ns).ok()?);
        Some(from.inverse() * to)
    }
}

/// Pose of a sensor's frame in the frame of the machine.
fn mount(
    frame: &str,
    base: &str,
    stamp_ns: i64,
    mounts: &mut TransformBuffer,
) -> Result<Isometry3<f64>, String> {
    let frame = frame.trim_start_matches('/');
    if frame == base || frame.is_empty() {
        return Ok(Isometry3::identity());
    }
    mounts.keep(frame);
    let found = mounts.lookup(base, frame, stamp_ns);
    found.map_err(|miss| format!("{miss}; publish it on /tf_static"))
}

#[cfg(test)]
mod tests {
    use lattice_core::pose::TransformBufferOptions;
    use lattice_msgs::builtin_interfaces::Time;
    use lattice_msgs::geometry_msgs;

    use super::*;

    fn imu(stamp_ns: i64, yaw_rate: f64) -> Imu {
        let mut imu = Imu::default();
        imu.header.stamp = Time::from_ns(stamp_ns);
        imu.angular_velocity = geometry_msgs::Vector3 {
            z: yaw_rate,
            ..Default::default()
        };
        imu
    }

    #[test]
    fn samples_cover_a_span_or_are_not_used() {
        let mounts = &mut TransformBuffer::new(TransformBufferOptions::default());
        let mut motions = Motions::new();
        for i in 0..20 {
            motions
                .on_imu(&imu(i * 10_000_000, 0.5), "base", mounts)
                .unwrap();
        }
        assert_eq!(motions.rates(45_000_000, 145_000_000).len(), 11);
        assert!(motions.rates(145_000_000, 300_000_000).is_empty());
        assert!(motions.is_awaited(195_000_000));
        assert!(!motions.is_awaited(190_000_000));
        assert!(!motions.is_awaited(2_000_000_000));
        // As of a log that begins again.
        motions
            .on_imu(&imu(-2_000_000_000, 0.5), "base", mounts)
            .unwrap();
        assert!(motions.rates(45_000_000, 145_000_000).is_empty());
    }

    #[test]
    fn samples_that_cannot_be_are_refused_with_value_and_range() {
        let mounts = &mut TransformBuffer::new(TransformBufferOptions::default());
        let mut motions = Motions::new();
        let error = motions.on_imu(&imu(0, 100.0), "base", mounts);
        assert!(error.unwrap_err().contains("100 rad/s, up to 70"));
        assert!(motions.on_imu(&imu(0, f64::NAN), "base", mounts).is_err());
        let mut other = imu(0, 0.1);
        other.header.frame_id = "imu".into();
        let error = motions.on_imu(&other, "base", mounts);
        assert!(error.unwrap_err().contains("/tf_static"));
        other.angular_velocity_covariance[0] = -1.0;
        assert!(
            motions
                .on_imu(&other, "base", mounts)
                .unwrap_err()
                .contains("REP 145")
        );
        assert!(motions.rates(0, 1).is_empty());
    }

    #[test]
    fn a_turned_sensor_measures_in_the_axes_of_the_machine() {
        let mounts = &mut TransformBuffer::new(TransformBufferOptions::default());
        let upside_down =
            nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
        let pose = Isometry3::from_parts(Vector3::zeros().into(), upside_down);
        mounts.insert("base", "imu", 0, pose, true).unwrap();
        let mut motions = Motions::new();
        let mut sample = imu(0, 0.5);
        sample.header.frame_id = "imu".into();
        motions.on_imu(&sample, "base", mounts).unwrap();
        let rates = motions.rates(0, 10);
        assert!((rates[0].rate_rad_per_s - Vector3::new(0.0, 0.0, -0.5)).norm() < 1e-12);
    }
}
