//! Storage of a bag writer, with the options and topics that it takes.

use std::{error::Error, io, path::Path};

use mcap::McapError;

use crate::{BagError, BagQos, TopicInfo};

pub(super) fn failed(path: &Path, doing: &'static str) -> impl FnOnce(SinkError) -> BagError {
    // The system's own error reports a full disk.
    let system = |error: SinkError| match error.downcast().map(|error| *error) {
        Ok(McapError::Io(error)) => error,
        Ok(other) => io::Error::other(other),
        Err(error) => io::Error::other(error),
    };
    move |error| BagError::io(path, doing)(system(error))
}

/// Distribution name in the metadata.
pub(super) const ROS_DISTRO: &str = "lattice";

/// Length of the CDR encapsulation header.
pub(super) const ENCAPSULATION_BYTES: usize = 4;

/// Compression of a bag being written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Compression {
    /// None.
    #[default]
    None,
    /// Each message.
    Messages,
    /// Each storage file, once complete.
    Files,
}

/// A topic to write.
#[derive(Clone, Debug, Default)]
pub struct TopicSpec {
    /// Full topic name, such as "/tf".
    pub name: String,
    /// Type, such as "tf2_msgs/msg/TFMessage".
    pub type_name: String,
    /// Type hash, such as "RIHS01_..."; empty if unknown.
    pub type_hash: String,
    /// Message definition with its dependencies (ros2msg or ros2idl text).
    pub definition: Option<String>,
    /// QoS of the publishers.
    pub offered_qos: Vec<BagQos>,
}

pub(super) type SinkError = Box<dyn Error + Send + Sync>;

/// Storage file being written; topics count from 0 in the order they are added.
pub(super) trait Sink: Send {
    fn add_topic(&mut self, topic: &TopicInfo, qos: &str) -> Result<(), SinkError>;
    fn write(&mut self, topic: usize, log_time_ns: i64, data: &[u8]) -> Result<(), SinkError>;
    /// Passes all data to the system, so that they survive the process.
    fn flush(&mut self) -> Result<(), SinkError>;
    fn finish(self: Box<Self>, metadata: &str) -> Result<(), SinkError>;
}
