//! Labelled clouds as messages.

use lattice_core::registration::{SemanticCloud, UNLABELED};
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_msgs::std_msgs::Header;

use super::Color;
use crate::convert::cloud::{dense_cloud, field, xyz_fields};

/// Bytes per point: x, y, z, rgb, label, confidence.
const POINT_STEP: u32 = 22;

/// Points in the frame of `header` with the most probable class of each as `label` (uint16), its
/// probability as `confidence`, and a colour of the class as `rgb`.
pub fn message_from_semantic(header: Header, cloud: &SemanticCloud) -> PointCloud2 {
    let mut fields = xyz_fields(PointField::FLOAT32, 4);
    fields.extend([
        field("rgb", 12, PointField::FLOAT32),
        field("label", 16, PointField::UINT16),
        field("confidence", 18, PointField::FLOAT32),
    ]);
    let mut data = Vec::with_capacity(cloud.len() * POINT_STEP as usize);
    for (i, point) in cloud.points_m.iter().enumerate() {
        let label = cloud.label(i).iter().next();
        let (class, confidence) = label.unwrap_or((UNLABELED, 0.0));
        let [r, g, b] = color_of(class);
        for v in point.iter() {
            data.extend_from_slice(&(*v as f32).to_le_bytes());
        }
        data.extend_from_slice(&[b, g, r, 0]);
        data.extend_from_slice(&class.to_le_bytes());
        data.extend_from_slice(&confidence.to_le_bytes());
    }
    dense_cloud(header, fields, POINT_STEP, cloud.len(), data)
}

/// Colour of a class, distinct from those of adjacent class numbers; grey for no class.
///
/// Bits of the number set the highest bits of red, green and blue in turn, as in the colour map of
/// Pascal VOC; class 0, black there, has the colour of 256.
pub fn color_of(class: u16) -> Color {
    if class == UNLABELED {
        return [128; 3];
    }
    let mut rest = if class == 0 { 256 } else { u32::from(class) };
    let mut color = [0_u8; 3];
    for bit in (0..8).rev() {
        for channel in &mut color {
            *channel |= ((rest & 1) as u8) << bit;
            rest >>= 1;
        }
    }
    color
}
