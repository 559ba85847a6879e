//! Clouds of the Livox drivers' own message.

use lattice_msgs::livox_ros_driver2::CustomMsg;
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};

use super::error::{CloudInputError, check_count};
use super::records::{Records, TIME_FIELD};

/// Cloud of a message, with the fields x, y, z, `intensity` (the reflectivity), `tag`, `line` and [`TIME_FIELD`].
///
/// Points in the origin are no returns and left out. Times count from the stamp: `timebase` is the same instant in the
/// clock of the lidar.
pub fn cloud_of_livox(message: &CustomMsg) -> Result<PointCloud2, CloudInputError> {
    check_count(message.points.len())?;
    let fields = [
        ("intensity", PointField::FLOAT32),
        ("tag", PointField::UINT8),
        ("line", PointField::UINT8),
        (TIME_FIELD, PointField::FLOAT64),
    ];
    let mut records = Records::new(message.points.len(), &fields);
    for point in &message.points {
        let point_m = [point.x, point.y, point.z];
        if point_m == [0.0; 3] {
            continue;
        }
        records.begin(point_m);
        records.put(f32::from(point.reflectivity).to_le_bytes());
        records.put([point.tag]);
        records.put([point.line]);
        records.put(f64::from(point.offset_time).to_le_bytes());
    }
    Ok(records.finish(message.header.clone()))
}
