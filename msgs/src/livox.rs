//! Messages of the ROS drivers of Livox lidars: one layout under three package names.

use crate::packages::{livox_interfaces, livox_ros_driver, livox_ros_driver2};

/// Converts the messages of an earlier package to those of the current one.
macro_rules! into_driver2 {
    ($($module:ident),*) => {
        $(impl From<$module::CustomMsg> for livox_ros_driver2::CustomMsg {
            fn from(message: $module::CustomMsg) -> Self {
                let points = message.points.into_iter();
                let points = points.map(|point| livox_ros_driver2::CustomPoint {
                    offset_time: point.offset_time,
                    x: point.x,
                    y: point.y,
                    z: point.z,
                    reflectivity: point.reflectivity,
                    tag: point.tag,
                    line: point.line,
                });
                Self {
                    header: message.header,
                    timebase: message.timebase,
                    point_num: message.point_num,
                    lidar_id: message.lidar_id,
                    rsvd: message.rsvd,
                    points: points.collect(),
                }
            }
        })*
    };
}

into_driver2!(livox_interfaces, livox_ros_driver);
