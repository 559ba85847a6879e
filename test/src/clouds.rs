//! Messages for the tests of the nodes' logic.

use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::geometry_msgs::{Point, Pose, Quaternion};
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::std_msgs::Header;
use nalgebra::{Isometry3, Vector3};
use serde_bytes::ByteBuf;

/// One second.
pub const SECOND_NS: i64 = 1_000_000_000;

/// A header.
pub fn header(frame: &str, stamp_ns: i64) -> Header {
    Header {
        stamp: Time::from_ns(stamp_ns),
        frame_id: frame.to_owned(),
    }
}

/// A PointField with one element.
pub fn field(name: &str, offset: u32, datatype: u8) -> PointField {
    PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    }
}

/// A cloud of `x y z` in f32.
pub fn cloud(frame: &str, stamp_ns: i64, points: &[[f32; 3]]) -> PointCloud2 {
    let data = points.iter().flatten().flat_map(|v| v.to_le_bytes());
    PointCloud2 {
        header: header(frame, stamp_ns),
        height: 1,
        width: points.len() as u32,
        fields: ["x", "y", "z"]
            .into_iter()
            .zip(0..)
            .map(|(name, i)| field(name, 4 * i, PointField::FLOAT32))
            .collect(),
        is_bigendian: false,
        point_step: 12,
        row_step: 12 * points.len() as u32,
        data: ByteBuf::from(data.collect::<Vec<u8>>()),
        is_dense: true,
    }
}

/// A cloud of `x y z` in f32 and one field more, whose bytes come with each point.
fn cloud_with<const BYTES: usize>(
    header: Header,
    (name, datatype): (&str, u8),
    points: impl Iterator<Item = ([f32; 3], [u8; BYTES])>,
) -> PointCloud2 {
    let step = 12 + BYTES as u32;
    let mut message = cloud("", 0, &[]);
    for (point, value) in points {
        let xyz = point.iter().flat_map(|v| v.to_le_bytes());
        message.data.extend(xyz.chain(value));
        message.width += 1;
    }
    message.header = header;
    message.fields.push(field(name, 12, datatype));
    message.point_step = step;
    message.row_step = step * message.width;
    message
}

/// A cloud of `x y z` in f32 and `t` in ns since the stamp.
pub fn timed_cloud(frame: &str, stamp_ns: i64, points: &[([f32; 3], u32)]) -> PointCloud2 {
    let points = points.iter().map(|(xyz, t_ns)| (*xyz, t_ns.to_le_bytes()));
    cloud_with(header(frame, stamp_ns), ("t", PointField::UINT32), points)
}

/// Points of a cloud of `x y z` in f32, as the nodes publish them.
pub fn points(cloud: &PointCloud2) -> Vec<Vector3<f64>> {
    assert_eq!(cloud.data.len(), 12 * cloud.width as usize);
    let value = |bytes: &[u8]| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()));
    cloud
        .data
        .chunks_exact(12)
        .map(|p| Vector3::new(value(&p[0..4]), value(&p[4..8]), value(&p[8..12])))
        .collect()
}

/// A pose message.
pub fn pose(isometry: &Isometry3<f64>) -> Pose {
    let (t, q) = (isometry.translation.vector, isometry.rotation);
    Pose {
        position: Point {
            x: t.x,
            y: t.y,
            z: t.z,
        },
        orientation: Quaternion {
            x: q.i,
            y: q.j,
            z: q.k,
            w: q.w,
        },
    }
}

/// Odometry in `map`.
pub fn odometry(stamp_ns: i64, map_from_base: &Isometry3<f64>) -> Odometry {
    let mut message = Odometry {
        header: header("map", stamp_ns),
        child_frame_id: "base_link".into(),
        ..Odometry::default()
    };
    message.pose.pose = pose(map_from_base);
    message
}

/// A cloud of `x y z` in f32 and `rgb` as PCL packs it; alpha is 0.
pub fn colored_cloud(frame: &str, stamp_ns: i64, points: &[([f32; 3], [u8; 3])]) -> PointCloud2 {
    let points = points
        .iter()
        .map(|(xyz, [r, g, b])| (*xyz, [*b, *g, *r, 0]));
    cloud_with(
        header(frame, stamp_ns),
        ("rgb", PointField::FLOAT32),
        points,
    )
}

/// A cloud of `x y z` in f32 and `label` in u16.
pub fn labelled_cloud(frame: &str, stamp_ns: i64, points: &[([f32; 3], u16)]) -> PointCloud2 {
    let points = points
        .iter()
        .map(|(xyz, label)| (*xyz, label.to_le_bytes()));
    cloud_with(
        header(frame, stamp_ns),
        ("label", PointField::UINT16),
        points,
    )
}
