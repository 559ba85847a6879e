//! Samples for the calibration of mounts: thinned points of the clouds, each with the pose of the base at its time.

use std::collections::BTreeMap;

use lattice_core::pose::StampedPose;
use lattice_core::registration::mounts::{BasePose, MountSamples};
use nalgebra::{Isometry3, Vector3};

use super::body_pose::Body;

/// Least time between two poses of the way, ns, and the most of them: more than an hour.
const WAY_NS: i64 = 20_000_000;
const MAX_WAY: usize = 200_000;

/// Mount of a sensor frame as the log states it.
#[derive(Clone, Debug, PartialEq)]
pub struct StatedMount {
    /// Frame of the sensor.
    pub frame: String,
    /// Topic of its clouds.
    pub topic: String,
    /// Parent of the frame, if transforms name one.
    pub parent: Option<String>,
    /// `base_from_sensor` at the first cloud, metres.
    pub base_from_sensor: Isometry3<f64>,
    /// `base_from_parent` at the first cloud, metres.
    pub base_from_parent: Isometry3<f64>,
    /// True if the mount changes in the log, as that of a turntable.
    pub is_moving: bool,
}

/// Point that is kept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept {
    /// Number of the point in the log.
    pub number: u64,
    /// Place of its pose.
    pub pose: u32,
    /// Place of its sensor in the mounts.
    pub sensor: usize,
    pub in_base_m: Vector3<f64>,
}

/// Points kept for the calibration of mounts.
#[derive(Debug, Default)]
pub struct Samples {
    /// Most points.
    limit: usize,
    /// A point is kept if its number, scrambled, has this many low bits that are 0.
    pub(super) thinning: u32,
    pub(super) seen: u64,
    pub(super) kept: Vec<Kept>,
    pub(super) poses: Vec<BasePose>,
    pub(super) sensor_sum_m: Vector3<f64>,
    pub(super) clouds: u32,
    pub(super) mounts: Vec<StatedMount>,
    pub(super) parents: BTreeMap<String, String>,
    pub(super) bodies: Option<(Body, Body)>,
    way: Vec<StampedPose>,
    /// Least time between two poses of the way, ns.
    way_ns: i64,
    pub(super) base_from_ins: Option<Isometry3<f64>>,
}

/// Samples of a log with the mounts that it states.
#[derive(Clone, Debug, Default)]
pub struct LogSamples {
    /// Points and poses.
    pub samples: MountSamples,
    /// Place in `mounts` of the sensor of each point.
    pub sensors: Vec<usize>,
    /// Mounts, in the order of their first clouds.
    pub mounts: Vec<StatedMount>,
    /// Lever arm and boresight of the INS; `None` if poses are those of the base.
    pub base_from_ins: Option<Isometry3<f64>>,
}

impl LogSamples {
    /// Samples of one of the mounts.
    pub fn of_sensor(&self, sensor: usize) -> MountSamples {
        let mount = self.mounts.get(sensor);
        let points = self.samples.points.iter().zip(&self.sensors);
        let points = points.filter(|(_, of)| **of == sensor);
        MountSamples {
            points: points.map(|(point, _)| *point).collect(),
            sensor_m: mount.map_or_else(Vector3::zeros, |mount| {
                mount.base_from_sensor.translation.vector
            }),
            poses: self.samples.poses.clone(),
            way: self.samples.way.clone(),
        }
    }
}

impl Samples {
    /// No samples yet; `limit` is the most of them.
    pub(super) fn new(limit: usize) -> Self {
        Self {
            limit,
            way_ns: WAY_NS,
            ..Self::default()
        }
    }

    pub(super) fn note_parent(&mut self, child: &str, parent: &str) {
        let name = |frame: &str| frame.trim_start_matches('/').to_owned();
        // Frames are limited by the buffer of transforms; these only by the log.
        if self.parents.len() < 4096 {
            self.parents.insert(name(child), name(parent));
        }
    }

    pub(super) fn note_bodies(&mut self, position_of: &Body, attitude_of: &Body) {
        self.bodies = Some((position_of.clone(), attitude_of.clone()));
    }

    /// Keeps the next pose of the base, in order of time.
    pub(super) fn on_pose(&mut self, pose: &StampedPose) {
        let is_due =
            |last: &StampedPose| pose.stamp_ns.saturating_sub(last.stamp_ns) >= self.way_ns;
        if self.way.last().is_none_or(is_due) {
            self.way.push(*pose);
        }
        if self.way.len() > MAX_WAY {
            self.way_ns *= 2;
            let mut place = 0;
            self.way.retain(|_| {
                place += 1;
                place % 2 == 1
            });
        }
    }

    pub(super) fn is_kept(number: u64, thinning: u32) -> bool {
        let scrambled = number.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (scrambled ^ (scrambled >> 32)).trailing_zeros() >= thinning
    }

    pub(super) fn thin(&mut self) {
        if self.kept.len() <= self.limit {
            return;
        }
        while self.kept.len() > self.limit {
            self.thinning += 1;
            let thinning = self.thinning;
            self.kept
                .retain(|kept| Self::is_kept(kept.number, thinning));
        }
        self.leave_poses_out();
    }

    /// Leaves out the poses of points that were thinned out.
    fn leave_poses_out(&mut self) {
        let mut places: BTreeMap<u32, u32> = BTreeMap::new();
        let mut poses = Vec::new();
        for Kept { pose, .. } in &mut self.kept {
            *pose = *places.entry(*pose).or_insert_with(|| {
                poses.extend(self.poses.get(*pose as usize).copied());
                poses.len().saturating_sub(1) as u32
            });
        }
        self.poses = poses;
    }

    pub(super) fn finish(self) -> LogSamples {
        let points = self.kept.iter();
        LogSamples {
            sensors: self.kept.iter().map(|kept| kept.sensor).collect(),
            samples: MountSamples {
                poses: self.poses,
                points: points.map(|kept| (kept.pose, kept.in_base_m)).collect(),
                sensor_m: self.sensor_sum_m / f64::from(self.clouds.max(1)),
                way: self.way,
            },
            mounts: self.mounts,
            base_from_ins: self.base_from_ins,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_poses_stay_within_the_limit_and_belong_together() {
        let mut samples = Samples {
            limit: 100,
            ..Samples::default()
        };
        for number in 0..100_000_u32 {
            if !Samples::is_kept(number.into(), samples.thinning) {
                continue;
            }
            samples.poses.push(BasePose {
                stamp_s: f64::from(number),
                map_from_base: Isometry3::identity(),
                velocity_m_per_s: Vector3::zeros(),
                rate_rad_per_s: Vector3::zeros(),
            });
            let place = samples.poses.len() as u32 - 1;
            let point = Vector3::x() * f64::from(number);
            samples.kept.push(Kept {
                number: number.into(),
                pose: place,
                sensor: 0,
                in_base_m: point,
            });
            samples.thin();
            assert!(samples.kept.len() <= 100 && samples.poses.len() <= 100);
        }
        let MountSamples { poses, points, .. } = samples.finish().samples;
        assert!(points.len() > 20);
        for (place, point) in points {
            assert_eq!(poses[place as usize].stamp_s, point.x);
        }
    }
}
