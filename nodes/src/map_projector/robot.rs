//! Position of the robot by the newest transforms.

use std::collections::BTreeMap;

use lattice_core::pose::{TransformBuffer, TransformBufferOptions};
use lattice_msgs::tf2_msgs::TFMessage;
use nalgebra::{Isometry3, Vector3};

use crate::convert::geometry;

/// Limit of frames whose newest stamps are kept.
const MAX_FRAMES: usize = 256;

/// Transforms of a robot, with the newest stamp of each frame.
pub(super) struct RobotPosition {
    base_frame: String,
    transforms: TransformBuffer,
    newest_ns: BTreeMap<String, i64>,
}

impl RobotPosition {
    pub(super) fn new(base_frame: String) -> Self {
        let mut transforms = TransformBuffer::new(TransformBufferOptions::default());
        transforms.keep(&base_frame);
        Self {
            base_frame,
            transforms,
            newest_ns: BTreeMap::new(),
        }
    }

    /// Adds transforms; returns the number of rejected ones.
    pub(super) fn on_tf(&mut self, message: &TFMessage, is_static: bool) -> u64 {
        let mut refused = 0;
        for transform in &message.transforms {
            let (parent, child) = (&transform.header.frame_id, &transform.child_frame_id);
            let stamp_ns = transform.header.stamp.to_ns();
            let pose = geometry::isometry_from_transform(&transform.transform);
            let taken = pose.is_some_and(|pose| {
                let inserted = self
                    .transforms
                    .insert(parent, child, stamp_ns, pose, is_static);
                inserted.is_ok()
            });
            refused += u64::from(!taken);
            if taken
                && !is_static
                && (self.newest_ns.len() < MAX_FRAMES || self.newest_ns.contains_key(child))
            {
                self.newest_ns.insert(child.clone(), stamp_ns);
            }
        }
        refused
    }

    /// Position in a frame at the newest time for which all transforms are known.
    pub(super) fn in_frame(&self, map_frame: &str) -> Option<Vector3<f64>> {
        let pose = self.pose_of(&self.base_frame, map_frame)?;
        Some(pose.translation.vector)
    }

    /// Pose of any frame in another one at that time.
    pub(super) fn pose_of(&self, frame: &str, map_frame: &str) -> Option<Isometry3<f64>> {
        let mut stamps_ns: Vec<i64> = self.newest_ns.values().copied().collect();
        stamps_ns.push(0);
        stamps_ns.sort_unstable();
        stamps_ns.dedup();
        let at = |stamp_ns: &i64| self.transforms.lookup(map_frame, frame, *stamp_ns).ok();
        stamps_ns.iter().rev().find_map(at)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::convert::geometry::transform_stamped;

    fn moved(parent: &str, child: &str, stamp_ns: i64, x: f64) -> TFMessage {
        let pose = Isometry3::translation(x, 0.0, 0.5);
        TFMessage {
            transforms: vec![transform_stamped(parent, child, stamp_ns, &pose)],
        }
    }

    #[test]
    fn the_position_is_the_newest_that_all_transforms_cover() {
        let mut robot = RobotPosition::new("base_link".into());
        assert_eq!(robot.in_frame("map"), None);
        assert_eq!(robot.on_tf(&moved("map", "odom", 1_000, 10.0), false), 0);
        assert_eq!(
            robot.on_tf(&moved("odom", "base_link", 1_000, 1.0), false),
            0
        );
        assert_eq!(
            robot.on_tf(&moved("odom", "base_link", 2_000, 2.0), false),
            0
        );
        // A wheel that is ahead of all.
        robot.on_tf(&moved("base_link", "wheel", 9_000, 0.0), false);
        assert_eq!(robot.in_frame("map").map(|at| at.x), Some(11.0));
        robot.on_tf(&moved("map", "odom", 2_000, 20.0), false);
        assert_eq!(robot.in_frame("map").map(|at| at.x), Some(22.0));
        assert_eq!(
            robot.on_tf(&moved("map", "odom", 3_000, f64::NAN), false),
            1
        );
    }

    #[test]
    fn static_transforms_are_enough() {
        let mut robot = RobotPosition::new("base_link".into());
        robot.on_tf(&moved("map", "base_link", 5, 3.0), true);
        assert_eq!(robot.in_frame("map").map(|at| at.x), Some(3.0));
    }
}
