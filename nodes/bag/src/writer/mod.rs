//! Writer of rosbag2 directories: metadata version 9, message definitions embedded.

mod mcap_sink;
mod parts;
mod place;
mod sink;
mod sqlite_sink;

use std::{
    collections::HashSet,
    fs,
    io::{self, Write},
    path::{Path, PathBuf},
};

use super::{
    BagError, BagQos, MAX_MESSAGE_BYTES, Storage, TopicInfo,
    metadata::{CountedTopic, FileInformation, METADATA_VERSION, Metadata, TopicMetadata},
};
use parts::{Part, Written, ZSTD_LEVEL, described};
use place::make_way;
pub use place::replaceable;
pub use sink::{Compression, TopicSpec};
use sink::{ENCAPSULATION_BYTES, ROS_DISTRO, Sink, SinkError, failed};

/// Options of a bag writer.
#[derive(Clone, Copy, Debug, Default)]
pub struct WriterOptions {
    /// True to replace a bag at the same path.
    pub overwrite: bool,
    /// Message bytes after which a new storage file begins; `None`: no limit.
    pub max_file_bytes: Option<u64>,
    /// Time span of messages after which a new storage file begins, ns; `None`: no limit.
    pub max_file_ns: Option<i64>,
    /// Compression with zstd.
    pub compression: Compression,
}

/// A bag being written. Without [`BagWriter::finish`] it lacks `metadata.yaml`.
///
/// ```
/// use lattice_bag::{BagReader, BagWriter, Storage, TopicSpec, WriterOptions};
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("bag");
/// let mut writer = BagWriter::create(&path, Storage::Mcap, WriterOptions::default())?;
/// let topic = writer.add_topic(TopicSpec {
///     name: "/on".into(),
///     type_name: "std_msgs/msg/Bool".into(),
///     ..TopicSpec::default()
/// })?;
/// writer.write(topic, 1_000, &[0, 1, 0, 0, 1])?;
/// writer.finish()?;
/// assert_eq!(BagReader::open(&path)?.message_count(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct BagWriter {
    folder: PathBuf,
    storage: Storage,
    options: WriterOptions,
    part: Part,
    /// Complete storage files.
    finished: Vec<FileInformation>,
    topics: Vec<TopicInfo>,
    names: HashSet<String>,
    written: Written,
}

impl BagWriter {
    /// Creates the folder `path` and its first storage file.
    pub fn create(
        path: &Path,
        storage: Storage,
        options: WriterOptions,
    ) -> Result<BagWriter, BagError> {
        path.file_name().ok_or_else(|| {
            let reason = format!("{} does not end in the name of a folder", path.display());
            BagError::invalid("path", reason)
        })?;
        make_way(path, options.overwrite)?;
        fs::create_dir_all(path).map_err(BagError::io(path, "create"))?;
        Ok(BagWriter {
            folder: path.to_path_buf(),
            part: Part::create(path, storage, 0)?,
            storage,
            options,
            finished: Vec::new(),
            topics: Vec::new(),
            names: HashSet::new(),
            written: Written::default(),
        })
    }

    /// Adds a topic; the result is the argument of [`BagWriter::write`].
    pub fn add_topic(&mut self, topic: TopicSpec) -> Result<usize, BagError> {
        let wrong = |reason: String| Err(BagError::invalid("topic", reason));
        if !topic.name.starts_with('/') || topic.name.len() < 2 {
            return wrong(format!(
                "{:?} is not a full topic name; it starts with '/'",
                topic.name
            ));
        }
        let parts: Vec<&str> = topic.type_name.split('/').collect();
        if parts.len() != 3 || parts.iter().any(|part| part.is_empty()) {
            return wrong(format!(
                "{:?} is not a type like std_msgs/msg/String",
                topic.type_name
            ));
        }
        if self.names.contains(&topic.name) {
            return wrong(format!("{} is added twice", topic.name));
        }
        let info = TopicInfo {
            name: topic.name,
            type_name: topic.type_name,
            type_hash: topic.type_hash,
            serialization_format: "cdr".into(),
            offered_qos: topic.offered_qos,
            definition: topic.definition,
            message_count: 0,
            message_bytes: None,
        };
        announce(&mut self.part, &info)?;
        self.names.insert(info.name.clone());
        self.topics.push(info);
        Ok(self.topics.len() - 1)
    }

    /// Writes a message: CDR with encapsulation header. Times need not be in order.
    pub fn write(&mut self, topic: usize, log_time_ns: i64, cdr: &[u8]) -> Result<(), BagError> {
        let wrong = |name, reason: String| Err(BagError::invalid(name, reason));
        let Some(info) = self.topics.get_mut(topic) else {
            return wrong(
                "topic",
                format!("{topic} was not added; {} topics were", self.topics.len()),
            );
        };
        if log_time_ns < 0 {
            return wrong(
                "log_time_ns",
                format!("{log_time_ns} is before 1970, which bags do not support"),
            );
        }
        let size = cdr.len();
        if size < ENCAPSULATION_BYTES || size as u64 > MAX_MESSAGE_BYTES {
            return wrong(
                "message",
                format!(
                    "{size} bytes on {} is outside 4..={MAX_MESSAGE_BYTES}",
                    info.name
                ),
            );
        }
        info.message_count += 1;
        if self.is_full(log_time_ns) {
            self.split()?;
        }
        let written = match self.options.compression {
            Compression::Messages => zstd::encode_all(cdr, ZSTD_LEVEL)
                .map_err(Into::into)
                .and_then(|packed| self.part.sink.write(topic, log_time_ns, &packed)),
            _ => self.part.sink.write(topic, log_time_ns, cdr),
        };
        written.map_err(failed(&self.part.file, "write"))?;
        self.part.written.add(log_time_ns, size);
        self.written.add(log_time_ns, size);
        Ok(())
    }

