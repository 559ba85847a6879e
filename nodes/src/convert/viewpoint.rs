//! Viewpoint fields `vp_x`, `vp_y`, `vp_z` of a cloud: the sensor position for each point, in the
//! frame of the cloud. The ray from there to the point is free space.

pub use lattice_core::cloud::VIEWPOINT_FIELDS;
use lattice_core::cloud::{CloudError, CloudLimits, CloudView};
use lattice_msgs::sensor_msgs::PointCloud2;
use nalgebra::Vector3;

use super::cloud::layout_of;

/// Viewpoint of each point, NaN if unknown; `None` if the cloud has no such fields.
pub fn viewpoints_from_message(
    cloud: &PointCloud2,
    limits: &CloudLimits,
) -> Result<Option<Vec<Vector3<f64>>>, CloudError> {
    let layout = layout_of(cloud);
    let view = layout.view(&cloud.data, limits)?;
    Ok(viewpoints(&view).map(Iterator::collect))
}

/// Common viewpoint of a cloud's points, in its frame; `None` if unknown, or if one differs by more than
/// `max_moved_m` from that of the first point.
pub fn viewpoint_of(view: &CloudView, max_moved_m: f64) -> Option<Vector3<f64>> {
    let mut all = viewpoints(view)?;
    let first = all.next()?;
    // False for NaN.
    let is_still = |v: Vector3<f64>| (v - first).norm() <= max_moved_m;
    (is_still(first) && all.all(is_still)).then_some(first)
}

fn viewpoints(view: &CloudView) -> Option<impl Iterator<Item = Vector3<f64>>> {
    let field = |name: &str| view.fields().iter().find(|field| field.name == name);
    let [Some(x), Some(y), Some(z)] = VIEWPOINT_FIELDS.map(field) else {
        return None;
    };
    let at = |i| Vector3::new(view.scalar(x, i), view.scalar(y, i), view.scalar(z, i));
    Some((0..view.len()).map(at))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::convert::cloud::{dense_cloud, field, xyz_fields};
    use lattice_msgs::sensor_msgs;
    use lattice_msgs::std_msgs::Header;

    fn cloud(names: [&str; 3], viewpoints: &[[f32; 3]]) -> PointCloud2 {
        let float = sensor_msgs::PointField::FLOAT32;
        let mut fields = xyz_fields(float, 4);
        fields.extend(
            [12, 16, 20]
                .into_iter()
                .zip(names)
                .map(|(at, name)| field(name, at, float)),
        );
        let point = |v: &[f32; 3]| [1.0, 2.0, 3.0, v[0], v[1], v[2]].map(f32::to_le_bytes);
        let data: Vec<u8> = viewpoints.iter().flat_map(point).flatten().collect();
        dense_cloud(Header::default(), fields, 24, viewpoints.len(), data)
    }

    #[test]
    fn a_sensor_that_stood_still_has_one_viewpoint() {
        let limits = CloudLimits::default();
        let one = |names, viewpoints: &[[f32; 3]]| {
            let cloud = cloud(names, viewpoints);
            let layout = layout_of(&cloud);
            viewpoint_of(&layout.view(&cloud.data, &limits).unwrap(), 0.1)
        };
        let here = [4.0, 5.0, 6.0];
        let near = [4.0, 5.0, 6.05];
        let away = [4.0, 5.0, 6.5];
        let expected = Some(Vector3::new(4.0, 5.0, 6.0));
        assert_eq!(one(VIEWPOINT_FIELDS, &[here, near]), expected);
        assert_eq!(one(VIEWPOINT_FIELDS, &[here, near, away]), None);
        assert_eq!(one(VIEWPOINT_FIELDS, &[here, [f32::NAN; 3]]), None);
        assert_eq!(one(VIEWPOINT_FIELDS, &[[f32::INFINITY; 3]; 2]), None);
        assert_eq!(one(VIEWPOINT_FIELDS, &[]), None);
        assert_eq!(one(["vp_x", "vp_y", "nx"], &[here]), None);
    }
}
