//! One storage file of a bag, opened at once or, if compressed, on demand.

use std::path::{Path, PathBuf};

use super::{
    BagError, TopicInfo,
    mcap_storage::McapFile,
    ros1::Ros1File,
    sniff::{FileKind, identify},
    sqlite_storage::SqliteFile,
    storage::{Filter, StorageInfo, StorageStream, TopicIndex},
    zstd_files::decompress_file,
};

/// An indexed storage file.
pub(crate) enum OpenFile {
    Mcap(McapFile),
    Sqlite(SqliteFile),
    Ros1(Ros1File),
}

impl OpenFile {
    /// Opens `path` by its content, not its name.
    pub(crate) fn open(path: &Path) -> Result<OpenFile, BagError> {
        match identify(path)? {
            FileKind::Mcap => McapFile::open(path, None).map(OpenFile::Mcap),
            FileKind::Sqlite3 => SqliteFile::open(path, None).map(OpenFile::Sqlite),
            FileKind::Ros1 => Ros1File::open(path, None).map(OpenFile::Ros1),
            FileKind::Zstd => Self::open_compressed(path).map_err(|e| e.in_file(path)),
        }
    }

    fn open_compressed(path: &Path) -> Result<OpenFile, BagError> {
        let (copy, damage) = decompress_file(path)?;
        let opened = identify(&copy).and_then(|kind| match kind {
            FileKind::Mcap => McapFile::open(&copy, Some(copy.clone())).map(OpenFile::Mcap),
            FileKind::Sqlite3 => SqliteFile::open(&copy, Some(copy.clone())).map(OpenFile::Sqlite),
            FileKind::Ros1 => Ros1File::open(&copy, Some(copy.clone())).map(OpenFile::Ros1),
            FileKind::Zstd => Err(BagError::unsupported(
                path,
                "a storage file compressed twice".into(),
                "decompress it with `zstd -d`",
            )),
        });
        match damage {
            None => opened,
            // The part before the damage may be too short.
            Some(damage) => opened
                .map(|open| open.with_damage(damage.clone()))
                .map_err(|_| damage),
        }
    }

    /// The sound part of a compressed file with its damage.
    fn with_damage(mut self, damage: BagError) -> OpenFile {
        let damage = match damage {
            BagError::Truncated {
                path,
                size_bytes,
                inside,
                ..
            } => BagError::Truncated {
                path,
                size_bytes,
                inside,
                readable_messages: self.info().message_count,
            },
            other => other,
        };
        match &mut self {
            OpenFile::Mcap(file) => file.note_damage(damage),
            OpenFile::Sqlite(file) => file.note_damage(damage),
            OpenFile::Ros1(file) => file.note_damage(damage),
        }
        self
    }

    pub(crate) fn info(&self) -> &StorageInfo {
        match self {
            OpenFile::Mcap(file) => &file.info,
            OpenFile::Sqlite(file) => &file.info,
            OpenFile::Ros1(file) => &file.info,
        }
    }

    /// True if the messages are converted from ROS 1.
    pub(crate) fn is_ros1(&self) -> bool {
        match self {
            OpenFile::Mcap(file) => file.is_ros1(),
            OpenFile::Sqlite(_) => false,
            OpenFile::Ros1(_) => true,
        }
    }

    /// Number of messages by the file itself; `None` if it is damaged.
    pub(crate) fn claimed(&self) -> Option<u64> {
        match self {
            OpenFile::Mcap(file) => file.claimed,
            OpenFile::Sqlite(file) => file.claimed(),
            OpenFile::Ros1(file) => file.claimed,
        }
    }

    fn stream(&self, filter: Filter) -> Result<StorageStream, BagError> {
        match self {
            OpenFile::Mcap(file) => file.stream(filter),
            OpenFile::Sqlite(file) => file.stream(filter),
            OpenFile::Ros1(file) => file.stream(filter),
        }
    }

    /// Selected messages, and the bag's topic of each of the file's topics.
    pub(crate) fn wanted(
        &self,
        path: &Path,
        topics: &[TopicInfo],
        wanted: &Filter,
    ) -> Result<(StorageStream, Vec<usize>), BagError> {
        let places = TopicIndex::new(topics);
        let find = |topic: &TopicInfo| {
            let found = places.find(&topic.name, &topic.type_name);
            found.ok_or_else(|| {
                let (name, type_name) = (&topic.name, &topic.type_name);
                let reason = format!("topic {name} of type {type_name} is not in metadata.yaml");
                let remedy = "move metadata.yaml away to have it rebuilt";
                BagError::corrupt(path, "its list of topics", reason, remedy)
            })
        };
        let mapped = self.info().topics.iter().map(find);
        let mapped: Vec<usize> = mapped.collect::<Result<_, _>>()?;
        let by_file = mapped
            .iter()
            .map(|index| wanted.wants_topic(*index))
            .collect();
        let stream = self.stream(Filter {
            topics: by_file,
            ..*wanted
        })?;
        Ok((stream, mapped))
    }
}

/// A storage file in the order of the bag.
pub(crate) struct Split {
    pub(crate) path: PathBuf,
    /// `None` while it is compressed and not needed.
    pub(crate) open: Option<OpenFile>,
    /// First and last log time, if known.
    pub(crate) range_ns: Option<(i64, i64)>,
    pub(crate) message_count: Option<u64>,
}

impl Split {
    /// Damage of the file; everything before it is readable.
    pub(crate) fn damage(&self) -> Option<BagError> {
        let damage = self.open.as_ref()?.info().damage.clone()?;
        Some(damage.in_file(&self.path))
    }

    /// Opens the file, unless it is compressed and `lazy`.
    pub(crate) fn new(path: PathBuf, lazy: bool) -> Result<Split, BagError> {
        if lazy && identify(&path)? == FileKind::Zstd {
            return Ok(Split {
                path,
                open: None,
                range_ns: None,
                message_count: None,
            });
        }
        let open = OpenFile::open(&path)?;
        let info = open.info();
        let (range_ns, message_count) = (info.range_ns, Some(info.message_count));
        Ok(Split {
            path,
            range_ns,
            message_count,
            open: Some(open),
        })
    }
}
