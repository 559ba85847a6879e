//! Paths as results of Nav2's action.

use std::time::Instant;

use lattice_core::navigation::{
    GroundMap, GroundPath, GroundPathError, GroundPathOptions, PathEnd,
};
use lattice_msgs::builtin_interfaces::Duration as DurationMessage;
use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::nav_msgs::Path;
use lattice_msgs::nav2_msgs::ComputePathToPoseResult;
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::convert::geometry;

/// A path to find, in the frame of the map.
pub(super) struct PlanRequest {
    pub(super) start_m: Vector3<f64>,
    pub(super) goal: Isometry3<f64>,
    pub(super) header: Header,
    pub(super) options: GroundPathOptions,
    pub(super) begun: Instant,
}

/// Reason for which a goal has no path.
pub(super) struct PlanFailure {
    pub(super) code: u16,
    pub(super) text: String,
    /// True if an input has not arrived yet: the map, or a transform.
    pub(super) is_missing: bool,
}

impl PlanFailure {
    pub(super) fn new(code: u16, text: impl ToString) -> Self {
        Self {
            code,
            text: text.to_string(),
            is_missing: false,
        }
    }

    pub(super) fn missing(code: u16, text: impl ToString) -> Self {
        Self {
            is_missing: true,
            ..Self::new(code, text)
        }
    }

    /// Result without a path.
    pub(super) fn result(self, begun: Instant) -> ComputePathToPoseResult {
        ComputePathToPoseResult {
            planning_time: time_since(begun),
            error_code: self.code,
            error_msg: self.text,
            ..ComputePathToPoseResult::default()
        }
    }
}

impl From<GroundPathError> for PlanFailure {
    fn from(error: GroundPathError) -> Self {
        type Codes = ComputePathToPoseResult;
        let of = |end: &PathEnd, start, goal| match end {
            PathEnd::Start => start,
            PathEnd::Goal => goal,
        };
        let code = match &error {
            GroundPathError::Outside { end, .. } => {
                of(end, Codes::START_OUTSIDE_MAP, Codes::GOAL_OUTSIDE_MAP)
            }
            GroundPathError::NoGround { end, .. } | GroundPathError::NoRoom { end, .. } => {
                of(end, Codes::START_OCCUPIED, Codes::GOAL_OCCUPIED)
            }
            GroundPathError::NoWay { .. } => Codes::NO_VALID_PATH,
            GroundPathError::Limit { .. } => Codes::TIMEOUT,
            _ => Codes::UNKNOWN,
        };
        Self::new(code, error)
    }
}

/// Searches a path; stops once `go_on` returns false.
pub(super) fn plan(
    ground: &GroundMap,
    request: &PlanRequest,
    go_on: impl FnMut() -> bool,
) -> Result<ComputePathToPoseResult, PlanFailure> {
    let goal_m = request.goal.translation.vector;
    let path = ground.path_while(&request.start_m, &goal_m, &request.options, go_on)?;
    Ok(ComputePathToPoseResult {
        path: path_message(&path, &request.goal.rotation, &request.header),
        planning_time: time_since(request.begun),
        ..ComputePathToPoseResult::default()
    })
}

/// Poses that look along the path, the last one as the goal.
fn path_message(path: &GroundPath, last: &UnitQuaternion<f64>, header: &Header) -> Path {
    let next = path.points_m.iter().skip(1).map(Some).chain([None]);
    let poses = path.points_m.iter().zip(next).map(|(at_m, next_m)| {
        let rotation = next_m.map_or(*last, |next_m| {
            let along_m = next_m - at_m;
            UnitQuaternion::from_euler_angles(0.0, 0.0, along_m.y.atan2(along_m.x))
        });
        let pose = Isometry3::from_parts(Translation3::from(*at_m), rotation);
        PoseStamped {
            header: header.clone(),
            pose: geometry::pose_from(&pose),
        }
    });
    Path {
        poses: poses.collect(),
        header: header.clone(),
    }
}

fn time_since(begun: Instant) -> DurationMessage {
    let time = begun.elapsed();
    DurationMessage {
        sec: i32::try_from(time.as_secs()).unwrap_or(i32::MAX),
        nanosec: time.subsec_nanos(),
    }
}

#[cfg(test)]
mod tests {
    use lattice_core::cloud::Cloud;
    use lattice_core::lattice::{Lattice, LatticeKind};
    use lattice_core::navigation::{Projector, ProjectorOptions};
    use lattice_core::voxels::VoxelList;

