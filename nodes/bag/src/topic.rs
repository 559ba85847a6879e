//! Topics and messages of a bag.

use super::BagQos;

/// Larger messages are refused, bytes.
pub(crate) const MAX_MESSAGE_BYTES: u64 = 1 << 30;

/// Messages of static transforms that a late joiner is given: the depth of tf2's listeners.
pub const STATIC_DEPTH: u64 = 100;

/// The storage plugins of rosbag2.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Storage {
    /// MCAP files.
    Mcap,
    /// SQLite databases.
    Sqlite3,
}

impl Storage {
    /// The plugin's name in `metadata.yaml`.
    pub fn identifier(self) -> &'static str {
        match self {
            Storage::Mcap => "mcap",
            Storage::Sqlite3 => "sqlite3",
        }
    }

    /// The extension of its files.
    pub fn extension(self) -> &'static str {
        match self {
            Storage::Mcap => "mcap",
            Storage::Sqlite3 => "db3",
        }
    }
}

/// A topic of a bag.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct TopicInfo {
    /// The topic's name, such as "/tf": with a leading slash, also where the bag lacks it.
    pub name: String,
    /// The type, such as "sensor_msgs/msg/PointCloud2"; empty where the bag lacks it.
    pub type_name: String,
    /// Hash of the type, such as "RIHS01_..."; empty where the bag lacks it.
    pub type_hash: String,
    /// Serialisation of its messages; "cdr" for ROS 2.
    pub serialization_format: String,
    /// QoS that each recorded publisher offered; empty where the bag lacks it.
    pub offered_qos: Vec<BagQos>,
    /// The message definition embedded in the bag (ros2msg or ros2idl text).
    pub definition: Option<String>,
    /// Number of its messages, by the bag's index.
    pub message_count: u64,
    /// Bytes of its messages as they are stored; nothing where the bag's index lacks it, as that of MCAP does.
    pub message_bytes: Option<u64>,
}

impl TopicInfo {
    /// True if late joiners expect the last messages of this topic.
    pub fn is_latched(&self) -> bool {
        self.has_static_transforms() || self.offered_qos.iter().any(|qos| qos.latched)
    }

    /// True for `/tf_static` in any namespace. Its messages are latched and hold at all times, whatever QoS the bag
    /// notes: up to metadata version 3 it notes none, and converters write the default.
    pub fn has_static_transforms(&self) -> bool {
        self.name.ends_with("/tf_static") && self.type_name == "tf2_msgs/msg/TFMessage"
    }
}

/// The name of a topic with its leading slash, which writers other than rosbag2 leave out.
pub(crate) fn absolute_name(name: &str) -> String {
    match name {
        "" => String::new(),
        name if name.starts_with('/') => name.to_owned(),
        name => format!("/{name}"),
    }
}

/// A message of a bag.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BagMessage {
    /// Index into the reader's topics.
    pub topic: usize,
    /// Time of its recording, ns since the Unix epoch.
    pub log_time_ns: i64,
    /// CDR with encapsulation header.
    pub data: Vec<u8>,
}
