//! The path so far, thinned so that its message stays small.

use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::nav_msgs::Path;
use nalgebra::Isometry3;

use crate::convert::geometry;

/// Most poses: with frames of ten letters 50 kB, below the 60 kB of a reliable message.
const MAX_POSES: usize = 500;
/// Distance of poses at first, m; it doubles when the path is full.
const FIRST_STEP_M: f64 = 0.25;

/// Poses at even distances.
pub(super) struct ThinPath {
    frame: String,
    step_m: f64,
    /// Poses by odometry, with their times, ns.
    poses: Vec<(i64, Isometry3<f64>)>,
}

impl ThinPath {
    /// An empty path in a frame.
    pub fn new(frame: &str) -> Self {
        Self {
            frame: frame.to_owned(),
            step_m: FIRST_STEP_M,
            poses: Vec::new(),
        }
    }

    /// Adds a pose by odometry; true if it is far enough from the last one to be kept.
    pub fn add(&mut self, stamp_ns: i64, pose: &Isometry3<f64>) -> bool {
        let last = self.poses.last();
        let moved_m =
            last.map(|(_, last)| (pose.translation.vector - last.translation.vector).norm());
        if moved_m.is_some_and(|moved_m| moved_m < self.step_m) {
            return false;
        }
        self.poses.push((stamp_ns, *pose));
        if self.poses.len() > MAX_POSES {
            let newest = self.poses.len() - 1;
            let mut number = 0;
            self.poses.retain(|_| {
                number += 1;
                (number - 1) % 2 == newest % 2
            });
            self.step_m *= 2.0;
        }
        true
    }

    /// The path, with poses corrected by `frame_from_odom` at their times.
    pub fn message(&self, frame_from_odom: impl Fn(i64) -> Isometry3<f64>) -> Path {
        let pose = |(stamp_ns, pose): &(i64, Isometry3<f64>)| PoseStamped {
            header: geometry::header(&self.frame, *stamp_ns),
            pose: geometry::pose_from(&(frame_from_odom(*stamp_ns) * pose)),
        };
        let newest_ns = self.poses.last().map_or(0, |(stamp_ns, _)| *stamp_ns);
        Path {
            header: geometry::header(&self.frame, newest_ns),
            poses: self.poses.iter().map(pose).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use lattice_msgs::cdr;

    use super::*;

    #[test]
    fn a_long_path_stays_small() {
        let mut path = ThinPath::new("robot1/odom");
        for i in 0..4000 {
            path.add(
                i64::from(i),
                &Isometry3::translation(f64::from(i), 0.0, 0.0),
            );
        }
        let newest = path.message(|_| Isometry3::identity());
        assert!((250..=MAX_POSES).contains(&newest.poses.len()));
        assert_eq!(newest.poses[0].pose.position.x, 0.0);
        assert!(cdr::to_vec(&newest).unwrap().len() < 60_000);
        let last = newest.poses.last().unwrap().pose.position.x;
        assert!(!path.add(4000, &Isometry3::translation(last + 0.5, 0.0, 0.0)));
    }

    #[test]
    fn a_corrected_path_has_the_correction_of_each_time() {
        let mut path = ThinPath::new("map");
        for i in 0..10 {
            assert!(path.add(i, &Isometry3::translation(i as f64, 0.0, 0.0)));
        }
        let moved = path.message(|stamp_ns| Isometry3::translation(0.0, stamp_ns as f64, 0.0));
        assert!((moved.poses.iter()).all(|pose| pose.pose.position.x == pose.pose.position.y));
        assert_eq!(moved.poses.len(), 10);
    }
}
