//! Roles of topics in a replay, and errors of logs that cannot be replayed.

use lattice_bag::{BagError, BagReader};
use thiserror::Error;

use super::camera_input::CameraInput;
use crate::cloud_input::CloudType;
use lattice_runtime::params::ParamError;

/// Error of a log that cannot be replayed.
#[derive(Debug, Error)]
pub enum TopicError {
    /// Slice that is empty or begins before the log.
    #[error(
        "no clouds from {from_s} s to {to_s} s: a slice begins at 0 s or later and ends behind its beginning"
    )]
    Slice {
        /// Requested start, s after the start of the log.
        from_s: f64,
        /// Requested end, s after the start of the log.
        to_s: f64,
    },
    /// Requested topic that is not in the log.
    #[error("no topic '{name}' of type {type_name} in the log; it has {has}")]
    Missing {
        /// Requested name.
        name: String,
        /// Required type.
        type_name: &'static str,
        /// Topics of that type, or of any.
        has: String,
    },
    /// Requested topic without clouds.
    #[error("no topic '{name}' of clouds in the log ({types}); it has {has}{remedy}")]
    MissingClouds {
        /// Requested name.
        name: String,
        /// Supported cloud types.
        types: String,
        /// Topics of the log with their types.
        has: String,
        /// Command that makes clouds of other topics of the log; may be empty.
        remedy: String,
    },
    /// Nothing to map.
    #[error("no topic of clouds in the log ({types}); it has {has}{remedy}")]
    NoClouds {
        /// Supported cloud types.
        types: String,
        /// Topics of the log with their types.
        has: String,
        /// Command that makes clouds of other topics of the log; may be empty.
        remedy: String,
    },
    /// Clouds of several robots.
    #[error("clouds of several robots: {robots}; choose those of one with --points TOPIC")]
    Robots {
        /// Robots with the topics of their clouds and transforms.
        robots: String,
    },
    /// Depth images without a stream that the parameters ask for.
    #[error(
        "{depth}: no {what} in its frame '{frame}' are in the log, as the parameters ask: set `{parameter}`, or record \
         depth that is registered to them"
    )]
    NoCompanion {
        /// Topic of the depth images.
        depth: String,
        /// Frame of the depth images.
        frame: String,
        /// The missing stream.
        what: &'static str,
        /// Parameter that does without.
        parameter: &'static str,
    },
    /// Depth images without poses.
    #[error(
        "no poses in the log for the depth images of {depth}, which lidar odometry does not register: record /tf of a \
         fixed frame or nav_msgs/msg/Odometry too, as a visual odometry or SLAM node publishes them; the log has {has}"
    )]
    NoPoses {
        /// Topics of the depth images.
        depth: String,
        /// Topics of the log with their types.
        has: String,
    },
    /// Parameters of `semantic_cloud`.
    #[error(transparent)]
    Params(#[from] ParamError),
    /// Error of reading the log.
    #[error(transparent)]
    Bag(#[from] BagError),
}

/// Role of a topic in the replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Clouds of a sensor.
    Cloud(CloudType),
    /// Input of a depth camera.
    Camera(CameraInput),
    /// INS message of this ROS type.
    Ins(&'static str),
    /// Imu to compare the attitudes with.
    Imu,
    /// `/tf` or, if true, `/tf_static`.
    Transforms(bool),
}

impl Role {
    /// True for clouds of any type, and for depth images, which become clouds.
    pub fn is_cloud(self) -> bool {
        use CameraInput::{CompressedDepth, Depth};
        matches!(self, Self::Cloud(_) | Self::Camera(Depth | CompressedDepth))
    }

    /// True for images that depth images are matched with.
    pub fn is_companion(self) -> bool {
        matches!(self, Self::Camera(input) if input.is_companion())
    }
}

/// The topics of a log with their types, for an error.
pub(super) fn listing(bag: &BagReader) -> String {
    let topics = bag.topics().iter();
    let names = topics.map(|topic| format!("{} ({})", topic.name, topic.type_name));
    let names: Vec<String> = names.collect();
    match names.is_empty() {
        true => "no topics".into(),
        false => names.join(", "),
    }
}

/// Place of a topic of a type that the user names.
pub(super) fn find(
    bag: &BagReader,
    name: &str,
    type_name: &'static str,
) -> Result<usize, TopicError> {
    let mut topics = bag.topics().iter();
    topics
        .position(|topic| topic.name == name && topic.type_name == type_name)
        .ok_or_else(|| TopicError::Missing {
            name: name.to_owned(),
            type_name,
            has: listing(bag),
        })
}
