//! Transforms looked up and published by the transformer.

use lattice_core::pose::{PoseMiss, StampedPose, TfMiss};
use lattice_msgs::geographic_msgs::{GeoPoint, GeoPointStamped};
use nalgebra::Isometry3;

use super::ins_options::InsSource;
use super::state::{EnuOutput, EnuTransformer};
use crate::convert::geometry;

impl EnuTransformer {
    /// True while an undecided clock step of the poses is so small that stamps before and
    /// after it overlap.
    pub(super) fn is_order_ambiguous(&self) -> bool {
        match self.has_poses_of_tf() {
            true => self.links.is_ambiguous(),
            false => self.order.is_ambiguous(),
        }
    }

    /// Publishes `map` -> `base_frame` of a pose, or the newest `map` -> `odom_frame` if set.
    pub(super) fn announce_pose(&mut self, pose: &StampedPose, out: &mut Vec<EnuOutput>) {
        if !self.options.publish_tf {
            return;
        }
        if self.options.odom_frame.is_some() {
            self.announce_odom(out);
            return;
        }
        let (map, base) = (&self.options.map_frame, &self.options.base_frame);
        let transform = geometry::transform_stamped(map, base, pose.stamp_ns, &pose.map_from_base);
        out.push(EnuOutput::Transform(transform));
    }

    /// Publishes `map` -> `odom_frame` at the newest time covered by poses and odometry, once for
    /// each such time: the pose usually arrives before the odometry of its stamp.
    pub(super) fn announce_odom(&mut self, out: &mut Vec<EnuOutput>) {
        let (Some(odom), true) = (&self.options.odom_frame, self.options.publish_tf) else {
            return;
        };
        let Some(mut stamp_ns) = self.poses.newest_ns() else {
            return;
        };
        let base = &self.options.base_frame;
        let base_from_odom = loop {
            match self.mounts.lookup(base, odom, stamp_ns) {
                Ok(transform) => break transform,
                Err(TfMiss::TooNew { by_ns, .. }) if by_ns > 0 => {
                    stamp_ns = stamp_ns.saturating_sub(by_ns);
                }
                Err(_) => return,
            }
        };
        if self.odom_ns.is_some_and(|last_ns| stamp_ns <= last_ns) {
            return;
        }
        let Ok(map_from_base) = self.poses.at(stamp_ns) else {
            return;
        };
        let map_from_odom = map_from_base * base_from_odom;
        let map = &self.options.map_frame;
        let transform = geometry::transform_stamped(map, odom, stamp_ns, &map_from_odom);
        out.push(EnuOutput::Transform(transform));
        self.odom_ns = Some(stamp_ns);
    }

    /// Publishes the geodetic origin of the map frame once.
    pub(super) fn announce_origin(&mut self, out: &mut Vec<EnuOutput>) {
        let (false, Some(frame)) = (self.announced, self.ins.frame()) else {
            return;
        };
        self.announced = true;
        let stamp_ns = self.poses.newest_ns().unwrap_or(0);
        let origin = frame.origin();
        let position = GeoPoint {
            latitude: origin.latitude_deg(),
            longitude: origin.longitude_deg(),
            altitude: origin.height_m,
        };
        out.push(EnuOutput::Origin(GeoPointStamped {
            header: geometry::header(&self.options.map_frame, stamp_ns),
            position,
        }));
        if self.options.publish_tf {
            out.push(EnuOutput::StaticTransform(geometry::transform_stamped(
                &self.options.earth_frame,
                &self.options.map_frame,
                stamp_ns,
                &frame.ecef_from_enu(),
            )));
        }
    }

    /// True if poses are those of `/tf`.
    pub(super) fn has_poses_of_tf(&self) -> bool {
        self.options.ins.source == InsSource::Tf
    }

    /// Pose of the machine at a stamp.
    pub(super) fn map_from_base(&self, stamp_ns: i64) -> Result<Isometry3<f64>, PoseMiss> {
        if !self.has_poses_of_tf() {
            return self.poses.at(stamp_ns);
        }
        let (map, base) = (&self.options.map_frame, &self.options.base_frame);
        let found = self.mounts.lookup(map, base, stamp_ns);
        let corrected = |pose| self.options.correction.map_or(pose, |by| by * pose);
        found.map(corrected).map_err(|miss| match miss {
            TfMiss::UnknownFrame { .. } | TfMiss::Disconnected { .. } => PoseMiss::Empty,
            TfMiss::TooOld { by_ns, .. } => PoseMiss::BeforeStart { by_ns },
            TfMiss::TooNew { by_ns, .. } => PoseMiss::AfterEnd { by_ns },
            TfMiss::Gap {
                gap_ns, max_gap_ns, ..
            } => PoseMiss::Gap { gap_ns, max_gap_ns },
        })
    }

    /// `base_from_sensor` at a stamp; the identity for clouds in the map frame.
    pub(super) fn mount(&self, frame: &str, stamp_ns: i64) -> Result<Isometry3<f64>, TfMiss> {
        if frame == self.options.base_frame || frame == self.options.map_frame {
            return Ok(Isometry3::identity());
        }
        self.mounts
            .lookup(&self.options.base_frame, frame, stamp_ns)
    }
}
