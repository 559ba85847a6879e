//! Reading, writing and playing of rosbag2 bags; reading of ROS 1 bags.
//!
//! | to | begin with |
//! |---|---|
//! | read topics and messages | [`BagReader::open`], [`BagReader::messages`] |
//! | write a bag | [`BagWriter::create`] |
//! | play a bag at its times | [`Player`], a state machine without a clock |
//! | copy what a damaged bag still has | [`recover`] |
//! | write a bag of ROS 1 as one of ROS 2 | [`convert`] |
//!
//! Messages of ROS 1 (`.bag`, and MCAP of profile `ros1`) are converted to those of ROS 2 by the definitions in the file.
//! Messages are CDR bytes with their encapsulation header. `examples/1_write_and_read_a_bag.rs` does both.
#![forbid(unsafe_code)]

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod convert;
mod error;
mod mcap_storage;
mod messages;
mod metadata;
mod player;
mod qos;
mod reader;
mod recover;
mod ros1;
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

pub use convert::{Converted, convert};
pub use error::BagError;
pub use messages::Messages;
pub use player::{PlayedTopic, Player, PlayerOptions, Step};
pub use qos::BagQos;
pub use reader::{BagReader, ReadOptions};
pub use recover::{Recovered, Unchecked, recover};
use topic::MAX_MESSAGE_BYTES;
pub use topic::{BagMessage, STATIC_DEPTH, Storage, TopicInfo};
pub use writer::{BagWriter, Compression, TopicSpec, WriterOptions, replaceable};
