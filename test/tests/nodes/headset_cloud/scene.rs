//! Messages that a headset would send of a mesh, in the axes that it has.

use std::sync::Arc;

use lattice_core::pose::Axes;
use lattice_lab::mesh::LabelledMesh;
use lattice_lab::simulate::house::HouseScan;
use lattice_msgs::geometry_msgs::{Point, Pose, PoseStamped, Quaternion};
use lattice_msgs::lattice::HeadsetMesh;
use lattice_msgs::sensor_msgs::{CameraInfo, Image};
use lattice_nodes::convert::geometry::header;
use lattice_nodes::convert::headset_mesh::in_chunks;
use lattice_nodes::convert::semantic::{SemanticOptions, headset_scan_from_message};
use lattice_nodes::headset_cloud::{HeadsetCloud, HeadsetOptions, HeadsetOutput, HeadsetStream};
use lattice_runtime::params::{ParamValue, Params};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use serde_bytes::ByteBuf;

pub const FRAME: &str = "headset_origin";

pub fn options(params: &[(&str, &str)]) -> HeadsetOptions {
    let values = params.iter().map(|(name, text)| {
        let value = ParamValue::from_yaml_text(text).unwrap();
        (*name, value)
    });
    HeadsetOptions::from_params(&Params::from_values("/node", values)).unwrap()
}

/// A pose in ROS axes as one in others. `own` are the axes that x, y, z of the posed thing are given in.
pub fn pose_in(axes: Axes, own: Axes, ros_from_thing: &Isometry3<f64>) -> Pose {
    let turn = ros_from_thing.rotation.to_rotation_matrix();
    let turn: Matrix3<f64> = axes.matrix().transpose() * turn.matrix() * own.matrix();
    assert!((turn.determinant() - 1.0).abs() < 1e-9);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
    let at = axes.from_ros(ros_from_thing.translation.vector);
    Pose {
        position: Point {
            x: at.x,
            y: at.y,
            z: at.z,
        },
        orientation: Quaternion {
            x: turn.i,
            y: turn.j,
            z: turn.k,
            w: turn.w,
        },
    }
}

/// A mesh in its own frame as the chunks of one surface, with up to so many numbers in each array.
pub fn chunks(
    mesh: &LabelledMesh,
    origin_from_mesh: &Isometry3<f64>,
    axes: Axes,
    numbers: usize,
) -> Vec<Arc<HeadsetMesh>> {
    let vertex = |v: &[f32; 3]| -> [f32; 3] {
        let v = Vector3::from(v.map(f64::from));
        axes.from_ros(v).map(|c| c as f32).into()
    };
    let vertices: Vec<f32> = mesh.vertices_m().iter().flat_map(vertex).collect();
    // The corners of a triangle go the way round that its sender sees in its own numbers.
    let turned = axes.matrix().determinant() < 0.0;
    let corners = |&[a, b, c]: &[u32; 3]| if turned { [a, c, b] } else { [a, b, c] };
    let triangles: Vec<u32> = mesh.triangles().iter().flat_map(corners).collect();
    let chunks = vertices.len().max(triangles.len()).div_ceil(numbers).max(1);
    let whole = HeadsetMesh {
        header: header(FRAME, 5),
        session: "first".to_owned(),
        surface: "room".to_owned(),
        chunks: 1,
        pose: pose_in(axes, axes, origin_from_mesh),
        vertices,
        triangles,
        ..HeadsetMesh::default()
    };
    let all = in_chunks(&whole, chunks).into_iter();
    all.map(Arc::new).collect()
}

/// The camera of the simulated headset.
pub fn camera_info() -> CameraInfo {
    let [width, height] = HouseScan::PIXELS;
    let f = HouseScan::focal_px();
    let (cx, cy) = ((width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0);
    CameraInfo {
        header: header("camera", 0),
        height: height as u32,
        width: width as u32,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![0.0; 5],
        k: [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    }
}

pub fn pose(stamp_ns: i64, pose: Pose) -> PoseStamped {
    PoseStamped {
        header: header(FRAME, stamp_ns),
        pose,
    }
}

/// A mono16 image.
pub fn image(stamp_ns: i64, width: usize, labels: &[u16]) -> Arc<Image> {
    let data: Vec<u8> = labels
        .iter()
        .flat_map(|label| label.to_le_bytes())
        .collect();
    Arc::new(Image {
        header: header("camera", stamp_ns),
        height: (labels.len() / width) as u32,
        width: width as u32,
        encoding: "mono16".to_owned(),
        is_bigendian: 0,
        step: 2 * width as u32,
        data: ByteBuf::from(data),
    })
}

/// Place and label of the points of the clouds in some outputs.
pub fn points(outputs: &[HeadsetOutput]) -> Vec<(Point3<f64>, u16)> {
    let mut found = Vec::new();
    for output in outputs {
        let HeadsetOutput::Points(cloud) = output else {
            continue;
        };
        assert_eq!(cloud.header.frame_id, FRAME);
        for point in cloud.data.chunks(cloud.point_step as usize) {
            let number = |at: usize| f32::from_le_bytes(point[at..at + 4].try_into().unwrap());
            let place = [0, 4, 8].map(|at| f64::from(number(at)));
            let label = u16::from_le_bytes([point[12], point[13]]);
            found.push((Point3::from(place), label));
        }
    }
    found
}

/// Place of the camera as the server reads it from the one cloud of some outputs.
pub fn viewpoint_m(outputs: &[HeadsetOutput]) -> Option<Vector3<f64>> {
    let [HeadsetOutput::Points(cloud)] = outputs else {
        panic!("{outputs:?}");
    };
    let read = headset_scan_from_message(cloud, &SemanticOptions::default());
    Some(read.unwrap().0.sensor_m?.coords)
}

/// A square of 2 m before the camera, 3 m away, that looks back; the camera is the origin.
pub fn square() -> HeadsetMesh {
    HeadsetMesh {
        header: header(FRAME, 5),
        session: "first".to_owned(),
        surface: "square".to_owned(),
        chunks: 1,
        pose: pose_in(Axes::RosFlu, Axes::RosFlu, &Isometry3::identity()),
        vertices: [[3., 1., 1.], [3., 1., -1.], [3., -1., -1.], [3., -1., 1.]].concat(),
        triangles: vec![0, 1, 2, 0, 2, 3],
        ..HeadsetMesh::default()
    }
}

/// A machine of every pixel that has a camera at the origin, its pose from 1 to 3 s, and no mesh.
pub fn machine(params: &[(&str, &str)]) -> HeadsetCloud {
    let all: Vec<_> = [("stride", "1"), ("max_pose_gap_s", "2.0")]
        .into_iter()
        .chain(params.iter().copied())
        .collect();
    let mut machine = HeadsetCloud::new(options(&all));
    machine.on_camera_info(Arc::new(camera_info()));
    let at = pose_in(Axes::RosFlu, Axes::Optical, &Isometry3::identity());
    for stamp_ns in [1_000_000_000, 2_000_000_000, 3_000_000_000] {
        machine.on_pose(&pose(stamp_ns, at));
    }
    machine
}

/// The points of an image of class 7 at a time.
pub fn look(machine: &mut HeadsetCloud, stamp_ns: i64) -> Vec<(Point3<f64>, u16)> {
    let [width, height] = HouseScan::PIXELS;
    let labels = image(stamp_ns, width, &vec![7; width * height]);
    points(&machine.on_image(HeadsetStream::Labels, labels))
}
