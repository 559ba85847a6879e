//! What a bag holds: topics, messages, and its summary.

use std::{collections::BTreeMap, path::PathBuf};

use super::{BagError, BagQos};

/// Larger messages are refused, bytes.
pub const MAX_MESSAGE_BYTES: u64 = 1 << 30;

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
    /// The topic's name, such as "/tf".
    pub name: String,
    /// The type, such as "sensor_msgs/msg/PointCloud2"; empty where the bag does not tell.
    pub type_name: String,
    /// How messages are serialised; "cdr" for ROS 2.
    pub serialization_format: String,
    /// What each recorded publisher offered; empty where the bag does not tell.
    pub offered_qos: Vec<BagQos>,
    /// The type's hash ("RIHS01_..."), where the bag has it.
    pub type_hash: Option<String>,
    /// The message definition embedded in the bag (ros2msg or ros2idl text).
    pub definition: Option<String>,
    /// How many messages it has, as the bag's index says.
    pub message_count: u64,
}

impl TopicInfo {
    /// Whether the topic goes by this name and type; an empty type is any.
    pub(crate) fn is_same(&self, name: &str, type_name: &str) -> bool {
        self.name == name
            && (self.type_name == type_name || self.type_name.is_empty() || type_name.is_empty())
    }

    /// Whether late joiners expect the last messages of this topic.
    pub fn is_latched(&self) -> bool {
        match self.offered_qos.as_slice() {
            // Bags up to metadata version 3 do not tell, yet static transforms are always latched.
            [] => self.name.ends_with("/tf_static") && self.type_name == "tf2_msgs/msg/TFMessage",
            profiles => profiles.iter().any(BagQos::is_latched),
        }
    }
}

/// A message of a bag.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct BagMessage {
    /// Index into the reader's topics.
    pub topic: usize,
    /// When it was recorded, ns since the Unix epoch.
    pub log_time_ns: i64,
    /// CDR with encapsulation header.
    pub data: Vec<u8>,
}

/// One storage file of a bag.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FileSummary {
    /// Its path.
    pub path: PathBuf,
    /// First and last log time, ns since the Unix epoch; nothing where unknown or without messages.
    pub range_ns: Option<(i64, i64)>,
    /// How many messages it has; nothing where that is known only after decompression.
    pub message_count: Option<u64>,
}

/// What a bag holds as a whole.
#[derive(Clone, Debug)]
pub struct BagSummary {
    /// The folder, or the bare storage file.
    pub path: PathBuf,
    /// The storage plugin.
    pub storage: Storage,
    /// The version of `metadata.yaml`; nothing where there is none.
    pub metadata_version: Option<u32>,
    /// The distribution that recorded it, where known.
    pub ros_distro: String,
    /// Free key-value pairs.
    pub custom_data: BTreeMap<String, String>,
    /// The storage files in order of time.
    pub files: Vec<FileSummary>,
    /// The topics.
    pub topics: Vec<TopicInfo>,
    /// How many messages there are.
    pub message_count: u64,
    /// First and last log time, ns since the Unix epoch; nothing without messages.
    pub range_ns: Option<(i64, i64)>,
    /// What is wrong with the bag; what precedes the damage can be read.
    pub damage: Option<BagError>,
}
