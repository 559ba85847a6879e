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
    poses: Vec<PoseStamped>,
    last: Option<Isometry3<f64>>,
}

impl ThinPath {
    /// An empty path in a frame.
    pub fn new(frame: &str) -> Self {
        Self {
            frame: frame.to_owned(),
            step_m: FIRST_STEP_M,
            poses: Vec::new(),
            last: None,
        }
    }

    /// The path with a pose, if the pose is far enough from the last one.
    pub fn add(&mut self, stamp_ns: i64, pose: &Isometry3<f64>) -> Option<Path> {
        let last = self.last.as_ref();
        let moved_m = last.map(|last| (pose.translation.vector - last.translation.vector).norm());
        if moved_m.is_some_and(|moved_m| moved_m < self.step_m) {
            return None;
        }
        self.last = Some(*pose);
        let header = geometry::header(&self.frame, stamp_ns);
        self.poses.push(PoseStamped {
            header: header.clone(),
            pose: geometry::pose_from(pose),
        });
        if self.poses.len() > MAX_POSES {
            let mut is_kept = false;
            self.poses.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.step_m *= 2.0;
        }
        Some(Path {
            header,
            poses: self.poses.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use lattice_msgs::cdr;

    use super::*;

    #[test]
    fn a_long_path_stays_small() {
        let mut path = ThinPath::new("robot1/odom");
        let mut newest = Path::default();
        for i in 0..4000 {
            let pose = Isometry3::translation(f64::from(i), 0.0, 0.0);
            newest = path.add(i64::from(i), &pose).unwrap_or(newest);
        }
        assert!((250..=MAX_POSES).contains(&newest.poses.len()));
        assert_eq!(newest.poses[0].pose.position.x, 0.0);
        assert!(cdr::to_vec(&newest).unwrap().len() < 60_000);
        assert!(
            path.add(4000, &Isometry3::translation(3999.5, 0.0, 0.0))
                .is_none()
        );
    }
}
