//! Clouds of sensors: each message type with points or ranges, converted to PointCloud2.
//!
//! | type | points |
//! |---|---|
//! | sensor_msgs/PointCloud2 | as they are |
//! | livox_ros_driver2, livox_ros_driver, livox_interfaces: CustomMsg | those that are not in the origin |
//! | sensor_msgs/PointCloud | all, each channel as a field |
//! | sensor_msgs/LaserScan | one for each ray |
//! | sensor_msgs/MultiEchoLaserScan | one for each echo |
//!
//! Times of converted points are in the field [`TIME_FIELD`].

mod channels;
mod cloud_type;
mod error;
mod livox;
mod records;
mod scan;
mod subscription;

pub use channels::cloud_of_channels;
pub use cloud_type::{CloudType, SensorCloud, time_options};
pub use error::{CloudInputError, MAX_POINTS};
pub use livox::cloud_of_livox;
pub use records::TIME_FIELD;
pub use scan::{cloud_of_echoes, cloud_of_scan};
pub use subscription::{CloudSubscriptions, Converted, SubscribedClouds, bytes_of};

#[cfg(test)]
mod tests;