    /// True if a message of this time belongs to the next storage file.
    fn is_full(&self, log_time_ns: i64) -> bool {
        let (options, part) = (&self.options, &self.part.written);
        let most_bytes = options.max_file_bytes.unwrap_or(u64::MAX);
        let most_ns = options.max_file_ns.unwrap_or(i64::MAX);
        part.messages > 0 && (part.bytes >= most_bytes || part.span_with(log_time_ns) > most_ns)
    }

    /// Completes the storage file and begins the next one.
    pub fn split(&mut self) -> Result<(), BagError> {
        let embedded = self.embedded()?;
        let mut next = Part::create(&self.folder, self.storage, self.finished.len() + 1)?;
        for topic in &self.topics {
            announce(&mut next, topic)?;
        }
        let full = std::mem::replace(&mut self.part, next);
        let described = full.finish(&embedded, self.options.compression)?;
        self.finished.push(described);
        Ok(())
    }

    /// Passes all data to the system: a killed process loses only later messages.
    pub fn flush(&mut self) -> Result<(), BagError> {
        let flushed = self.part.sink.flush();
        flushed.map_err(failed(&self.part.file, "write"))
    }

    fn embedded(&self) -> Result<String, BagError> {
        let text = self.metadata(&self.open_part()).to_embedded_text();
        text.map_err(|e| BagError::invalid("metadata", e))
    }

    fn open_part(&self) -> FileInformation {
        described(&self.part.file, &self.part.written)
    }

    /// Completes the storage file and writes `metadata.yaml`.
    pub fn finish(self) -> Result<(), BagError> {
        let embedded = self.embedded()?;
        let mut metadata = self.metadata(&self.open_part());
        // Messages first, then complete metadata: a crash leaves neither without the other.
        let last = self.part.finish(&embedded, self.options.compression)?;
        if let Some(path) = metadata.relative_file_paths.last_mut() {
            path.clone_from(&last.path);
        }
        if let Some(file) = metadata.files.last_mut() {
            *file = last;
        }
        let text = metadata.to_text();
        let text = text.map_err(|e| BagError::invalid("metadata", e))?;
        let path = self.folder.join("metadata.yaml");
        let storage = metadata
            .relative_file_paths
            .last()
            .map(|name| self.folder.join(name));
        let write = || -> io::Result<()> {
            let mut unfinished = tempfile::NamedTempFile::new_in(&self.folder)?;
            unfinished.write_all(text.as_bytes())?;
            unfinished.as_file().sync_all()?;
            let readable = fs::metadata(storage.unwrap_or_default())?.permissions();
            unfinished.as_file().set_permissions(readable)?;
            unfinished
                .persist(&path)
                .map(drop)
                .map_err(|error| error.error)
        };
        write().map_err(BagError::io(&path, "write"))
    }

    /// Metadata including the open storage file.
    fn metadata(&self, open: &FileInformation) -> Metadata {
        let (starting_time, duration) = self.written.times();
        let files: Vec<_> = self.finished.iter().chain([open]).cloned().collect();
        let counted = |topic: &TopicInfo| CountedTopic {
            topic_metadata: TopicMetadata {
                name: topic.name.clone(),
                type_name: topic.type_name.clone(),
                serialization_format: topic.serialization_format.clone(),
                offered_qos_profiles: topic.offered_qos.clone(),
                type_description_hash: topic.type_hash.clone(),
            },
            message_count: topic.message_count,
        };
        Metadata {
            version: METADATA_VERSION,
            storage_identifier: self.storage.identifier().into(),
            duration,
            starting_time,
            message_count: self.written.messages,
            topics_with_message_count: self.topics.iter().map(counted).collect(),
            compression_format: match self.options.compression {
                Compression::None => String::new(),
                _ => "zstd".into(),
            },
            compression_mode: match self.options.compression {
                Compression::None => "",
                Compression::Messages => "MESSAGE",
                Compression::Files => "FILE",
            }
            .into(),
            relative_file_paths: files.iter().map(|file| file.path.clone()).collect(),
            files,
            ros_distro: ROS_DISTRO.into(),
            ..Metadata::default()
        }
    }
}

/// Adds a topic to a storage file.
fn announce(part: &mut Part, topic: &TopicInfo) -> Result<(), BagError> {
    let qos = BagQos::to_text(&topic.offered_qos);
    let qos = qos.map_err(|e| BagError::invalid("offered_qos", e))?;
    let added = part.sink.add_topic(topic, &qos);
    added.map_err(failed(&part.file, "add a topic to"))
}

#[cfg(test)]
mod tests {
    use super::mcap_sink::McapSink;
    use super::*;
    use std::fs::File;

    #[test]
    fn a_full_disk_is_named() {
        let path = Path::new("/dev/full");
        let file = File::options().write(true).open(path).unwrap();
        let written = McapSink::create(file).and_then(|mut sink| {
            sink.add_topic(&TopicInfo::default(), "")?;
            sink.write(0, 0, &[0; 1 << 16])
        });
        let error = failed(path, "write")(written.unwrap_err()).to_string();
        assert!(error.contains("No space left on device"), "{error}");
    }
}
