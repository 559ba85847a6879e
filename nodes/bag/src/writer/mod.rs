//! Writer of rosbag2 directories: metadata version 9, message definitions embedded.

mod mcap_sink;
mod sqlite_sink;

use std::{
    collections::HashSet,
    error::Error,
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use super::{
    BagError, BagQos, MAX_MESSAGE_BYTES, Storage, TopicInfo,
    metadata::{
        CountedTopic, EMPTY_START_NS, FileInformation, METADATA_VERSION, Metadata, Nanoseconds,
        StartingTime, TopicMetadata,
    },
    split_list::{is_storage, list},
};
use mcap::McapError;
use mcap_sink::McapSink;
use sqlite_sink::SqliteSink;

/// Name of the distribution in the metadata.
const ROS_DISTRO: &str = "lattice";
/// Bytes of the CDR encapsulation header.
const ENCAPSULATION_BYTES: usize = 4;

/// Options of writing a bag.
#[derive(Clone, Copy, Debug, Default)]
pub struct WriterOptions {
    /// Replaces a bag at the same path.
    pub overwrite: bool,
}

/// A topic to write.
#[derive(Clone, Debug, Default)]
pub struct TopicSpec {
    /// The topic's full name, such as "/tf".
    pub name: String,
    /// The type, such as "tf2_msgs/msg/TFMessage".
    pub type_name: String,
    /// Hash of the type, such as "RIHS01_..."; empty where it is unknown.
    pub type_hash: String,
    /// The message definition with all it depends on (ros2msg or ros2idl text).
    pub definition: Option<String>,
    /// QoS of the publishers.
    pub offered_qos: Vec<BagQos>,
}

type SinkError = Box<dyn Error + Send + Sync>;

/// A storage file being written; topics count from 0 in the order they are added.
trait Sink: Send {
    fn add_topic(&mut self, topic: &TopicInfo, qos: &str) -> Result<(), SinkError>;
    fn write(&mut self, topic: usize, log_time_ns: i64, data: &[u8]) -> Result<(), SinkError>;
    fn finish(self: Box<Self>, metadata: &str) -> Result<(), SinkError>;
}

fn failed(path: &Path, doing: &'static str) -> impl FnOnce(SinkError) -> BagError {
    // The system's own error tells of a full disk.
    let system = |error: SinkError| match error.downcast().map(|error| *error) {
        Ok(McapError::Io(error)) => error,
        Ok(other) => io::Error::other(other),
        Err(error) => io::Error::other(error),
    };
    move |error| BagError::io(path, doing)(system(error))
}

/// A bag being written. Without [`BagWriter::finish`] it lacks `metadata.yaml`.
pub struct BagWriter {
    folder: PathBuf,
    file: PathBuf,
    storage: Storage,
    sink: Box<dyn Sink>,
    topics: Vec<TopicInfo>,
    names: HashSet<String>,
    message_count: u64,
    range_ns: Option<(i64, i64)>,
}

impl BagWriter {
    /// Makes the folder `path` and the storage file in it.
    pub fn create(
        path: &Path,
        storage: Storage,
        options: WriterOptions,
    ) -> Result<BagWriter, BagError> {
        let name = path.file_name().ok_or_else(|| {
            let reason = format!("{} does not end in the name of a folder", path.display());
            BagError::invalid("path", reason)
        })?;
        make_way(path, options.overwrite)?;
        fs::create_dir_all(path).map_err(BagError::io(path, "create"))?;
        let file = path.join(format!(
            "{}_0.{}",
            name.to_string_lossy(),
            storage.extension()
        ));
        let created = File::create_new(&file).map_err(BagError::io(&file, "create"))?;
        let sink: Result<Box<dyn Sink>, SinkError> = match storage {
            Storage::Mcap => McapSink::create(created).map(|sink| Box::new(sink) as _),
            Storage::Sqlite3 => {
                // Closing it later would drop the locks that SQLite takes on the file.
                drop(created);
                SqliteSink::create(&file).map(|sink| Box::new(sink) as _)
            }
        };
        let sink = sink.map_err(failed(&file, "create"))?;
        Ok(BagWriter {
            folder: path.to_path_buf(),
            file,
            storage,
            sink,
            topics: Vec::new(),
            names: HashSet::new(),
            message_count: 0,
            range_ns: None,
        })
    }

    /// Announces a topic; the result is what [`BagWriter::write`] takes.
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
            return wrong(format!("{} was added before", topic.name));
        }
        let info = TopicInfo {
            name: topic.name,
            type_name: topic.type_name,
            type_hash: topic.type_hash,
            serialization_format: "cdr".into(),
            offered_qos: topic.offered_qos,
            definition: topic.definition,
            message_count: 0,
        };
        let qos =
            BagQos::to_text(&info.offered_qos).map_err(|e| BagError::invalid("offered_qos", e))?;
        let added = self.sink.add_topic(&info, &qos);
        added.map_err(failed(&self.file, "add a topic to"))?;
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
                format!("{log_time_ns} is before 1970, which bags cannot hold"),
            );
        }
        let size = cdr.len();
        if size < ENCAPSULATION_BYTES || size as u64 > MAX_MESSAGE_BYTES {
            return wrong(
                "message",
                format!(
                    "{size} bytes on {}; 4 to {MAX_MESSAGE_BYTES} are accepted",
                    info.name
                ),
            );
        }
        let written = self.sink.write(topic, log_time_ns, cdr);
        written.map_err(failed(&self.file, "write"))?;
        info.message_count += 1;
        self.message_count += 1;
        let (first_ns, last_ns) = self.range_ns.unwrap_or((log_time_ns, log_time_ns));
        self.range_ns = Some((first_ns.min(log_time_ns), last_ns.max(log_time_ns)));
        Ok(())
    }

    /// Completes the storage file and writes `metadata.yaml`.
    pub fn finish(self) -> Result<(), BagError> {
        let metadata = self.metadata();
        let unfit = |e: serde_yaml::Error| BagError::invalid("metadata", e);
        let embedded = metadata.to_embedded_text().map_err(unfit)?;
        let text = metadata.to_text().map_err(unfit)?;
        let finished = self.sink.finish(&embedded);
        finished.map_err(failed(&self.file, "finish"))?;
        // The messages first, then whole metadata: a crash leaves neither without the other.
        let path = self.folder.join("metadata.yaml");
        let write = || -> io::Result<()> {
            File::open(&self.file)?.sync_all()?;
            let mut unfinished = tempfile::NamedTempFile::new_in(&self.folder)?;
            unfinished.write_all(text.as_bytes())?;
            unfinished.as_file().sync_all()?;
            let readable = fs::metadata(&self.file)?.permissions();
            unfinished.as_file().set_permissions(readable)?;
            unfinished
                .persist(&path)
                .map(drop)
                .map_err(|error| error.error)
        };
        write().map_err(BagError::io(&path, "write"))
    }

    fn metadata(&self) -> Metadata {
        let file_name = self.file.file_name().unwrap_or_default();
        let name = file_name.to_string_lossy().into_owned();
        let (first_ns, last_ns) = self.range_ns.unwrap_or((EMPTY_START_NS, EMPTY_START_NS));
        let starting_time = StartingTime {
            nanoseconds_since_epoch: first_ns,
        };
        let duration = Nanoseconds {
            nanoseconds: last_ns.saturating_sub(first_ns),
        };
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
            message_count: self.message_count,
            topics_with_message_count: self.topics.iter().map(counted).collect(),
            relative_file_paths: vec![name.clone()],
            files: vec![FileInformation {
                path: name,
                starting_time,
                duration,
                message_count: self.message_count,
            }],
            ros_distro: ROS_DISTRO,
            ..Metadata::default()
        }
    }
}

