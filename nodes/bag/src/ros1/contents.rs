//! Index of a ROS 1 bag: connections, blocks of messages and counts.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

use super::record::{Fields, Record};
use super::transcode::Transcoder;
use super::{definition::ros2_name, record::op};
use crate::storage::{StorageInfo, TopicIndex, merge_topic};
use crate::topic::absolute_name;
use crate::{BagError, BagQos, STATIC_DEPTH, TopicInfo};

/// Limit of connections.
const MAX_CONNECTIONS: usize = 100_000;

/// A publisher with its topic.
#[derive(Clone)]
pub(super) struct Connection {
    topic: TopicInfo,
    /// The reason if its messages cannot be converted.
    transcoder: Result<Arc<Transcoder>, String>,
}

/// Part of the file that is read as a whole: a chunk, or messages outside of chunks.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Offset of its first record, bytes.
    pub offset: u64,
    /// First byte behind it; of an indexed chunk that behind its first byte.
    pub end: u64,
    pub start_ns: i64,
    pub end_ns: i64,
    /// Number of messages by connection; by the index for an indexed chunk.
    pub counts: BTreeMap<u32, u64>,
    /// True if the counts and times are those of the index, and the chunk was not read.
    pub indexed: bool,
    /// True after a damage.
    pub behind: bool,
}

impl Connection {
    /// True if nothing in its record is obviously damaged.
    pub(super) fn is_plausible(&self) -> bool {
        let TopicInfo {
            name, type_name, ..
        } = &self.topic;
        let is_graphic = |text: &str| text.bytes().all(|b| b.is_ascii_graphic());
        self.transcoder.is_ok() && is_graphic(name) && type_name.split('/').count() == 3
    }
}

/// Connections, blocks and counts.
#[derive(Default)]
pub(super) struct Contents {
    pub connections: BTreeMap<u32, Connection>,
    pub blocks: Vec<Block>,
    pub counts: BTreeMap<u32, u64>,
    /// Damages in the order of the file, each with true if a block contains it.
    pub damages: Vec<(BagError, bool)>,
}

/// Topic and converter of each connection.
pub(super) type Routes = BTreeMap<u32, (usize, Option<Arc<Transcoder>>)>;

impl Contents {
    /// Number of messages.
    pub(super) fn messages(&self) -> u64 {
        self.counts.values().copied().fold(0, u64::saturating_add)
    }

    /// Adds a connection record; the error is a reason.
    pub(super) fn connection(&mut self, record: &Record<'_>) -> Result<(), String> {
        self.take(record.fields, record.data)
    }

    /// Adds a connection by its header and data; the error is a reason.
    pub(super) fn take(&mut self, fields: Fields<'_>, data: &[u8]) -> Result<(), String> {
        debug_assert_eq!(fields.op(), Some(op::CONNECTION));
        let id = fields.u32("conn").ok_or("a connection without number")?;
        let header = Fields::parse(data).ok_or("an invalid header of a connection")?;
        let name = fields.text("topic").filter(|name| !name.is_empty());
        let name = name.or_else(|| header.text("topic"));
        let name = absolute_name(&name.ok_or("a connection without topic")?);
        let type_name = header.text("type").unwrap_or_default();
        let ros2_type = ros2_name(&type_name);
        if let Some(known) = self.connections.get(&id) {
            let known = &known.topic;
            return match known.name == name && known.type_name == ros2_type {
                true => Ok(()),
                false => Err(format!(
                    "connection {id} is {} and again {name}",
                    known.name
                )),
            };
        }
        if self.connections.len() >= MAX_CONNECTIONS {
            return Err(format!("more than {MAX_CONNECTIONS} connections"));
        }
        let definition = header.get("message_definition");
        let definition = String::from_utf8_lossy(definition.unwrap_or_default());
        let is_latched = header.get("latching").is_some_and(is_true);
        let transcoder = match (definition.is_empty(), ros2_type.as_str()) {
            (true, name) if !name.ends_with("msg/Empty") => {
                Err("its message definition is missing".to_owned())
            }
            _ => Transcoder::new(&type_name, &definition).map(Arc::new),
        };
        let topic = topic(name, ros2_type, is_latched, transcoder.as_ref().ok());
        let connection = Connection { topic, transcoder };
        self.connections.insert(id, connection);
        Ok(())
    }

    /// Topics, and the topic and converter of each connection.
    pub(super) fn topics(&self, path: &Path) -> (StorageInfo, Routes) {
        let starts = self.blocks.iter().filter(|block| !block.counts.is_empty());
        let spans = starts.map(|block| (block.start_ns, block.end_ns));
        let mut info = StorageInfo {
            message_count: self.messages(),
            range_ns: spans.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))),
            damage: self.damages.first().map(|(damage, _)| damage.clone()),
            ..StorageInfo::default()
        };
        // A publisher without a definition has that of another one.
        let connections = self.connections.values();
        let by_type: HashMap<&str, &Arc<Transcoder>> = connections
            .filter_map(|c| Some((c.topic.type_name.as_str(), c.transcoder.as_ref().ok()?)))
            .collect();
        let (mut routes, mut places) = (Routes::new(), TopicIndex::default());
        for (id, connection) in &self.connections {
            let (known, transcoder) = (&connection.topic, &connection.transcoder);
            let other = by_type.get(known.type_name.as_str()).copied();
            let used = transcoder.as_ref().ok().or(other);
            if let (Err(reason), None) = (transcoder, used) {
                let (path, name) = (path.display(), &known.name);
                log::warn!("{path}: {name} cannot be converted to ROS 2: {reason}");
            }
            let (name, type_name) = (known.name.clone(), known.type_name.clone());
            let mut topic = topic(name, type_name, known.is_latched(), used);
            topic.message_count = self.counts.get(id).copied().unwrap_or(0);
            let index = merge_topic(&mut info.topics, &mut places, &topic, true);
            routes.insert(*id, (index, used.cloned()));
        }
        (info, routes)
    }
}

/// True for a flag of a connection's header that is set.
pub(crate) fn is_true(value: &[u8]) -> bool {
    matches!(value, b"1" | b"true" | b"True")
}

/// A topic of ROS 2 for one of ROS 1; without a converter its messages stay as they are.
pub(crate) fn topic(
    name: String,
    type_name: String,
    is_latched: bool,
    transcoder: Option<&Arc<Transcoder>>,
) -> TopicInfo {
    let is_static = name.ends_with("/tf_static");
    let qos = BagQos {
        // A latched publisher keeps one message, static broadcasters all transforms in it.
        depth: match (is_latched || is_static, is_static) {
            (_, true) => STATIC_DEPTH,
            (true, false) => 1,
            (false, false) => BagQos::default().depth,
        },
        latched: is_latched || is_static,
        ..BagQos::default()
    };
    TopicInfo {
        name,
        type_name,
        serialization_format: match transcoder {
            Some(_) => "cdr",
            None => "ros1",
        }
        .into(),
        offered_qos: vec![qos],
        definition: transcoder.map(|transcoder| transcoder.definition()),
        ..TopicInfo::default()
    }
}
