//! `metadata.yaml` of rosbag2, versions 1 to 9 (ros2/rosbag2, `rosbag2_storage/metadata_io`).

#[cfg(test)]
mod tests;

use std::{
    fs::File,
    io::Read,
    path::{Component, Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{BagError, BagQos, yaml};

/// Version written, and the newest one read.
pub(crate) const METADATA_VERSION: u32 = 9;
/// Largest metadata file, bytes.
const MAX_METADATA_BYTES: u64 = 16 << 20;
/// Start of an empty bag, ns.
pub(crate) const EMPTY_START_NS: i64 = i64::MAX;

/// Compression of storage files or messages besides that of the storage format.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) enum CompressionMode {
    /// No compression.
    #[default]
    None,
    /// Each storage file.
    File,
    /// Each message.
    Message,
}

/// Content of `metadata.yaml`.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Metadata {
    pub version: u32,
    /// Ignored: storage files are identified by their first bytes.
    #[serde(deserialize_with = "null_is_default")]
    pub storage_identifier: String,
    pub duration: Nanoseconds,
    pub starting_time: StartingTime,
    #[serde(deserialize_with = "lenient_count")]
    pub message_count: u64,
    #[serde(deserialize_with = "null_is_default")]
    pub topics_with_message_count: Vec<CountedTopic>,
    #[serde(deserialize_with = "null_is_default")]
    pub compression_format: String,
    #[serde(deserialize_with = "null_is_default")]
    pub compression_mode: String,
    #[serde(deserialize_with = "null_is_default")]
    pub relative_file_paths: Vec<String>,
    #[serde(deserialize_with = "null_is_default")]
    pub files: Vec<FileInformation>,
    /// Ignored user data.
    #[serde(skip_deserializing)]
    pub custom_data: (),
    #[serde(deserialize_with = "null_is_default")]
    pub ros_distro: String,
}

#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Nanoseconds {
    pub nanoseconds: i64,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct StartingTime {
    pub nanoseconds_since_epoch: i64,
}

