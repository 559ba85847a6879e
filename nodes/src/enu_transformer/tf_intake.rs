//! Transforms received by the transformer.

use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::Isometry3;

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
}
