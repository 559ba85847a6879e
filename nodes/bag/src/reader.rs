//! Reader of rosbag2 directories and bare storage files.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    BagError, Messages, TopicInfo,
    messages::MessageCompression,
    metadata::{CompressionMode, Metadata},
    split::Split,
    storage::full_type_name,
};

/// More storage files than this are refused.
const MAX_FILES: usize = 100_000;

/// Selection of messages by topic and time; the default is all.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Names of topics; all where nothing.
    pub topics: Option<Vec<String>>,
    /// The first log time wanted, ns since the Unix epoch.
    pub start_ns: Option<i64>,
    /// The first log time no longer wanted, ns since the Unix epoch.
    pub end_ns: Option<i64>,
}

/// A bag opened for reading. Cheap to clone.
#[derive(Clone)]
pub struct BagReader {
    path: PathBuf,
    topics: Arc<[TopicInfo]>,
    message_count: u64,
    range_ns: Option<(i64, i64)>,
    splits: Arc<[Split]>,
    compression: MessageCompression,
}

impl BagReader {
    /// Opens a rosbag2 directory, with or without `metadata.yaml`, or a bare storage file.
    ///
    /// A damaged bag opens, with a warning, if anything of it can be read.
    pub fn open(path: &Path) -> Result<BagReader, BagError> {
        let examined = fs::metadata(path).map_err(BagError::io(path, "open"))?;
        if !examined.is_dir() {
            return Self::assemble(path, None, vec![Split::new(path.to_path_buf(), false)?]);
        }
        let metadata_path = path.join("metadata.yaml");
        if !metadata_path.exists() {
            let splits = list_storage_files(path)?
                .into_iter()
                .map(|file| Split::new(file, false));
            return Self::assemble(path, None, splits.collect::<Result<_, _>>()?);
        }
        let metadata = Metadata::read(&metadata_path)?;
        if !matches!(metadata.storage_identifier.as_str(), "mcap" | "sqlite3") {
            return Err(BagError::Unsupported {
                path: metadata_path,
                what: format!("storage plugin {:?}", metadata.storage_identifier),
                remedy: "mcap and sqlite3 are known; convert with `ros2 bag convert`",
            });
        }
        let mut splits = Vec::new();
        for (entry, file) in metadata.storage_paths(path, &metadata_path)? {
            // Some versions of rosbag2 list compressed files by their names before compression.
            let packed = PathBuf::from(format!("{}.zstd", file.display()));
            let file = if !file.exists() && packed.exists() {
                packed
            } else {
                file
            };
            // The first one is opened at once for the message definitions.
            let mut split = Split::new(file, !splits.is_empty())?;
            if split.open.is_none()
                && let Some(listed) = metadata.files.iter().find(|file| file.path == entry)
            {
                split.range_ns = listed.range_ns();
                split.message_count = Some(listed.message_count);
            }
            splits.push(split);
        }
        Self::assemble(path, Some(metadata), splits)
    }

    /// The topics; messages refer to them by index.
    pub fn topics(&self) -> &[TopicInfo] {
        &self.topics
    }

    /// The first log time, ns since the Unix epoch; nothing without messages.
    pub fn start_ns(&self) -> Option<i64> {
        self.range_ns.map(|(start_ns, _)| start_ns)
    }

    /// The last log time, ns since the Unix epoch; nothing without messages.
    pub fn end_ns(&self) -> Option<i64> {
        self.range_ns.map(|(_, end_ns)| end_ns)
    }

    /// Number of messages, by the bag's index.
    pub fn message_count(&self) -> u64 {
        self.message_count
    }

    /// The wanted messages in order of log time across all files, with bounded memory.
    ///
    /// A damaged bag yields what precedes the damage, then the error. Unknown topics are an error.
    pub fn messages(&self, options: &ReadOptions) -> Result<Messages, BagError> {
        let wanted = match &options.topics {
            None => vec![true; self.topics.len()],
            Some(names) => self.select(names)?,
        };
        Ok(Messages::new(
            self.splits.clone(),
            self.topics.clone(),
            wanted,
            options.start_ns.unwrap_or(i64::MIN),
            options.end_ns,
            self.compression,
        ))
    }

    fn select(&self, names: &[String]) -> Result<Vec<bool>, BagError> {
        if let Some(unknown) = names
            .iter()
            .find(|name| !self.topics.iter().any(|t| t.name == **name))
        {
            let known: Vec<&str> = self.topics.iter().map(|t| t.name.as_str()).collect();
            return Err(BagError::Invalid {
                name: "topics",
                reason: format!(
                    "{unknown} is not in {}, which has {}",
                    self.path.display(),
                    known.join(", ")
                ),
            });
        }
        Ok(self
            .topics
            .iter()
            .map(|topic| names.contains(&topic.name))
            .collect())
    }

