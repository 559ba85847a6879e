//! PointCloud2 and the core's clouds.

use lattice_core::cloud::{
    Cloud, CloudError, CloudLayout, CloudLimits, Datatype, LayoutNote, PointField,
};
use lattice_msgs::sensor_msgs::{self, PointCloud2};
use lattice_msgs::std_msgs::Header;
use nalgebra::Vector3;
use serde_bytes::ByteBuf;

/// Datums of clouds that carry f64 coordinates are multiples of this.
const DATUM_TILE_M: f64 = 1024.0;

/// Type of the coordinates of `points_enu`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 12 bytes a point; 4 um at 64 m from the map origin, 4 mm at 64 km.
    Float32,
    /// 24 bytes a point; exact anywhere, but RViz does not draw it.
    Float64,
}

/// Coordinates below this are rounded by less than 0.5 mm in single precision, m.
const SINGLE_REACH_M: f64 = 16_384.0;

impl Precision {
    /// Single precision where it rounds the points by less than 0.5 mm, else double.
    pub fn for_points(points_m: &[Vector3<f64>]) -> Self {
        match points_m.iter().all(|p| p.amax() < SINGLE_REACH_M) {
            true => Self::Float32,
            false => Self::Float64,
        }
    }
}

/// The layout of a message, mended as its data allow. Nothing is believed until [`CloudLayout::view`].
pub fn layout_of(cloud: &PointCloud2) -> CloudLayout {
    mended_layout_of(cloud).0
}

/// The same, with what was mended.
pub fn mended_layout_of(cloud: &PointCloud2) -> (CloudLayout, Vec<LayoutNote>) {
    let field = |field: &sensor_msgs::PointField| PointField {
        name: field.name.clone(),
        offset: field.offset,
        datatype: field.datatype,
        count: field.count,
    };
    let mut layout = CloudLayout {
        width: cloud.width,
        height: cloud.height,
        point_step: cloud.point_step,
        row_step: cloud.row_step,
        is_bigendian: cloud.is_bigendian,
        fields: cloud.fields.iter().map(field).collect(),
    };
    let notes = layout.mend(cloud.data.len());
    (layout, notes)
}

/// Bytes that a cloud takes in memory, its fields included.
pub fn bytes_of(cloud: &PointCloud2) -> usize {
    let fields = cloud.fields.iter();
    let names: usize = fields
        .map(|field| size_of_val(field) + field.name.len())
        .sum();
    size_of_val(cloud) + cloud.header.frame_id.len() + names + cloud.data.len()
}

/// Points in the frame of `header` as an unordered, dense PointCloud2 with `x`, `y`, `z`.
pub fn message_from_points(
    header: Header,
    points_m: &[Vector3<f64>],
    precision: Precision,
) -> PointCloud2 {
    message_with_fields(header, points_m, precision, &[], |_, _| {})
}

/// The same with further fields, of which `append` writes those of point `i`, little endian and one
/// behind the other. Their offsets are set here.
pub fn message_with_fields(
    header: Header,
    points_m: &[Vector3<f64>],
    precision: Precision,
    further: &[PointField],
    mut append: impl FnMut(usize, &mut Vec<u8>),
) -> PointCloud2 {
    let (size, datatype) = match precision {
        Precision::Float32 => (4_u32, sensor_msgs::PointField::FLOAT32),
        Precision::Float64 => (8, sensor_msgs::PointField::FLOAT64),
    };
    let mut fields = xyz_fields(datatype, size);
    let mut point_step = 3 * size;
    for field in further {
        let width = Datatype::from_code(field.datatype).map_or(0, Datatype::bytes);
        fields.push(sensor_msgs::PointField {
            name: field.name.clone(),
            offset: point_step,
            datatype: field.datatype,
            count: field.count,
        });
        point_step = point_step.saturating_add(field.count.saturating_mul(width));
    }
    let mut data = Vec::with_capacity(points_m.len() * point_step as usize);
    for (i, p) in points_m.iter().enumerate() {
        for v in [p.x, p.y, p.z] {
            match precision {
                Precision::Float32 => data.extend_from_slice(&(v as f32).to_le_bytes()),
                Precision::Float64 => data.extend_from_slice(&v.to_le_bytes()),
            }
        }
        append(i, &mut data);
    }
    dense_cloud(header, fields, point_step, points_m.len(), data)
}

/// An unordered cloud of `points` rows of `point_step` bytes, little endian.
pub fn dense_cloud(
    header: Header,
    fields: Vec<sensor_msgs::PointField>,
    point_step: u32,
    points: usize,
    data: Vec<u8>,
) -> PointCloud2 {
    let width = u32::try_from(points).unwrap_or(u32::MAX);
    PointCloud2 {
        header,
        height: 1,
        width,
        fields,
        is_bigendian: false,
        point_step,
        row_step: point_step.saturating_mul(width),
        data: ByteBuf::from(data),
        is_dense: true,
    }
}

