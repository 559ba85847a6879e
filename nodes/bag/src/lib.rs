//! Reading, writing and playing of rosbag2 bags.
#![forbid(unsafe_code)]

mod error;
mod mcap_storage;
mod messages;
mod metadata;
mod player;
mod qos;
mod reader;
mod recover;
mod sniff;
mod split;
mod split_list;
mod sqlite_storage;
mod storage;
#[cfg(test)]
mod tests;
mod topic;
mod writer;
mod yaml;
mod zstd_files;

pub use error::BagError;
pub use messages::Messages;
pub use player::{PlayedTopic, Player, PlayerOptions, Step};
pub use qos::BagQos;
pub use reader::{BagReader, ReadOptions};
pub use recover::{Recovered, Unchecked, recover};
use topic::MAX_MESSAGE_BYTES;
pub use topic::{BagMessage, STATIC_DEPTH, Storage, TopicInfo};
pub use writer::{BagWriter, Compression, TopicSpec, WriterOptions, replaceable};