impl Default for StartingTime {
    fn default() -> Self {
        StartingTime {
            nanoseconds_since_epoch: EMPTY_START_NS,
        }
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct CountedTopic {
    pub topic_metadata: TopicMetadata,
    #[serde(default, deserialize_with = "lenient_count")]
    pub message_count: u64,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TopicMetadata {
    pub name: String,
    #[serde(rename = "type")]
    pub type_name: String,
    pub serialization_format: String,
    #[serde(default, deserialize_with = "qos_profiles")]
    pub offered_qos_profiles: Vec<BagQos>,
    #[serde(default, deserialize_with = "null_is_default")]
    pub type_description_hash: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct FileInformation {
    pub path: String,
    #[serde(default)]
    pub starting_time: StartingTime,
    #[serde(default)]
    pub duration: Nanoseconds,
    #[serde(default, deserialize_with = "lenient_count")]
    pub message_count: u64,
}

/// First and last log time; `None` without messages.
fn range_ns(start: StartingTime, duration: Nanoseconds, message_count: u64) -> Option<(i64, i64)> {
    let start_ns = start.nanoseconds_since_epoch;
    let end_ns = start_ns.checked_add(duration.nanoseconds.max(0))?;
    (message_count > 0).then_some((start_ns, end_ns))
}

impl FileInformation {
    /// First and last log time of the file; `None` without messages.
    pub(crate) fn range_ns(&self) -> Option<(i64, i64)> {
        range_ns(self.starting_time, self.duration, self.message_count)
    }
}

#[derive(Serialize, Deserialize)]
struct Document {
    rosbag2_bagfile_information: Metadata,
}

impl Metadata {
    /// Reads and validates the file.
    pub(crate) fn read(path: &Path) -> Result<Metadata, BagError> {
        let file = File::open(path).map_err(BagError::io(path, "open"))?;
        let mut text = String::new();
        let read = file.take(MAX_METADATA_BYTES + 1).read_to_string(&mut text);
        let size_bytes = read.map_err(BagError::io(path, "read"))? as u64;
        if size_bytes > MAX_METADATA_BYTES {
            return Err(BagError::TooLarge {
                path: path.to_path_buf(),
                what: "the metadata",
                position: "byte 0".into(),
                size_bytes,
                limit_bytes: MAX_METADATA_BYTES,
                remedy: "move the file away to have it rebuilt from the storage files",
            });
        }
        Self::parse(path, &text)
    }

    fn parse(path: &Path, text: &str) -> Result<Metadata, BagError> {
        let wrong = |reason: String| BagError::Metadata {
            path: path.to_path_buf(),
            reason,
        };
        let document: Document =
            yaml::from_text(text).map_err(|e| wrong(format!("not rosbag2 metadata: {e}")))?;
        let metadata = document.rosbag2_bagfile_information;
        match metadata.version {
            1..=METADATA_VERSION => {}
            0 => return Err(wrong("metadata without a version".into())),
            newer => {
                return Err(wrong(format!(
                    "metadata version {newer} is newer than {METADATA_VERSION}, the latest supported"
                )));
            }
        }
        Ok(metadata)
    }

    /// First and last log time of the bag; `None` without messages.
    pub(crate) fn range_ns(&self) -> Option<(i64, i64)> {
        range_ns(self.starting_time, self.duration, self.message_count)
    }

    /// True if there are messages, and the counts of topics and of files add up to their number.
    pub(crate) fn has_consistent_counts(&self) -> bool {
        let sum = |counts: &mut dyn Iterator<Item = u64>| counts.fold(0, u64::saturating_add);
        let topics = self.topics_with_message_count.iter();
        let of_topics = sum(&mut topics.map(|topic| topic.message_count));
        let of_files = sum(&mut self.files.iter().map(|file| file.message_count));
        self.message_count > 0
            && of_topics == self.message_count
            && (self.files.is_empty() || of_files == self.message_count)
    }

    /// Text of `metadata.yaml`.
    pub(crate) fn to_text(&self) -> Result<String, serde_yaml::Error> {
        serde_yaml::to_string(&Document {
            rosbag2_bagfile_information: self.clone(),
        })
    }

    /// Text embedded in storage files.
    pub(crate) fn to_embedded_text(&self) -> Result<String, serde_yaml::Error> {
        Ok(serde_yaml::to_string(self)?.trim_end().to_owned())
    }

    /// Compression mode, if its format is supported.
    pub(crate) fn compression(&self, path: &Path) -> Result<CompressionMode, BagError> {
        let mode = match self.compression_mode.to_ascii_lowercase().as_str() {
            "" | "none" => return Ok(CompressionMode::None),
            "file" => CompressionMode::File,
            "message" => CompressionMode::Message,
            _ => {
                return Err(BagError::unsupported(
                    path,
                    format!("compression mode {:?}", self.compression_mode),
                    "none, file and message are supported; convert with `ros2 bag convert`",
                ));
            }
        };
        if self.compression_format.eq_ignore_ascii_case("zstd") {
            return Ok(mode);
        }
        Err(BagError::unsupported(
            path,
            format!("compression format {:?}", self.compression_format),
            "only zstd is supported; decompress the files, or convert with `ros2 bag convert`",
        ))
    }

    /// Storage files below `bag`, each with its name in the metadata. Paths outside `bag` are rejected.
    pub(crate) fn storage_paths(
        &self,
        bag: &Path,
        path: &Path,
    ) -> Result<Vec<(String, PathBuf)>, BagError> {
        let safe = |entry: &String| {
            let relative = Path::new(entry);
            let normal = relative
                .components()
                .all(|c| matches!(c, Component::Normal(_)));
            // Drive letters and backslashes are valid names on Unix, but not intended as such in a bag.
            if entry.is_empty() || !normal || entry.contains(['\\', '\0']) {
                return Err(BagError::PathTraversal {
                    path: path.to_path_buf(),
                    entry: entry.clone(),
                });
            }
            // Up to version 3 the entry starts with the name of the bag folder.
            let inside = match relative.components().count() {
                2.. if self.version <= 3 => relative.components().skip(1).collect(),
                _ => relative.to_path_buf(),
            };
            Ok((entry.clone(), bag.join(inside)))
        };
        self.relative_file_paths.iter().map(safe).collect()
    }
}

/// Number of messages; a negative or non-integer value counts as 0.
fn lenient_count<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let value = serde_yaml::Value::deserialize(deserializer)?;
    Ok(value.as_u64().unwrap_or(0))
}

fn null_is_default<'de, D, T>(deserializer: D) -> Result<T, D::Error>
where
    D: serde::Deserializer<'de>,
    T: Deserialize<'de> + Default,
{
    Ok(Option::<T>::deserialize(deserializer)?.unwrap_or_default())
}

/// A YAML text up to version 8, a list from 9 on.
fn qos_profiles<'de, D>(deserializer: D) -> Result<Vec<BagQos>, D::Error>
where
    D: serde::Deserializer<'de>,
{
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Profiles {
        Text(String),
        List(Vec<BagQos>),
    }
    match Option::<Profiles>::deserialize(deserializer)? {
        None => Ok(Vec::new()),
        Some(Profiles::List(list)) => Ok(list),
        Some(Profiles::Text(text)) => BagQos::parse_list(&text).map_err(serde::de::Error::custom),
    }
}