/// Fields `x`, `y`, `z` one behind the other.
pub fn xyz_fields(datatype: u8, size: u32) -> Vec<sensor_msgs::PointField> {
    let places = [("x", 0), ("y", size), ("z", 2 * size)];
    places
        .map(|(name, offset)| field(name, offset, datatype))
        .into()
}

/// A field of one element.
pub fn field(name: &str, offset: u32, datatype: u8) -> sensor_msgs::PointField {
    sensor_msgs::PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    }
}

/// A cloud that is already in the map frame, as f32 offsets from a datum.
///
/// f32 coordinates pass unchanged, with the datum zero. For f64 coordinates the datum is near the
/// point that is nearest to `near_m` (the datum of the map), so that no stray point can cost the
/// others their digits.
pub fn cloud_from_message(
    cloud: &PointCloud2,
    limits: &CloudLimits,
    near_m: &Vector3<f64>,
) -> Result<Cloud, CloudError> {
    let layout = layout_of(cloud);
    let view = layout.view(&cloud.data, limits)?;
    let points = (0..view.len()).map(|i| view.xyz(i));
    let is_double = sensor_msgs::PointField::FLOAT64;
    let mut fields = cloud.fields.iter();
    let wide = fields.any(|field| field.name == "x" && field.datatype == is_double);
    let finite = points.clone().filter(|p| p.iter().all(|v| v.is_finite()));
    let by_distance = |a: &Vector3<f64>, b: &Vector3<f64>| {
        let [a, b] = [a, b].map(|p| (p - near_m).norm_squared());
        a.total_cmp(&b)
    };
    let nearest = wide.then(|| finite.min_by(by_distance)).flatten();
    let tile = |v: f64| (v / DATUM_TILE_M).round() * DATUM_TILE_M;
    let datum_m = nearest.map_or_else(Vector3::zeros, |p| p.map(tile));
    let offset = |p: Vector3<f64>| -> [f32; 3] { (p - datum_m).map(|v| v as f32).into() };
    let offsets_m = points.map(offset).collect();
    Ok(Cloud {
        stamp_ns: cloud.header.stamp.to_ns(),
        datum_m,
        offsets_m,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::geometry::header;

    const LIMITS: CloudLimits = CloudLimits { max_points: 10 };
    const NEAR: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

    #[test]
    fn f32_points_near_the_origin_pass_unchanged() {
        let points = [Vector3::new(1.1, -2.2, 3.3), Vector3::new(400.0, 5e-8, 7.0)];
        let message = message_from_points(header("map", 7), &points, Precision::Float32);
        assert_eq!(message.data.len(), 24);
        let cloud = cloud_from_message(&message, &LIMITS, &NEAR).unwrap();
        assert_eq!(cloud.datum_m, Vector3::zeros());
        assert_eq!(cloud.stamp_ns, 7);
        for (point, offset) in points.iter().zip(&cloud.offsets_m) {
            assert_eq!(*offset, [point.x as f32, point.y as f32, point.z as f32]);
        }
    }

    #[test]
    fn points_far_from_the_origin_are_given_in_double_precision() {
        let near = [Vector3::new(16_383.0, -16_383.0, 0.0)];
        assert_eq!(Precision::for_points(&near), Precision::Float32);
        let far = [near[0], Vector3::new(0.0, -16_385.0, 0.0)];
        assert_eq!(Precision::for_points(&far), Precision::Float64);
        assert!((f64::from(16_383.25_f32 + 4e-4) - (16_383.25 + 4e-4)).abs() < 5e-4);
    }

    #[test]
    fn f64_points_keep_their_place_far_from_the_origin() {
        let points = [Vector3::new(4_000_000.123_456, -3.25, 1e5 + 1.0 / 3.0)];
        let message = message_from_points(header("map", 0), &points, Precision::Float64);
        let cloud = cloud_from_message(&message, &LIMITS, &NEAR).unwrap();
        assert!((cloud.point_m(0) - points[0]).norm() < 5e-5);
    }

    #[test]
    fn stray_points_do_not_choose_the_datum() {
        let stray = [Vector3::repeat(f64::NAN), Vector3::new(1e12, 0.0, 0.0)];
        let good = Vector3::new(5000.0, 0.1, 0.2);
        let points = [stray[0], stray[1], good];
        for precision in [Precision::Float32, Precision::Float64] {
            let message = message_from_points(header("map", 0), &points, precision);
            let cloud = cloud_from_message(&message, &LIMITS, &NEAR).unwrap();
            assert!((cloud.point_m(2) - good).norm() < 1e-4, "{precision:?}");
            assert!(cloud.offsets_m[0][0].is_nan());
        }
    }
}
