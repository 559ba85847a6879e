//! Recovery of a damaged bag: copies everything readable, and reports the losses.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::Path;

use serde::Serialize;

use super::{
    BagError, BagReader, BagWriter, ReadOptions, Storage, TopicInfo, TopicSpec, WriterOptions,
    metadata::Metadata,
    split_list::{is_storage, list},
};

/// Limit of damages described individually.
const MAX_TOLD: usize = 100;

/// Result of a recovery.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Recovered {
    /// Messages in the new bag.
    pub messages: u64,
    /// Messages among them with a wrong checksum (MCAP), or without one in a damaged compressed file, which may be altered.
    pub unchecked: Vec<Unchecked>,
    /// Number of messages in the damaged bag by `metadata.yaml` or an index, if readable.
    pub claimed: Option<u64>,
    /// Messages missing in the new bag; `None` if their number is unknown.
    pub lost: Option<u64>,
    /// Messages read that are not representable in a bag.
    pub refused: u64,
    /// Number of damages.
    pub damages: u64,
    /// Descriptions of the first hundred damages.
    pub told: Vec<String>,
}

/// Unchecked messages of one topic.
#[derive(Clone, Debug, Serialize)]
pub struct Unchecked {
    /// Name of the topic.
    pub topic: String,
    /// Log times of the messages, ns since the Unix epoch.
    pub log_times_ns: Vec<i64>,
}

impl Recovered {
    /// True if nothing is readable in a damaged bag.
    pub fn is_nothing(&self) -> bool {
        self.messages == 0 && (self.damages > 0 || self.refused > 0 || self.claimed > Some(0))
    }

    fn damage(&mut self, damage: &BagError) {
        self.damages += 1;
        if self.told.len() < MAX_TOLD {
            self.told.push(damage.cause());
        }
    }
}

/// Writes the readable part of a bag to a new one at `out`, which must not exist.
///
/// Rows of SQLite files are read individually after a damage, and so are messages of MCAP chunks with a wrong checksum.
/// Of compressed chunks and files the part before the damage is read. Without any message no bag is created.
pub fn recover(bag: &Path, out: &Path) -> Result<Recovered, BagError> {
    let mut recovered = Recovered::default();
    let readers = readers(bag, &mut recovered)?;
    let storage = match readers.iter().all(|reader| reader.is_sqlite()) {
        true => Storage::Sqlite3,
        false => Storage::Mcap,
    };
    let mut writer = BagWriter::create(out, storage, WriterOptions::default())?;
    let mut known = HashMap::new();
    let mut unchecked: BTreeMap<String, Vec<i64>> = BTreeMap::new();
    for reader in &readers {
        let mut place = |topic: &TopicInfo| add(&mut writer, &mut known, topic);
        let places: Vec<Result<usize, BagError>> = reader.topics().iter().map(&mut place).collect();
        for error in places.iter().filter_map(|place| place.as_ref().err()) {
            recovered.damage(error);
        }
        let options = ReadOptions {
            past_damage: true,
            ..ReadOptions::default()
        };
        let mut messages = reader.messages(&options)?;
        while let Some(message) = messages.next() {
            let message = match message {
                Ok(message) => message,
                Err(damage) => {
                    recovered.damage(&damage);
                    continue;
                }
            };
            let Some(Ok(topic)) = places.get(message.topic) else {
                recovered.refused += 1;
                continue;
            };
            match writer.write(*topic, message.log_time_ns, &message.data) {
                Ok(()) => recovered.messages += 1,
                Err(BagError::Invalid { .. }) => {
                    recovered.refused += 1;
                    continue;
                }
                Err(error) => return Err(error),
            }
            if messages.is_unchecked()
                && let Some(topic) = reader.topics().get(message.topic)
            {
                let times = unchecked.entry(topic.name.clone()).or_default();
                times.push(message.log_time_ns);
            }
        }
        recovered.refused += reader.implausible_rows();
    }
    let listed = unchecked.into_iter();
    recovered.unchecked = listed
        .map(|(topic, log_times_ns)| Unchecked {
            topic,
            log_times_ns,
        })
        .collect();
    let claimed = recovered.claimed;
    let lost = claimed.and_then(|claimed| claimed.checked_sub(recovered.messages));
    recovered.lost = lost.or((recovered.damages == 0).then_some(0));
    writer.finish()?;
    if recovered.is_nothing() {
        fs::remove_dir_all(out).map_err(BagError::io(out, "remove"))?;
    }
    Ok(recovered)
}

/// Readers of the bag: one, or one per storage file if the bag does not open.
fn readers(bag: &Path, recovered: &mut Recovered) -> Result<Vec<BagReader>, BagError> {
    let metadata = Metadata::read(&bag.join("metadata.yaml")).ok();
    recovered.claimed = metadata.map(|metadata| metadata.message_count);
    let whole = match BagReader::open(bag) {
        Ok(reader) => {
            recovered.claimed = recovered.claimed.max(reader.claimed());
            return Ok(vec![reader]);
        }
        Err(error) if !fs::metadata(bag).is_ok_and(|found| found.is_dir()) => return Err(error),
        Err(error) => error,
    };
    recovered.damage(&whole);
    let mut files = Vec::new();
    for entry in list(bag)? {
        let (file, name) = entry?;
        if is_storage(&name) {
            files.push(file);
        }
    }
    files.sort();
    let mut readers = Vec::new();
    for file in files {
        match BagReader::open(&file) {
            Ok(reader) => readers.push(reader),
            Err(error) => recovered.damage(&error),
        }
    }
    match readers.is_empty() {
        true => Err(whole),
        false => {
            let counted = readers.iter().map(BagReader::claimed).sum();
            recovered.claimed = recovered.claimed.max(counted);
            Ok(readers)
        }
    }
}

/// Index of the topic in the new bag, added if needed.
pub(crate) fn add(
    writer: &mut BagWriter,
    known: &mut HashMap<(String, String), usize>,
    topic: &TopicInfo,
) -> Result<usize, BagError> {
    let key = (topic.name.clone(), topic.type_name.clone());
    if let Some(place) = known.get(&key) {
        return Ok(*place);
    }
    if topic.serialization_format != "cdr" {
        let reason = format!("{} is in {:?}", topic.name, topic.serialization_format);
        return Err(BagError::invalid("topic", reason));
    }
    let place = writer.add_topic(TopicSpec {
        name: topic.name.clone(),
        type_name: topic.type_name.clone(),
        type_hash: topic.type_hash.clone(),
        definition: topic.definition.clone(),
        offered_qos: topic.offered_qos.clone(),
    })?;
    known.insert(key, place);
    Ok(place)
}
