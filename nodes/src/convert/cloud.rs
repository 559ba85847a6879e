//! Conversion between PointCloud2 and the core's clouds.

pub use lattice_core::cloud::Precision;
use lattice_core::cloud::{
    Cloud, CloudError, CloudLayout, CloudLimits, CloudView, LayoutNote, PointField,
};
use lattice_msgs::sensor_msgs::{self, PointCloud2};
use lattice_msgs::std_msgs::Header;
use nalgebra::Vector3;
use serde_bytes::ByteBuf;

/// Datums of clouds with f64 coordinates are multiples of this.
const DATUM_TILE_M: f64 = 1024.0;

/// Message fields of a core record.
pub fn message_fields(fields: Vec<PointField>) -> Vec<sensor_msgs::PointField> {
    let field = |field: PointField| sensor_msgs::PointField {
        name: field.name,
        offset: field.offset,
        datatype: field.datatype,
        count: field.count,
    };
    fields.into_iter().map(field).collect()
}

/// Layout of a message, corrected where its data allow it. It is unchecked until [`CloudLayout::view`].
pub fn layout_of(cloud: &PointCloud2) -> CloudLayout {
    mended_layout_of(cloud).0
}

/// Corrected layout, with notes on the corrections.
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

/// Size of a cloud in memory, fields included.
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
    let coordinates = points_m.iter().flatten();
    let data: Vec<u8> = match precision {
        Precision::Float32 => coordinates
            .flat_map(|v| (*v as f32).to_le_bytes())
            .collect(),
        Precision::Float64 => coordinates.flat_map(|v| v.to_le_bytes()).collect(),
    };
    let size = precision.datatype().bytes();
    let fields = xyz_fields(precision.datatype() as u8, size);
    dense_cloud(header, fields, 3 * size, points_m.len(), data)
}

/// Unordered cloud of `points` records of `point_step` bytes, little endian.
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

/// Fields `x`, `y`, `z` from offset 0, each of `size` bytes.
pub fn xyz_fields(datatype: u8, size: u32) -> Vec<sensor_msgs::PointField> {
    let places = [("x", 0), ("y", size), ("z", 2 * size)];
    places
        .map(|(name, offset)| field(name, offset, datatype))
        .into()
}

/// Field of one element.
pub fn field(name: &str, offset: u32, datatype: u8) -> sensor_msgs::PointField {
    sensor_msgs::PointField {
        name: name.to_owned(),
        offset,
        datatype,
        count: 1,
    }
}

/// Cloud in the map frame, as f32 offsets from a datum.
///
/// f32 coordinates are unchanged, with a zero datum. For f64 coordinates the datum is near the
/// point closest to `near_m` (the datum of the map), so that an outlier does not reduce the
/// precision of the others.
pub fn cloud_from_message(
    cloud: &PointCloud2,
    limits: &CloudLimits,
    near_m: &Vector3<f64>,
) -> Result<Cloud, CloudError> {
    let layout = layout_of(cloud);
    let view = layout.view(&cloud.data, limits)?;
    let (datum_m, offsets_m) = match view.single_points() {
        Some(offsets_m) => (Vector3::zeros(), offsets_m),
        None => near_offsets(&view, near_m),
    };
    Ok(Cloud {
        stamp_ns: cloud.header.stamp.to_ns(),
        datum_m,
        offsets_m,
    })
}

/// Datum near the point closest to `near_m`, and offsets of all points from it.
fn near_offsets(view: &CloudView<'_>, near_m: &Vector3<f64>) -> (Vector3<f64>, Vec<[f32; 3]>) {
    let points = (0..view.len()).map(|i| view.xyz(i));
    let finite = points.clone().filter(|p| p.iter().all(|v| v.is_finite()));
    let by_distance = |a: &Vector3<f64>, b: &Vector3<f64>| {
        let [a, b] = [a, b].map(|p| (p - near_m).norm_squared());
        a.total_cmp(&b)
    };
    let tile = |v: f64| (v / DATUM_TILE_M).round() * DATUM_TILE_M;
    let nearest = finite.min_by(by_distance);
    let datum_m = nearest.map_or_else(Vector3::zeros, |p| p.map(tile));
    let offset = |p: Vector3<f64>| -> [f32; 3] { (p - datum_m).map(|v| v as f32).into() };
    (datum_m, points.map(offset).collect())
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