    fn assemble(
        path: &Path,
        metadata: Option<Metadata>,
        mut splits: Vec<Split>,
    ) -> Result<BagReader, BagError> {
        // Files of unknown time keep their place behind the one before.
        let mut place_ns = i64::MIN;
        let mut keyed: Vec<(i64, Split)> = Vec::with_capacity(splits.len());
        for split in splits.drain(..) {
            place_ns = split.range_ns.map_or(place_ns, |(start_ns, _)| start_ns);
            keyed.push((place_ns, split));
        }
        keyed.sort_by_key(|(place_ns, _)| *place_ns);
        let splits: Vec<Split> = keyed.into_iter().map(|(_, split)| split).collect();

        let infos = || {
            splits
                .iter()
                .filter_map(|s| s.open.as_ref())
                .map(|open| open.info())
        };
        let compression = match &metadata {
            None => MessageCompression::Detect,
            Some(metadata) => match metadata.compression(path)? {
                CompressionMode::Message => MessageCompression::Zstd,
                _ => MessageCompression::None,
            },
        };
        let mut topics = listed_topics(metadata.as_ref());
        let counted = metadata.is_none();
        for info in infos() {
            info.topics
                .iter()
                .for_each(|topic| merge_topic(&mut topics, topic, counted));
        }
        for damage in splits.iter().filter_map(Split::damage) {
            log::warn!("{damage}");
        }
        let all_open = splits.iter().all(|split| split.open.is_some());
        let listed = metadata
            .as_ref()
            .filter(|m| m.message_count > 0)
            .and_then(|m| {
                let start_ns = m.starting_time.nanoseconds_since_epoch;
                Some((
                    start_ns,
                    start_ns.checked_add(m.duration.nanoseconds.max(0))?,
                ))
            });
        let seen = splits
            .iter()
            .filter_map(|split| split.range_ns)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let count = splits
            .iter()
            .filter_map(|split| split.message_count)
            .fold(0, u64::saturating_add);
        Ok(BagReader {
            path: path.to_path_buf(),
            message_count: match &metadata {
                Some(m) if !all_open => m.message_count,
                _ => count,
            },
            range_ns: if all_open { seen } else { listed.or(seen) },
            topics: topics.into(),
            splits: splits.into(),
            compression,
        })
    }
}

/// The topics of `metadata.yaml`.
fn listed_topics(metadata: Option<&Metadata>) -> Vec<TopicInfo> {
    let listed = metadata
        .map(|m| m.topics_with_message_count.as_slice())
        .unwrap_or_default();
    let topic = |counted: &super::metadata::CountedTopic| {
        let topic = counted.topic_metadata.clone();
        TopicInfo {
            name: topic.name,
            type_name: full_type_name(&topic.type_name),
            serialization_format: topic.serialization_format,
            offered_qos: topic.offered_qos_profiles,
            definition: None,
            message_count: counted.message_count,
        }
    };
    listed.iter().map(topic).collect()
}

/// Completes a topic from a storage file; counts only where there is no `metadata.yaml`.
fn merge_topic(topics: &mut Vec<TopicInfo>, topic: &TopicInfo, counted: bool) {
    let Some(known) = topics
        .iter_mut()
        .find(|t| t.is_same(&topic.name, &topic.type_name))
    else {
        topics.push(topic.clone());
        return;
    };
    if known.type_name.is_empty() {
        known.type_name.clone_from(&topic.type_name);
    }
    if known.offered_qos.is_empty() {
        known.offered_qos.clone_from(&topic.offered_qos);
    }
    known.definition = known.definition.take().or_else(|| topic.definition.clone());
    if counted {
        known.message_count = known.message_count.saturating_add(topic.message_count);
    }
}

/// The storage files of a bag without `metadata.yaml`, in the order of their numbers.
fn list_storage_files(folder: &Path) -> Result<Vec<PathBuf>, BagError> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(BagError::io(folder, "list"))? {
        let path = entry.map_err(BagError::io(folder, "list"))?.path();
        let name = path
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let bare = name.strip_suffix(".zstd").unwrap_or(&name);
        if bare.ends_with(".mcap") || bare.ends_with(".db3") {
            files.push(path);
        }
        if files.len() > MAX_FILES {
            return Err(BagError::Unsupported {
                path: folder.to_path_buf(),
                what: format!("a bag of more than {MAX_FILES} files"),
                remedy: "open the files one by one",
            });
        }
    }
    if files.is_empty() {
        return Err(BagError::Foreign {
            path: folder.to_path_buf(),
            found: "a folder without metadata.yaml, .mcap or .db3 files".into(),
            remedy: "give the folder that `ros2 bag record` made",
        });
    }
    files.sort_by_key(|path| (path.as_os_str().len(), path.clone()));
    Ok(files)
}
