//! Reader of rosbag2 directories, bare storage files and ROS 1 bags.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    BagError, Messages, Storage, TopicInfo,
    messages::MessageCompression,
    metadata::{CompressionMode, Metadata},
    sniff::is_sqlite,
    split::{OpenFile, Split},
    split_list::{in_order_of_time, listed_splits, splits_in},
    storage::{Filter, TopicIndex, full_type_name, merge_topic},
    topic::absolute_name,
};

/// Message selection by topic and time; all by default.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Topic names; `None`: all.
    pub topics: Option<Vec<String>>,
    /// Start of the log time range, inclusive, ns since the Unix epoch.
    pub start_ns: Option<i64>,
    /// End of the log time range, exclusive, ns since the Unix epoch.
    pub end_ns: Option<i64>,
    /// True to continue after damages, each of which is an error among the messages.
    pub past_damage: bool,
}

/// A bag opened for reading. Cheap to clone.
///
/// ```no_run
/// use lattice_bag::{BagReader, ReadOptions};
///
/// let bag = BagReader::open("my_bag".as_ref())?;
/// for message in bag.messages(&ReadOptions::default())? {
///     let message = message?;
///     println!("{}: {} bytes", bag.topics()[message.topic].name, message.data.len());
/// }
/// # Ok::<(), lattice_bag::BagError>(())
/// ```
#[derive(Clone)]
pub struct BagReader {
    path: PathBuf,
    topics: Arc<[TopicInfo]>,
    message_count: u64,
    miscounted: Option<u64>,
    range_ns: Option<(i64, i64)>,
    ros_distro: String,
    splits: Arc<[Split]>,
    compression: MessageCompression,
    /// True to end a truncated file without an error.
    past_cut: bool,
}

impl BagReader {
    /// Opens a rosbag2 directory, with or without `metadata.yaml`, a bare storage file, a ROS 1 bag or a directory of such.
    ///
    /// A damaged bag opens with a warning if any part of it is readable.
    pub fn open(path: &Path) -> Result<BagReader, BagError> {
        let examined = fs::metadata(path).map_err(BagError::io(path, "open"))?;
        if !examined.is_dir() {
            return Self::assemble(path, None, vec![Split::new(path.to_path_buf(), false)?]);
        }
        let metadata_path = path.join("metadata.yaml");
        if !metadata_path.exists() {
            let reader = Self::assemble(path, None, splits_in(path)?)?;
            return Ok(BagReader {
                past_cut: true,
                ..reader
            });
        }
        let metadata = Metadata::read(&metadata_path)?;
        let splits = listed_splits(path, &metadata, &metadata_path)?;
        Self::assemble(path, Some(metadata), splits)
    }

    /// Topics; messages refer to them by index.
    pub fn topics(&self) -> &[TopicInfo] {
        &self.topics
    }

    /// First log time, ns since the Unix epoch; `None` without messages.
    pub fn start_ns(&self) -> Option<i64> {
        self.range_ns.map(|(start_ns, _)| start_ns)
    }

    /// Last log time, ns since the Unix epoch; `None` without messages.
    pub fn end_ns(&self) -> Option<i64> {
        self.range_ns.map(|(_, end_ns)| end_ns)
    }

    /// Number of messages by the storage files; by `metadata.yaml` while compressed files are closed.
    pub fn message_count(&self) -> u64 {
        self.message_count
    }

    /// Number of messages by `metadata.yaml`, if its counts differ from the storage files, in total or for a topic.
    pub fn miscounted(&self) -> Option<u64> {
        self.miscounted
    }

