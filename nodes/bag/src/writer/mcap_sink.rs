//! Writes MCAP files of profile "ros2".

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufWriter},
    path::{Path, PathBuf},
};

use mcap::{
    McapError, WriteOptions, Writer,
    records::{MessageHeader, Metadata as MetadataRecord},
};

use crate::{BagError, TopicInfo, storage::definition_encoding};

pub(super) struct McapSink {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    /// Channel and next sequence number by topic.
    channels: Vec<(u16, u32)>,
}

impl McapSink {
    pub(super) fn create(path: &Path) -> Result<McapSink, BagError> {
        let file = File::create_new(path).map_err(BagError::io(path, "create"))?;
        let writer = WriteOptions::new()
            .profile("ros2")
            .library(concat!("lattice ", env!("CARGO_PKG_VERSION")))
            .compression(None)
            .create(BufWriter::new(file))
            .map_err(|e| failed(path, "write", e))?;
        Ok(McapSink {
            path: path.to_path_buf(),
            writer,
            channels: Vec::new(),
        })
    }

    pub(super) fn add_topic(&mut self, topic: &TopicInfo, qos: &str) -> Result<(), BagError> {
        let text = topic.definition.as_deref().unwrap_or_default();
        let encoding = definition_encoding(text);
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), qos.to_owned())]);
        let added = self
            .writer
            .add_schema(&topic.type_name, encoding, text.as_bytes())
            .and_then(|schema| {
                self.writer
                    .add_channel(schema, &topic.name, "cdr", &metadata)
            });
        self.channels.push((
            added.map_err(|e| failed(&self.path, "add a topic to", e))?,
            0,
        ));
        Ok(())
    }

    pub(super) fn write(
        &mut self,
        topic: usize,
        log_time_ns: i64,
        data: &[u8],
    ) -> Result<(), BagError> {
        let unknown = || BagError::Invalid {
            name: "topic",
            reason: format!("{topic} was not added"),
        };
        let (channel_id, sequence) = self.channels.get_mut(topic).ok_or_else(unknown)?;
        let log_time = u64::try_from(log_time_ns).unwrap_or(0);
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time,
            publish_time: log_time,
        };
        *sequence = sequence.wrapping_add(1);
        self.writer
            .write_to_known_channel(&header, data)
            .map_err(|e| failed(&self.path, "write", e))
    }

    pub(super) fn finish(mut self, metadata: &str) -> Result<(), BagError> {
        let record = MetadataRecord {
            name: "rosbag2".into(),
            metadata: BTreeMap::from([("serialized_metadata".into(), metadata.into())]),
        };
        let finished = self
            .writer
            .write_metadata(&record)
            .and_then(|()| self.writer.finish());
        finished.map_err(|e| failed(&self.path, "finish", e))?;
        let file = self.writer.into_inner().into_inner();
        let synced = file
            .map_err(io::IntoInnerError::into_error)
            .and_then(|file| file.sync_all());
        synced.map_err(BagError::io(&self.path, "finish"))
    }
}

fn failed(path: &Path, doing: &'static str, error: McapError) -> BagError {
    BagError::io(path, doing)(match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    })
}
