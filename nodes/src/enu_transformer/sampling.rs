//! Sampling of clouds that poses and mounts cover.

use std::collections::BTreeMap;

use lattice_core::cloud::{CloudLimits, NO_TIME_NS};
use lattice_core::registration::mounts::BasePose;
use nalgebra::{Isometry3, Point3};

use super::drops::Drop;
use super::samples::{Kept, LogSamples, Samples, StatedMount};
use super::state::EnuTransformer;
use super::waiting::WaitingCloud;
use crate::convert::cloud;

/// Points of a cloud within this time share a pose, ns.
const POSE_NS: i64 = 100_000;
/// Points nearer to the sensor are of the machine itself, metres.
const MIN_RANGE_M: f64 = 0.3;

impl EnuTransformer {
    /// Keeps samples of the clouds, `limit` at most, in place of transforming them.
    pub(crate) fn keep_samples(&mut self, limit: usize) {
        self.samples = Some(Samples::new(limit));
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