    /// Storage files in order of time.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.splits.iter().map(|split| split.path.as_path())
    }

    /// Storage format of the files; that to convert ROS 1 bags to is MCAP.
    pub fn storage(&self) -> Storage {
        match self.is_sqlite() {
            true => Storage::Sqlite3,
            false => Storage::Mcap,
        }
    }

    /// True if the messages were recorded by ROS 1 and are converted.
    pub fn is_ros1(&self) -> bool {
        let open = self.splits.iter().filter_map(|split| split.open.as_ref());
        open.into_iter().any(OpenFile::is_ros1)
    }

    /// Name of the storage format: `mcap`, `sqlite3` or `rosbag1`.
    pub fn storage_name(&self) -> &'static str {
        let is_bag = |open: &OpenFile| matches!(open, OpenFile::Ros1(_));
        let open = self.splits.iter().filter_map(|split| split.open.as_ref());
        match open.into_iter().any(is_bag) {
            true => "rosbag1",
            false => self.storage().identifier(),
        }
    }

    /// ROS distribution of the recorder; empty if `metadata.yaml` does not state it.
    pub fn ros_distro(&self) -> &str {
        &self.ros_distro
    }

    /// Invalid rows of SQLite files, which are skipped: without topic, time or content.
    pub fn implausible_rows(&self) -> u64 {
        let open = self.splits.iter().filter_map(|split| split.open.as_ref());
        open.map(|open| open.info().implausible).sum()
    }

    /// The same bag, whose truncated files end without an error; see [`BagReader::cuts`].
    #[must_use]
    pub fn past_cut(self) -> BagReader {
        BagReader {
            past_cut: true,
            ..self
        }
    }

    /// Truncated files, each with the number of its messages.
    pub fn cuts(&self) -> Vec<String> {
        let damages = self.splits.iter().filter_map(Split::damage);
        let is_cut = |damage: &BagError| matches!(damage, BagError::Truncated { .. });
        damages.filter(is_cut).map(|cut| cut.cause()).collect()
    }

    /// Number of messages by the storage files; `None` if one of them is damaged.
    pub(crate) fn claimed(&self) -> Option<u64> {
        let of = |split: &Split| split.open.as_ref()?.claimed();
        self.splits.iter().map(of).sum()
    }

    /// True if all storage files are SQLite.
    pub(crate) fn is_sqlite(&self) -> bool {
        self.splits.iter().all(|split| is_sqlite(&split.path))
    }

    /// Selected messages in order of log time across all files, with bounded memory.
    ///
    /// A damaged bag yields the messages before the damage, then the error. A truncated file ends without one in a folder
    /// without `metadata.yaml`, whose recorder was killed, and after [`BagReader::past_cut`]. Unknown topics are an error.
    pub fn messages(&self, options: &ReadOptions) -> Result<Messages, BagError> {
        let names = options.topics.as_deref();
        self.expect_topics(names.unwrap_or_default())?;
        let is_wanted = |topic: &TopicInfo| names.is_none_or(|n| n.contains(&topic.name));
        Ok(self.filtered(Filter {
            topics: self.topics.iter().map(is_wanted).collect(),
            start_ns: options.start_ns.unwrap_or(i64::MIN),
            end_ns: options.end_ns,
            past_damage: options.past_damage,
        }))
    }

    pub(crate) fn filtered(&self, filter: Filter) -> Messages {
        let (splits, topics) = (self.splits.clone(), self.topics.clone());
        Messages::new(splits, topics, filter, self.compression, self.past_cut)
    }

    /// Rejects topic names that the bag lacks.
    pub(crate) fn expect_topics(&self, names: &[String]) -> Result<(), BagError> {
        let known: Vec<&str> = self.topics.iter().map(|t| t.name.as_str()).collect();
        match names.iter().find(|name| !known.contains(&name.as_str())) {
            None => Ok(()),
            Some(unknown) => Err(BagError::invalid(
                "topics",
                format!(
                    "{unknown} is not in {}, which has {}",
                    self.path.display(),
                    known.join(", ")
                ),
            )),
        }
    }

    fn assemble(
        path: &Path,
        metadata: Option<Metadata>,
        splits: Vec<Split>,
    ) -> Result<BagReader, BagError> {
        let splits = in_order_of_time(splits);
        let compression = match &metadata {
            None => MessageCompression::Detect,
            Some(metadata) => match metadata.compression(path)? {
                CompressionMode::Message => MessageCompression::Zstd,
                _ => MessageCompression::None,
            },
        };
        let all_open = splits.iter().all(|split| split.open.is_some());
        let listed = listed_topics(metadata.as_ref());
        let mut topics = listed.clone();
        if all_open {
            // Storage files count their own messages.
            (topics.iter_mut()).for_each(|topic| topic.message_count = 0);
        }
        let mut places = TopicIndex::new(&topics);
        for open in splits.iter().filter_map(|split| split.open.as_ref()) {
            for topic in &open.info().topics {
                merge_topic(&mut topics, &mut places, topic, all_open);
            }
        }
        for damage in splits.iter().filter_map(Split::damage) {
            log::warn!("{damage}");
        }
        for split in &splits {
            let rows = split
                .open
                .as_ref()
                .map_or(0, |open| open.info().implausible);
            if rows > 0 {
                let path = split.path.display();
                log::warn!("{path}: {rows} rows are not valid messages and are skipped");
            }
        }
        if !all_open {
            // Known for some files only.
            (topics.iter_mut()).for_each(|topic| topic.message_bytes = None);
        }
        let listed_ns = metadata.as_ref().and_then(Metadata::range_ns);
        let seen = splits
            .iter()
            .filter_map(|split| split.range_ns)
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let count = splits
            .iter()
            .filter_map(|split| split.message_count)
            .fold(0, u64::saturating_add);
        let claimed = metadata.as_ref().map(|m| m.message_count);
        let wrong = listed.iter().zip(&topics);
        let wrong = wrong.filter(|(of, is)| of.message_count != is.message_count);
        let wrong: Vec<_> = wrong.map(|(_, topic)| topic.name.as_str()).collect();
        let miscounted =
            claimed.filter(|claimed| all_open && (*claimed != count || !wrong.is_empty()));
        if let Some(claimed) = miscounted {
            let path = path.display();
            log::warn!(
                "{path}: metadata.yaml counts {claimed} messages, the storage files {count}; the latter are used \
                 (topics counted otherwise: {})",
                shown(&wrong)
            );
        }
        Ok(BagReader {
            path: path.to_path_buf(),
            message_count: match &metadata {
                Some(m) if !all_open => m.message_count,
                _ => count,
            },
            miscounted,
            range_ns: if all_open { seen } else { listed_ns.or(seen) },
            ros_distro: metadata.map(|m| m.ros_distro).unwrap_or_default(),
            topics: topics.into(),
            splits: splits.into(),
            compression,
            past_cut: false,
        })
    }
}

/// The first three names, and the number of the others.
fn shown(names: &[&str]) -> String {
    match names {
        [] => "none".to_owned(),
        [a, b, c, _, ..] => format!("{a}, {b}, {c} and {} more", names.len() - 3),
        names => names.join(", "),
    }
}

/// Topics of `metadata.yaml`.
fn listed_topics(metadata: Option<&Metadata>) -> Vec<TopicInfo> {
    let listed = metadata
        .map(|m| m.topics_with_message_count.as_slice())
        .unwrap_or_default();
    let topic = |counted: &super::metadata::CountedTopic| {
        let topic = counted.topic_metadata.clone();
        TopicInfo {
            name: absolute_name(&topic.name),
            type_name: full_type_name(&topic.type_name),
            type_hash: topic.type_description_hash,
            serialization_format: topic.serialization_format,
            offered_qos: topic.offered_qos_profiles,
            definition: None,
            message_count: counted.message_count,
            message_bytes: None,
        }
    };
    listed.iter().map(topic).collect()
}
