//! Points with a class and its confidence, as clouds have them.

use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::std_msgs::Header;

use crate::convert::cloud::{dense_cloud, field, xyz_fields};

/// Bytes of a point: x, y, z in f32, label in u16, confidence in f32.
const POINT_STEP: usize = 18;

/// Records of points, little endian.
#[derive(Debug, Default)]
pub struct LabelledPoints {
    data: Vec<u8>,
}

impl LabelledPoints {
    /// No points, with room for some.
    pub fn with_capacity(points: usize) -> Self {
        Self {
            data: Vec::with_capacity(points * POINT_STEP),
        }
    }

    /// Adds a point; without a class its confidence is 0.
    pub fn push(&mut self, point_m: [f32; 3], class: Option<u16>, confidence: f32) {
        for v in point_m {
            self.data.extend_from_slice(&v.to_le_bytes());
        }
        let label = class.unwrap_or(UNLABELED);
        let confidence = class.map_or(0.0, |_| confidence);
        self.data.extend_from_slice(&label.to_le_bytes());
        self.data.extend_from_slice(&confidence.to_le_bytes());
    }

    /// Points.
    pub fn len(&self) -> usize {
        self.data.len() / POINT_STEP
    }

    /// True without points.
    pub fn is_empty(&self) -> bool {
        self.data.is_empty()
    }

    /// The cloud with the fields x, y, z, label and confidence.
    pub fn cloud(self, header: Header) -> PointCloud2 {
        let mut fields = xyz_fields(PointField::FLOAT32, 4);
        fields.push(field("label", 12, PointField::UINT16));
        fields.push(field("confidence", 14, PointField::FLOAT32));
        dense_cloud(header, fields, POINT_STEP as u32, self.len(), self.data)
    }
}
