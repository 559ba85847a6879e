//! Topics and messages of a bag.

use super::BagQos;

/// Largest accepted message, bytes.
pub(crate) const MAX_MESSAGE_BYTES: u64 = 1 << 30;

/// Static transform messages kept for late joiners: the depth of tf2's listeners.
pub const STATIC_DEPTH: u64 = 100;

/// Storage formats of rosbag2.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Storage {
    /// MCAP files.
    Mcap,
    /// SQLite databases.
    Sqlite3,
}

impl Storage {
    /// Name of the storage plugin in `metadata.yaml`.
    pub fn identifier(self) -> &'static str {
        match self {
            Storage::Mcap => "mcap",
            Storage::Sqlite3 => "sqlite3",
        }
    }

    /// Extension of its files.
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
    /// Topic name with a leading slash, such as "/tf", even if the bag lacks the slash.
    pub name: String,
    /// Type, such as "sensor_msgs/msg/PointCloud2"; empty if missing in the bag.
    pub type_name: String,
    /// Type hash, such as "RIHS01_..."; empty if missing in the bag.
    pub type_hash: String,
    /// Serialization format; "cdr" for ROS 2.
    pub serialization_format: String,
    /// QoS offered by each recorded publisher; empty if missing in the bag.
    pub offered_qos: Vec<BagQos>,
    /// Embedded message definition (ros2msg or ros2idl text).
    pub definition: Option<String>,
    /// Number of messages by the bag's index.
    pub message_count: u64,
    /// Stored bytes of its messages; `None` if the index lacks them, as in MCAP.
    pub message_bytes: Option<u64>,
}

impl TopicInfo {
    /// True for a topic with latched messages.
    pub fn is_latched(&self) -> bool {
        self.has_static_transforms() || self.offered_qos.iter().any(|qos| qos.latched)
    }

    /// True for `/tf_static` in any namespace. Its messages are latched and valid at all times, regardless of the recorded
    /// QoS: metadata up to version 3 has none, and converters write the default.
    pub fn has_static_transforms(&self) -> bool {
        self.name.ends_with("/tf_static") && self.type_name == "tf2_msgs/msg/TFMessage"
    }
}

/// Topic name with a leading slash, which some writers omit.
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
    /// Time of recording, ns since the Unix epoch.
    pub log_time_ns: i64,
    /// CDR with encapsulation header.
    pub data: Vec<u8>,
}
