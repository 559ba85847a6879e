//! Records of converted points.

use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::std_msgs::Header;

use crate::convert::cloud::{dense_cloud, field, xyz_fields};

/// Field of the time of a converted point since the stamp of its cloud, ns (f64).
pub const TIME_FIELD: &str = "since_stamp_ns";

/// Points with the same fields: `x`, `y`, `z` as f32, and further ones.
pub(super) struct Records {
    fields: Vec<PointField>,
    point_step: u32,
    points: usize,
    data: Vec<u8>,
    is_dense: bool,
}

impl Records {
    /// Records with fields of a name and a type; room for `points` of them.
    pub fn new(points: usize, further: &[(&str, u8)]) -> Self {
        let mut fields = xyz_fields(PointField::FLOAT32, 4);
        let mut point_step = 12_u32;
        for (name, datatype) in further {
            fields.push(field(name, point_step, *datatype));
            point_step = point_step.saturating_add(match *datatype {
                PointField::UINT8 => 1,
                PointField::FLOAT64 => 8,
                _ => 4,
            });
        }
        Self {
            fields,
            point_step,
            points: 0,
            data: Vec::with_capacity(points.saturating_mul(point_step as usize)),
            is_dense: true,
        }
    }

    /// Begins a record. Its further fields follow by [`Records::put`], in order.
    pub fn begin(&mut self, point_m: [f32; 3]) {
        self.points += 1;
        self.is_dense &= point_m.iter().all(|v| v.is_finite());
        point_m.iter().for_each(|v| self.put(v.to_le_bytes()));
    }

    /// Adds the little-endian bytes of a field.
    pub fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        self.data.extend_from_slice(&bytes);
    }

    /// The cloud.
    pub fn finish(self, header: Header) -> PointCloud2 {
        PointCloud2 {
            is_dense: self.is_dense,
            ..dense_cloud(header, self.fields, self.point_step, self.points, self.data)
        }
    }
}
