//! Types of messages with points or ranges.

use std::borrow::Cow;
use std::sync::Arc;

use lattice_core::cloud::{TimeOptions, TimeReference, TimeUnit};
use lattice_msgs::RosMessage;
use lattice_msgs::cdr::{self, CdrError};
use lattice_msgs::sensor_msgs::{LaserScan, MultiEchoLaserScan, PointCloud, PointCloud2};
use lattice_msgs::std_msgs::Header;
use lattice_msgs::{livox_interfaces, livox_ros_driver, livox_ros_driver2};

use super::channels::cloud_of_channels;
use super::error::CloudInputError;
use super::livox::cloud_of_livox;
use super::records::TIME_FIELD;
use super::scan::{cloud_of_echoes, cloud_of_scan};

/// Type of a message with points or ranges. An earlier one is preferred where several describe the same scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CloudType {
    /// sensor_msgs/PointCloud2.
    PointCloud2,
    /// livox_ros_driver2/CustomMsg.
    LivoxDriver2,
    /// livox_ros_driver/CustomMsg.
    LivoxDriver,
    /// livox_interfaces/CustomMsg.
    LivoxInterfaces,
    /// sensor_msgs/PointCloud.
    PointCloud,
    /// sensor_msgs/LaserScan.
    LaserScan,
    /// sensor_msgs/MultiEchoLaserScan.
    MultiEchoLaserScan,
}

impl CloudType {
    /// All types.
    pub const ALL: [Self; 7] = [
        Self::PointCloud2,
        Self::LivoxDriver2,
        Self::LivoxDriver,
        Self::LivoxInterfaces,
        Self::PointCloud,
        Self::LaserScan,
        Self::MultiEchoLaserScan,
    ];

    /// Type of a name such as `sensor_msgs/msg/LaserScan`; `None` if it has no points.
    pub fn of(type_name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|known| known.name() == type_name)
    }

    /// Name of the type.
    pub fn name(self) -> &'static str {
        match self {
            Self::PointCloud2 => PointCloud2::TYPE,
            Self::LivoxDriver2 => livox_ros_driver2::CustomMsg::TYPE,
            Self::LivoxDriver => livox_ros_driver::CustomMsg::TYPE,
            Self::LivoxInterfaces => livox_interfaces::CustomMsg::TYPE,
            Self::PointCloud => PointCloud::TYPE,
            Self::LaserScan => LaserScan::TYPE,
            Self::MultiEchoLaserScan => MultiEchoLaserScan::TYPE,
        }
    }

    /// True for scans in one plane.
    pub fn is_planar(self) -> bool {
        matches!(self, Self::LaserScan | Self::MultiEchoLaserScan)
    }

    /// Decodes a message of the type.
    pub fn decode(self, data: &[u8]) -> Result<SensorCloud, CdrError> {
        Ok(match self {
            Self::PointCloud2 => SensorCloud::PointCloud2(cdr::from_slice(data)?),
            // The three have one layout.
            Self::LivoxDriver2 | Self::LivoxDriver | Self::LivoxInterfaces => {
                SensorCloud::Livox(cdr::from_slice(data)?)
            }
            Self::PointCloud => SensorCloud::PointCloud(cdr::from_slice(data)?),
            Self::LaserScan => SensorCloud::LaserScan(cdr::from_slice(data)?),
            Self::MultiEchoLaserScan => SensorCloud::MultiEchoLaserScan(cdr::from_slice(data)?),
        })
    }
}

/// A decoded message with points or ranges.
#[derive(Clone, Debug, PartialEq)]
pub enum SensorCloud {
    /// Cloud of points.
    PointCloud2(PointCloud2),
    /// Cloud of a Livox driver.
    Livox(livox_ros_driver2::CustomMsg),
    /// Cloud of the type before PointCloud2.
    PointCloud(PointCloud),
    /// Scan of a planar laser scanner.
    LaserScan(LaserScan),
    /// Scan of a planar laser scanner with several echoes per ray.
    MultiEchoLaserScan(MultiEchoLaserScan),
}

impl SensorCloud {
    /// Time and frame.
    pub fn header(&self) -> &Header {
        match self {
            Self::PointCloud2(message) => &message.header,
            Self::Livox(message) => &message.header,
            Self::PointCloud(message) => &message.header,
            Self::LaserScan(message) => &message.header,
            Self::MultiEchoLaserScan(message) => &message.header,
        }
    }

    /// True if points have labels.
    pub fn is_labelled(&self) -> bool {
        let Self::PointCloud2(message) = self else {
            return false;
        };
        message.fields.iter().any(|field| field.name == "label")
    }

    /// Points in the frame of the message.
    pub fn into_cloud(self) -> Result<Arc<PointCloud2>, CloudInputError> {
        let cloud = match self {
            Self::PointCloud2(message) => message,
            Self::Livox(message) => cloud_of_livox(&message)?,
            Self::PointCloud(message) => cloud_of_channels(&message)?,
            Self::LaserScan(message) => cloud_of_scan(&message)?,
            Self::MultiEchoLaserScan(message) => cloud_of_echoes(&message)?,
        };
        Ok(Arc::new(cloud))
    }
}

/// Options for the times of a cloud. Field and unit of a converted cloud are known: `time.field` and `time.unit` are for
/// PointCloud2.
pub fn time_options<'a>(cloud: &PointCloud2, options: &'a TimeOptions) -> Cow<'a, TimeOptions> {
    let is_converted = cloud.fields.iter().any(|field| field.name == TIME_FIELD);
    if !is_converted || options.field.as_deref() == Some("") {
        return Cow::Borrowed(options);
    }
    let is_of_sweep = |reference: &TimeReference| *reference != TimeReference::Absolute;
    Cow::Owned(TimeOptions {
        field: Some(TIME_FIELD.to_owned()),
        unit: Some(TimeUnit::Nanoseconds),
        reference: options.reference.filter(is_of_sweep),
        max_span_s: options.max_span_s,
    })
}
