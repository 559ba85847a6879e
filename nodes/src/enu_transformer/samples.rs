//! Samples for the calibration of mounts: thinned points of the clouds, each with the pose of the base at its time.

use std::collections::BTreeMap;

use lattice_core::cloud::{CloudLimits, NO_TIME_NS};
use lattice_core::pose::StampedPose;
use lattice_core::registration::mounts::{BasePose, MountSamples};
use nalgebra::{Isometry3, Point3, Vector3};

use super::EnuTransformer;
use super::drops::Drop;
use super::ins::Body;
use super::waiting::WaitingCloud;
use crate::convert::cloud;

/// Points of a cloud within this time share a pose, ns.
const POSE_NS: i64 = 100_000;
/// Least time between two poses of the way, ns, and the most of them: more than an hour.
const WAY_NS: i64 = 20_000_000;
const MAX_WAY: usize = 200_000;
/// Points nearer to the sensor are of the machine itself, metres.
const MIN_RANGE_M: f64 = 0.3;

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
struct Kept {
    /// Number of the point in the log.
    number: u64,
    /// Place of its pose.
    pose: u32,
    /// Place of its sensor in the mounts.
    sensor: usize,
    in_base_m: Vector3<f64>,
}

/// Points kept for the calibration of mounts.
#[derive(Debug, Default)]
pub struct Samples {
    /// Most points.
    limit: usize,
    /// A point is kept if its number, scrambled, has this many low bits that are 0.
    thinning: u32,
    seen: u64,
    kept: Vec<Kept>,
    poses: Vec<BasePose>,
    sensor_sum_m: Vector3<f64>,
    clouds: u32,
    mounts: Vec<StatedMount>,
    parents: BTreeMap<String, String>,
    bodies: Option<(Body, Body)>,
    way: Vec<StampedPose>,
    /// Least time between two poses of the way, ns.
    way_ns: i64,
    base_from_ins: Option<Isometry3<f64>>,
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

    fn is_kept(number: u64, thinning: u32) -> bool {
        let scrambled = number.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        (scrambled ^ (scrambled >> 32)).trailing_zeros() >= thinning
    }

    fn thin(&mut self) {
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

    fn finish(self) -> LogSamples {
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

impl EnuTransformer {
    /// Keeps samples of the clouds, `limit` at most, in place of transforming them.
    pub(crate) fn keep_samples(&mut self, limit: usize) {
        self.samples = Some(Samples {
            limit,
            way_ns: WAY_NS,
            ..Samples::default()
        });
    }

    /// The samples kept.
    pub(crate) fn take_samples(&mut self) -> LogSamples {
        self.samples.take().map(Samples::finish).unwrap_or_default()
    }

    /// Samples of a cloud that poses and mounts cover.
    pub(super) fn sample(&self, waiting: &WaitingCloud, samples: &mut Samples) -> Result<(), Drop> {
        let layout = cloud::layout_of(&waiting.message);
        let limits = CloudLimits {
            max_points: self.options.max_cloud_points,
        };
        let view = layout
            .view(&waiting.message.data, &limits)
            .map_err(Drop::Malformed)?;
        let base_from_sensor = self.stated_mount(waiting, samples)?;
        samples.sensor_sum_m += base_from_sensor.translation.vector;
        samples.clouds += 1;
        let sensor = { samples.mounts.iter() }.position(|one| one.frame == waiting.frame);
        let sensor = sensor.unwrap_or_default();
        let mut places: BTreeMap<i64, Option<(u32, Isometry3<f64>)>> = BTreeMap::new();
        for i in 0..view.len() {
            samples.seen += 1;
            if !Samples::is_kept(samples.seen, samples.thinning) {
                continue;
            }
            let point_m = view.xyz(i);
            let range_m = point_m.norm();
            let least_m = self.options.min_range_m.max(MIN_RANGE_M);
            if !(range_m > least_m && range_m <= self.options.max_range_m) {
                continue;
            }
            let at_ns = match &waiting.times {
                Some(times) => times.get(i).copied().filter(|at| *at != NO_TIME_NS),
                None => Some(waiting.stamp_ns),
            };
            let Some(at_ns) = at_ns else { continue };
            let bin = at_ns.div_euclid(POSE_NS);
            let found = places.entry(bin).or_insert_with(|| {
                let middle_ns = bin * POSE_NS + POSE_NS / 2;
                let pose = BasePose::at(middle_ns, |at_ns| self.map_from_base(at_ns).ok())?;
                let mount = self.mount(&waiting.frame, middle_ns).ok()?;
                samples.poses.push(pose);
                Some((samples.poses.len() as u32 - 1, mount))
            });
            if let Some((place, mount)) = found {
                let in_base_m = (*mount * Point3::from(point_m)).coords;
                samples.kept.push(Kept {
                    number: samples.seen,
                    pose: *place,
                    sensor,
                    in_base_m,
                });
            }
        }
        samples.thin();
        Ok(())
    }

    /// Mount at the stamp of a cloud, noted at the first one of its frame.
    fn stated_mount(
        &self,
        waiting: &WaitingCloud,
        samples: &mut Samples,
    ) -> Result<Isometry3<f64>, Drop> {
        let (frame, stamp_ns) = (&waiting.frame, waiting.stamp_ns);
        let mount = self.mount(frame, stamp_ns);
        let base_from_sensor = mount.map_err(|miss| Drop::no_mount(frame, miss))?;
        if let (None, Some(bodies)) = (samples.base_from_ins, &samples.bodies) {
            samples.base_from_ins = self.ins_mount(bodies, stamp_ns);
        }
        if let Some(known) = samples.mounts.iter_mut().find(|one| one.frame == *frame) {
            let change = known.base_from_sensor.inv_mul(&base_from_sensor);
            known.is_moving |=
                change.rotation.angle() > 1e-3 || change.translation.vector.norm() > 1e-3;
            return Ok(base_from_sensor);
        }
        let parent = samples.parents.get(frame).cloned();
        let base_from_parent = parent
            .as_ref()
            .and_then(|parent| self.mount(parent, stamp_ns).ok());
        samples.mounts.push(StatedMount {
            frame: frame.clone(),
            topic: waiting.topic.to_string(),
            base_from_parent: base_from_parent.unwrap_or_default(),
            parent: parent.filter(|_| base_from_parent.is_some()),
            base_from_sensor,
            is_moving: false,
        });
        Ok(base_from_sensor)
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
