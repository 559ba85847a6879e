//! Messages of the robot and the headset.

use std::collections::BTreeMap;

use lattice_msgs::geometry_msgs::PoseStamped;
use lattice_msgs::headset::HeadsetMesh;
use lattice_msgs::sensor_msgs::Image;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};
use lattice_nodes::convert::geometry::{header, pose_from, transform_stamped};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::mesh::LabelledMesh;
use crate::simulate::house::RoomCamera;

/// Numbers of an array in a chunk of a mesh: 48 kB of the two.
const CHUNK_NUMBERS: usize = 6000;
/// Height of the robot's camera above its base, m.
const CAMERA_M: f64 = 1.0;

fn image(
    frame: &str,
    stamp_ns: i64,
    [width, height]: [usize; 2],
    encoding: &str,
    data: Vec<u8>,
) -> Image {
    Image {
        header: header(frame, stamp_ns),
        height: height as u32,
        width: width as u32,
        encoding: encoding.to_owned(),
        is_bigendian: 0,
        step: (data.len() / height.max(1)) as u32,
        data: data.into(),
    }
}

/// Distances along the optical axis, m; 0 is none.
pub(super) fn depth(frame: &str, stamp_ns: i64, size: [usize; 2], depth_m: &[f32]) -> Image {
    let data = depth_m.iter().flat_map(|d| d.to_le_bytes()).collect();
    image(frame, stamp_ns, size, "32FC1", data)
}

/// Colours.
pub(super) fn rgb8(frame: &str, stamp_ns: i64, size: [usize; 2], rgb: &[u8]) -> Image {
    image(frame, stamp_ns, size, "rgb8", rgb.to_vec())
}

/// Class numbers.
pub(super) fn mono16(frame: &str, stamp_ns: i64, size: [usize; 2], labels: &[u16]) -> Image {
    let data = labels.iter().flat_map(|label| label.to_le_bytes());
    image(frame, stamp_ns, size, "mono16", data.collect())
}

/// Names of the classes.
pub(super) fn label_info(
    frame: &str,
    stamp_ns: i64,
    class_names: &BTreeMap<u16, String>,
) -> LabelInfo {
    let class = |(class, name): (&u16, &String)| VisionClass {
        class_id: *class,
        class_name: name.clone(),
    };
    LabelInfo {
        header: header(frame, stamp_ns),
        class_map: class_names.iter().map(class).collect(),
        threshold: 0.0,
    }
}

/// The pose of a camera that looks along x as one of its optical frame.
fn optical(pose: &Isometry3<f64>) -> Isometry3<f64> {
    pose * Isometry3::from_parts(Translation3::identity(), RoomCamera::camera_from_optical())
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

/// The chunks of a mesh in the axes of ROS.
pub(super) fn mesh(
    stamp_ns: i64,
    session: &str,
    mesh: &LabelledMesh,
    headset_from_mesh: &Isometry3<f64>,
) -> Vec<HeadsetMesh> {
    let vertices = mesh.vertices_m().concat();
    let triangles = mesh.triangles().concat();
    let chunks = vertices.len().max(triangles.len()).div_ceil(CHUNK_NUMBERS);
    let chunk = |i: usize| HeadsetMesh {
        header: header("headset_origin", stamp_ns),
        session: session.to_owned(),
        surface: "room".to_owned(),
        removed: false,
        chunk: i as u32,
        chunks: chunks as u32,
        pose: pose_from(headset_from_mesh),
        vertices: part(&vertices, i),
        triangles: part(&triangles, i),
        classes: Vec::new(),
    };
    (0..chunks).map(chunk).collect()
}

fn part<T: Copy>(all: &[T], i: usize) -> Vec<T> {
    all.chunks(CHUNK_NUMBERS)
        .nth(i)
        .unwrap_or_default()
        .to_vec()
}
