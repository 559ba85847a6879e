//! Fields `vp_x`, `vp_y`, `vp_z` of a cloud: the place of the sensor when it saw the point, in the
//! frame of the cloud. Rays from there are free space.

use lattice_core::cloud::{CloudError, CloudLimits, PointField};
use lattice_msgs::sensor_msgs::{self, PointCloud2};
use nalgebra::Vector3;

use super::cloud::{Precision, layout_of};

/// Names of the fields.
pub const VIEWPOINT_FIELDS: [&str; 3] = ["vp_x", "vp_y", "vp_z"];

/// The fields in the precision of the coordinates; whoever writes the cloud sets the offsets.
pub fn viewpoint_fields(precision: Precision) -> [PointField; 3] {
    VIEWPOINT_FIELDS.map(|name| PointField {
        name: name.to_owned(),
        offset: 0,
        datatype: match precision {
            Precision::Float32 => sensor_msgs::PointField::FLOAT32,
            Precision::Float64 => sensor_msgs::PointField::FLOAT64,
        },
        count: 1,
    })
}

/// Appends a viewpoint in the precision of the coordinates.
pub fn append_viewpoint(viewpoint_m: &Vector3<f64>, precision: Precision, data: &mut Vec<u8>) {
    for v in viewpoint_m.iter() {
        match precision {
            Precision::Float32 => data.extend_from_slice(&(*v as f32).to_le_bytes()),
            Precision::Float64 => data.extend_from_slice(&v.to_le_bytes()),
        }
    }
}

/// The viewpoint of each point, NaN where it is not known; `None` if the cloud has no such fields.
pub fn viewpoints_from_message(
    cloud: &PointCloud2,
    limits: &CloudLimits,
) -> Result<Option<Vec<Vector3<f64>>>, CloudError> {
    let layout = layout_of(cloud);
    let view = layout.view(&cloud.data, limits)?;
    let field = |name: &str| view.fields().iter().find(|field| field.name == name);
    let [Some(x), Some(y), Some(z)] = VIEWPOINT_FIELDS.map(field) else {
        return Ok(None);
    };
    let at = |i| Vector3::new(view.scalar(x, i), view.scalar(y, i), view.scalar(z, i));
    Ok(Some((0..view.len()).map(at).collect()))
}
