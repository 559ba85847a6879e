//! MCAP writer with the profile "ros2".

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufWriter, IntoInnerError},
};

use mcap::{
    WriteOptions, Writer,
    records::{MessageHeader, Metadata as MetadataRecord},
};

use super::{Sink, SinkError};
use crate::{TopicInfo, storage::definition_encoding};

pub(super) struct McapSink {
    writer: Writer<BufWriter<File>>,
    /// Channel and next sequence number by topic.
    channels: Vec<(u16, u32)>,
}

impl McapSink {
    pub(super) fn create(file: File) -> Result<McapSink, SinkError> {
        let writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("lattice ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            // Chunks are written as a whole: a killed process leaves no truncated one.
            .disable_seeking(true)
            .create(BufWriter::new(file))?;
        Ok(McapSink {
            writer,
            channels: Vec::new(),
        })
    }
}

impl Sink for McapSink {
    fn add_topic(&mut self, topic: &TopicInfo, qos: &str) -> Result<(), SinkError> {
        let text = topic.definition.as_deref().unwrap_or_default();
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_owned(), qos.to_owned()),
            ("topic_type_hash".to_owned(), topic.type_hash.clone()),
        ]);
        let encoding = definition_encoding(text);
        let writer = &mut self.writer;
        let schema = writer.add_schema(&topic.type_name, encoding, text.as_bytes())?;
        let channel = writer.add_channel(schema, &topic.name, "cdr", &metadata)?;
        self.channels.push((channel, 0));
        Ok(())
    }

    fn write(&mut self, topic: usize, log_time_ns: i64, data: &[u8]) -> Result<(), SinkError> {
        let channel = self.channels.get_mut(topic);
        let (channel_id, sequence) = channel.ok_or("the topic was not added")?;
        let log_time = u64::try_from(log_time_ns)?;
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time,
            publish_time: log_time,
        };
        *sequence = sequence.wrapping_add(1);
        Ok(self.writer.write_to_known_channel(&header, data)?)
    }

    fn flush(&mut self) -> Result<(), SinkError> {
        Ok(self.writer.flush()?)
    }

    fn finish(mut self: Box<Self>, metadata: &str) -> Result<(), SinkError> {
        let record = MetadataRecord {
            name: "rosbag2".into(),
            metadata: BTreeMap::from([("serialized_metadata".into(), metadata.into())]),
        };
        self.writer.write_metadata(&record)?;
        self.writer.finish()?;
        let file = self.writer.into_inner().into_inner();
        Ok(file.map_err(IntoInnerError::into_error)?.sync_all()?)
    }
}
