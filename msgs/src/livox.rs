//! Messages of the ROS drivers of Livox lidars: one layout under three package names.

/// Declares the messages of a package.
macro_rules! livox_messages {
    ($module:ident, $package:literal) => {
        #[doc = concat!("Messages of ", $package, ".")]
        pub mod $module {
            use serde::{Deserialize, Serialize};

            use crate::interface::messages;
            use crate::std_msgs::Header;

            messages! {
                $package in "../definitions/livox_ros_driver2/";
                CustomPoint [];
                CustomMsg [Header, CustomPoint];
            }

            /// A point of a Livox lidar.
            #[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
            pub struct CustomPoint {
                /// Since the stamp, ns.
                pub offset_time: u32,
                /// x coordinate, m.
                pub x: f32,
                /// y coordinate, m.
                pub y: f32,
                /// z coordinate, m.
                pub z: f32,
                /// 0 to 255.
                pub reflectivity: u8,
                /// Confidence and number of the return, as the manual has it.
                pub tag: u8,
                /// Laser.
                pub line: u8,
            }

            /// Points of a Livox lidar.
            #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
            pub struct CustomMsg {
                /// Time of the first point, and frame of the coordinates.
                pub header: Header,
                /// Time of the first point in the clock of the lidar, ns.
                pub timebase: u64,
                /// Points in the message.
                pub point_num: u32,
                /// Number of the lidar.
                pub lidar_id: u8,
                /// Reserved.
                pub rsvd: [u8; 3],
                /// The points.
                pub points: Vec<CustomPoint>,
            }
        }
    };
}

livox_messages!(livox_interfaces, "livox_interfaces");
livox_messages!(livox_ros_driver, "livox_ros_driver");
livox_messages!(livox_ros_driver2, "livox_ros_driver2");

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