    use super::*;

    /// A floor of 6 m by 6 m with a wall from y = 0 to 4 at x = 3.
    fn ground() -> GroundMap {
        let lattice = Lattice::new(LatticeKind::Cubic, 0.001).unwrap();
        let side = || (0..120).map(|i| 0.05 * f64::from(i) + 0.025);
        let floor = side().flat_map(|x| side().map(move |y| Vector3::new(x, y, 0.0)));
        let wall = side()
            .take(80)
            .flat_map(|y| side().take(30).map(move |z| Vector3::new(3.0, y, z)));
        let points_m: Vec<_> = floor.chain(wall).collect();
        let mut list = VoxelList::new(lattice.clone(), Vector3::zeros(), 1_000_000).unwrap();
        list.insert(&Cloud::from_points(0, Vector3::zeros(), &points_m));
        let options = ProjectorOptions::default();
        let mut projector = Projector::new(&lattice, list.datum_m(), options).unwrap();
        for (key, voxel) in list.sorted() {
            projector.set(key, Some(voxel.mean_offset_m().into()));
        }
        projector.ground_map().unwrap()
    }

    fn request(goal_m: [f64; 3]) -> PlanRequest {
        PlanRequest {
            start_m: Vector3::new(1.0, 1.0, 0.1),
            goal: Isometry3::new(goal_m.into(), Vector3::new(0.0, 0.0, 2.0)),
            header: geometry::header("map", 5),
            options: GroundPathOptions::default(),
            begun: Instant::now(),
        }
    }

    #[test]
    fn poses_look_along_the_path_and_the_last_one_as_the_goal() {
        let found = plan(&ground(), &request([5.0, 1.0, 0.1]), || true);
        let result = found.map_err(|failure| failure.text).unwrap();
        let poses = &result.path.poses;
        assert!(poses.len() > 50 && result.error_code == ComputePathToPoseResult::NONE);
        let poses: Vec<_> = poses
            .iter()
            .map(|stamped| {
                assert_eq!(stamped.header, result.path.header);
                geometry::isometry_from_pose(&stamped.pose).unwrap()
            })
            .collect();
        for pair in poses.windows(2) {
            let along_m = pair[1].translation.vector - pair[0].translation.vector;
            let ahead = pair[0].rotation.inverse() * along_m;
            assert!(ahead.x > 0.0 && ahead.y.abs() < 1e-9, "{ahead}");
        }
        let (_, _, yaw) = poses.last().unwrap().rotation.euler_angles();
        assert!((yaw - 2.0).abs() < 1e-9);
        let at_wall = poses
            .iter()
            .filter(|pose| (pose.translation.x - 3.0).abs() < 0.3);
        assert!(at_wall.into_iter().all(|pose| pose.translation.y > 4.2));
    }

    #[test]
    fn failures_have_the_codes_of_nav2() {
        type Codes = ComputePathToPoseResult;
        let ground = ground();
        let code = |request: &PlanRequest, go_on: bool| {
            let failure = plan(&ground, request, || go_on).err().unwrap();
            let code = failure.code;
            let result = failure.result(request.begun);
            assert!(!result.error_msg.is_empty() && result.path.poses.is_empty());
            assert_eq!(result.error_code, code);
            code
        };
        assert_eq!(code(&request([5.0, 1.0, 0.1]), false), Codes::TIMEOUT);
        let outside = request([50.0, 1.0, 0.1]);
        assert_eq!(code(&outside, true), Codes::GOAL_OUTSIDE_MAP);
        let mut outside = request([5.0, 1.0, 0.1]);
        outside.start_m.x = -50.0;
        assert_eq!(code(&outside, true), Codes::START_OUTSIDE_MAP);
        let mut wide = request([5.0, 1.0, 0.1]);
        wide.options.robot_radius_m = 1.6;
        assert_eq!(code(&wide, true), Codes::START_OCCUPIED);
        wide.options.robot_radius_m = 1.1;
        wide.start_m = Vector3::new(1.5, 1.5, 0.1);
        assert_eq!(code(&wide, true), Codes::NO_VALID_PATH);
        wide.goal = request([5.9, 0.1, 0.1]).goal;
        assert_eq!(code(&wide, true), Codes::GOAL_OCCUPIED);
        wide.options.robot_radius_m = f64::NAN;
        assert_eq!(code(&wide, true), Codes::UNKNOWN);
    }
}
