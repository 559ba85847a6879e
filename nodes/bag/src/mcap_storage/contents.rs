//! Index of an MCAP file: schemas, channels, message blocks and counts.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    sync::Arc,
};

use mcap::records::{Channel, Record};

use super::lengths::parse_record;
use crate::{
    BagError, TopicInfo, ros1,
    ros1::Transcoder,
    storage::{StorageInfo, TopicIndex, full_type_name, lenient_qos, merge_topic},
    topic::absolute_name,
};

/// Part of the file that is read as a whole: a chunk, or messages outside of chunks.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Offset of its first record, bytes.
    pub offset: u64,
    /// Length of all its records, bytes.
    pub len: u64,
    /// Opcode of its first record.
    pub opcode: u8,
    pub start_ns: u64,
    pub end_ns: u64,
    /// Channels inside, if known.
    pub channels: Option<Box<[u16]>>,
    /// True after a damage.
    pub behind: bool,
    /// True for messages recovered individually from a chunk with a wrong checksum, and for such a chunk if it is
    /// compressed: its damage is known.
    pub unchecked: bool,
}

/// Message encoding of ROS 1.
const ROS1: &str = "ros1";

/// Topic of each channel, and the converter of its messages if they are of ROS 1.
pub(super) type Routes = BTreeMap<u16, (usize, Option<Arc<Transcoder>>)>;

struct Schema {
    name: String,
    encoding: String,
    text: String,
}

/// Number of messages, with first and last log time.
#[derive(Clone, Copy, Default)]
pub(super) struct Seen {
    pub messages: u64,
    pub range_ns: Option<(u64, u64)>,
}

impl Seen {
    pub(super) fn one(log_time_ns: u64) -> Seen {
        Seen {
            messages: 1,
            range_ns: Some((log_time_ns, log_time_ns)),
        }
    }

    pub(super) fn add(&mut self, other: Seen) {
        self.messages = self.messages.saturating_add(other.messages);
        let ranges = [self.range_ns, other.range_ns].into_iter().flatten();
        self.range_ns = ranges.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    }
}

/// Schemas, channels, blocks and counts.
#[derive(Default)]
pub(super) struct Contents {
    schemas: BTreeMap<u16, Schema>,
    pub channels: BTreeMap<u16, Channel>,
    pub blocks: Vec<Block>,
    pub counts: BTreeMap<u16, u64>,
    pub seen: Seen,
    /// Damages in the order of the file.
    pub damages: Vec<BagError>,
}

impl Contents {
    /// Adds a schema or channel record; the error is a reason.
    pub(super) fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        match parse_record(opcode, body)? {
            Record::Schema { header, data } => {
                let text = String::from_utf8_lossy(&data).into_owned();
                let schema = Schema {
                    name: header.name,
                    encoding: header.encoding,
                    text,
                };
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => match self.channels.get(&channel.id) {
                Some(known)
                    if known.topic != channel.topic || known.schema_id != channel.schema_id =>
                {
                    return Err(format!(
                        "channel {} is {} and again {}",
                        channel.id, known.topic, channel.topic
                    ));
                }
                _ => {
                    self.channels.insert(channel.id, channel);
                }
            },
            _ => {}
        }
        Ok(())
    }

    /// True if every channel with messages is known, with its schema.
    pub(super) fn is_complete(&self) -> bool {
        let has_schema = |c: &Channel| c.schema_id == 0 || self.schemas.contains_key(&c.schema_id);
        self.channels.values().all(has_schema)
            && self
                .counts
                .iter()
                .all(|(id, count)| *count == 0 || self.channels.contains_key(id))
    }

    /// Topics, and the topic of each channel. A file without channels of ROS is rejected.
    pub(super) fn topics(
        &mut self,
        path: &Path,
        profile: &str,
    ) -> Result<(StorageInfo, Routes), BagError> {
        let is_ros = |channel: &Channel| ["cdr", ROS1].contains(&&*channel.message_encoding);
        if !self.channels.is_empty() && !self.channels.values().any(is_ros) {
            let encodings = self.channels.values().map(|c| c.message_encoding.as_str());
            let encodings = Vec::from_iter(encodings.collect::<BTreeSet<_>>());
            return Err(BagError::Foreign {
                path: path.to_path_buf(),
                found: format!(
                    "an MCAP file of {} messages (profile {profile:?})",
                    encodings.join(" and ")
                ),
                remedy: "convert it to CDR messages, as recorded by ROS 2",
            });
        }
        let mut info = StorageInfo {
            message_count: self.seen.messages,
            damage: self.damages.first().cloned(),
            ..StorageInfo::default()
        };
        let (mut topic_of, mut places) = (BTreeMap::new(), TopicIndex::default());
        for (id, channel) in &self.channels {
            let (topic, transcoder) = match channel.message_encoding == ROS1 {
                true => self.ros1_topic(*id, channel, path),
                false => (self.topic(*id, channel), None),
            };
            let index = merge_topic(&mut info.topics, &mut places, &topic, true);
            topic_of.insert(*id, (index, transcoder));
        }
        Ok((info, topic_of))
    }

    /// Topic of a channel of ROS 1, and the converter of its messages.
    fn ros1_topic(
        &self,
        id: u16,
        channel: &Channel,
        path: &Path,
    ) -> (TopicInfo, Option<Arc<Transcoder>>) {
        let schema = self.schemas.get(&channel.schema_id);
        let transcoder = match schema.filter(|schema| schema.encoding == "ros1msg") {
            Some(schema) => Transcoder::new(&schema.name, &schema.text).map(Arc::new),
            None => Err("it has no schema of encoding ros1msg".to_owned()),
        };
        if let Err(reason) = &transcoder {
            let (path, name) = (path.display(), &channel.topic);
            log::warn!("{path}: {name} cannot be converted to ROS 2: {reason}");
        }
        let latching = channel.metadata.get("latching");
        let is_latched = latching.is_some_and(|value| ros1::is_true(value.as_bytes()));
        let transcoder = transcoder.ok();
        let type_name = schema.map(|schema| ros1::ros2_name(&schema.name));
        let topic = ros1::topic(
            absolute_name(&channel.topic),
            type_name.unwrap_or_default(),
            is_latched,
            transcoder.as_ref(),
        );
        let message_count = self.counts.get(&id).copied().unwrap_or(0);
        let topic = TopicInfo {
            message_count,
            ..topic
        };
        (topic, transcoder)
    }

    fn topic(&self, id: u16, channel: &Channel) -> TopicInfo {
        let schema = self.schemas.get(&channel.schema_id);
        let is_text = |s: &&Schema| matches!(s.encoding.as_str(), "ros2msg" | "ros2idl" | "omgidl");
        let qos = channel.metadata.get("offered_qos_profiles");
        let hash = channel.metadata.get("topic_type_hash");
        TopicInfo {
            name: absolute_name(&channel.topic),
            type_name: schema.map(|s| full_type_name(&s.name)).unwrap_or_default(),
            type_hash: hash.cloned().unwrap_or_default(),
            serialization_format: channel.message_encoding.clone(),
            offered_qos: qos
                .map(|text| lenient_qos(&channel.topic, text))
                .unwrap_or_default(),
            definition: schema
                .filter(is_text)
                .map(|s| s.text.clone())
                .filter(|text| !text.is_empty()),
            message_count: self.counts.get(&id).copied().unwrap_or(0),
            message_bytes: None,
        }
    }
}
