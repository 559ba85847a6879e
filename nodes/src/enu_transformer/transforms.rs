//! Transforms received and published by the transformer.

use lattice_core::pose::{PoseMiss, StampedPose, TfMiss};
use lattice_msgs::geographic_msgs::{GeoPoint, GeoPointStamped};
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::Isometry3;

use super::ins_options::InsSource;
use super::ins_refusal::InsRefusal;
use super::stamp_order::Refused;
use super::state::{EnuOutput, EnuTransformer};
use crate::convert::geometry;

impl EnuTransformer {
    /// Handles transforms of the mounts, or of `odom_frame` -> `base_frame`.
    pub fn on_tf(&mut self, message: &TFMessage, is_static: bool, now_ns: i64) -> Vec<EnuOutput> {
        let mut out = Vec::new();
        self.advance(now_ns);
        for transform in &message.transforms {
            if self.is_own(transform) {
                continue;
            }
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            let stamp_ns = transform.header.stamp.to_ns();
            let pose = geometry::isometry_from_transform(&transform.transform);
            let taken = match pose {
                Some(pose) if is_static => self.insert(parent, child, stamp_ns, pose, true),
                Some(pose) => self.on_moving(parent, child, stamp_ns, pose, &mut out),
                None => Err(format!(
                    "transform of '{child}' in '{parent}' is not finite, or its quaternion is zero"
                )),
            };
            if let Err(problem) = taken {
                self.counts.transforms_refused += 1;
                let topic = if is_static { "/tf_static" } else { "/tf" };
                self.refusals.add(topic, "transforms_refused", || problem);
            }
        }
        self.check_reference();
        self.announce_odom(&mut out);
        self.serve(now_ns, &mut out);
        out
    }

    /// Handles a dynamic transform in the order of its link.
    fn on_moving(
        &mut self,
        parent: &str,
        child: &str,
        stamp_ns: i64,
        parent_from_child: Isometry3<f64>,
        out: &mut Vec<EnuOutput>,
    ) -> Result<(), String> {
        let Some((decision, newest_ns)) =
            self.links.push(parent, child, stamp_ns, parent_from_child)
        else {
            return self.insert(parent, child, stamp_ns, parent_from_child, false);
        };
        let is_pose = self.has_poses_of_tf();
        if decision.is_clock_set {
            if let (true, Some(before_ns)) = (is_pose, newest_ns) {
                self.on_set_back(before_ns, out);
            }
            self.mounts.clear_link(parent, child);
        } else if is_pose && newest_ns.is_none_or(|newest_ns| stamp_ns > newest_ns) {
            self.clocks.on_step();
        }
        for (stamp_ns, pose) in decision.taken {
            self.insert(parent, child, stamp_ns, pose, false)?;
        }
        // A repeated transform is not an error.
        let mut alone = decision
            .refused
            .into_iter()
            .filter(|r| matches!(r, Refused::Alone { .. }));
        alone.next().map_or(Ok(()), |refused| {
            let why = InsRefusal::Stamp(refused);
            Err(format!("transform of '{child}' in '{parent}': {why}"))
        })
    }

    fn insert(
        &mut self,
        parent: &str,
        child: &str,
        stamp_ns: i64,
        parent_from_child: Isometry3<f64>,
        is_static: bool,
    ) -> Result<(), String> {
        #[cfg(feature = "bags")]
        if let Some(samples) = &mut self.samples {
            samples.note_parent(child, parent);
        }
        let inserted = self
            .mounts
            .insert(parent, child, stamp_ns, parent_from_child, is_static);
        inserted.map_err(|error| error.to_string())?;
        self.counts.poses_in += u64::from(self.has_poses_of_tf());
        Ok(())
    }

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
    fn announce_odom(&mut self, out: &mut Vec<EnuOutput>) {
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

    /// True for a transform published by this node.
    fn is_own(&self, transform: &TransformStamped) -> bool {
        let options = &self.options;
        let parent = transform.header.frame_id.trim_start_matches('/');
        let child = transform.child_frame_id.trim_start_matches('/');
        let published = options.odom_frame.as_ref().unwrap_or(&options.base_frame);
        let is_published = (parent == options.map_frame && child == published)
            || (parent == options.earth_frame && child == options.map_frame);
        is_published && !self.has_poses_of_tf()
    }

    fn has_poses_of_tf(&self) -> bool {
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