/// Removes a bag at `path` if that is wanted; anything else there is kept and refused.
fn make_way(path: &Path, overwrite: bool) -> Result<(), BagError> {
    let refuse = |why: String, or_overwrite| {
        Err(BagError::Exists {
            path: path.to_path_buf(),
            why,
            or_overwrite,
        })
    };
    if !path.exists() {
        return Ok(());
    }
    if !path.is_dir() {
        return refuse(" and is not a folder".into(), "");
    }
    let endings = [".db3-wal", ".db3-shm", ".db3-journal"];
    let is_ours = |name: &str| {
        name == "metadata.yaml"
            || is_storage(name)
            || endings.iter().any(|ending| name.ends_with(ending))
    };
    let mut files = Vec::new();
    for entry in list(path)? {
        let (file, name) = entry?;
        if !is_ours(&name) || file.is_dir() {
            let why = format!(" and holds {name:?}, which is no part of a bag");
            return refuse(why, "");
        }
        files.push(file);
    }
    if !files.is_empty() && !overwrite {
        return refuse(String::new(), " or allow to overwrite");
    }
    files
        .iter()
        .try_for_each(|file| fs::remove_file(file).map_err(BagError::io(file, "remove")))
}

#[cfg(test)]
mod tests {
    use super::*;

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
