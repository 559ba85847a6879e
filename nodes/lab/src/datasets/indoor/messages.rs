//! Poses of the robot and the headset.

use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::geometry::{header, pose_from, transform_stamped};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::simulate::house::RoomCamera;

/// Height of the robot's camera above its base, m.
const CAMERA_M: f64 = 1.0;

/// The pose of a camera that looks along x as one of its optical frame.
fn optical(pose: &Isometry3<f64>) -> Isometry3<f64> {
    pose * RoomCamera::camera_from_optical()
}

/// The robot below its camera, level, and the camera on it.
pub(super) fn robot(stamp_ns: i64, map_from_camera: &Isometry3<f64>) -> TFMessage {
    let ahead = map_from_camera.rotation * Vector3::x();
    let level = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), ahead.y.atan2(ahead.x));
    let at = map_from_camera.translation.vector - Vector3::z() * CAMERA_M;
    let map_from_base = Isometry3::from_parts(at.into(), level);
    let base_from_camera = map_from_base.inverse() * optical(map_from_camera);
    TFMessage {
        transforms: vec![
            transform_stamped("map", "base_link", stamp_ns, &map_from_base),
            transform_stamped("base_link", "camera", stamp_ns, &base_from_camera),
        ],
    }
}

/// The headset's camera, whose axes are optical.
pub(super) fn headset_pose(stamp_ns: i64, headset_from_camera: &Isometry3<f64>) -> PoseStamped {
    PoseStamped {
        header: header("headset_origin", stamp_ns),
        pose: pose_from(&optical(headset_from_camera)),
    }
}
