//! Conversion of a bag to a rosbag2 directory of MCAP files.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use serde::Serialize;

use super::recover::add;
use super::{BagError, BagReader, BagWriter, ReadOptions, Storage, WriterOptions};

/// Result of a conversion.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Converted {
    /// Messages in the new bag.
    pub messages: u64,
    /// Topics in the new bag.
    pub topics: usize,
    /// Topics that the new bag lacks, each with the reason.
    pub left_out: Vec<String>,
    /// Truncated files, each with the number of its messages.
    pub cuts: Vec<String>,
}

/// Writes the messages of a bag, such as one of ROS 1, to a new rosbag2 directory at `out`, which must not exist.
///
/// Truncated files are converted up to their end. After an error nothing is left at `out`.
pub fn convert(bag: &Path, out: &Path) -> Result<Converted, BagError> {
    let reader = BagReader::open(bag)?.past_cut();
    let writer = BagWriter::create(out, Storage::Mcap, WriterOptions::default())?;
    let converted = copy(&reader, writer);
    if converted.is_err() {
        fs::remove_dir_all(out).map_err(BagError::io(out, "remove"))?;
    }
    converted
}

fn copy(reader: &BagReader, mut writer: BagWriter) -> Result<Converted, BagError> {
    let mut converted = Converted {
        cuts: reader.cuts(),
        ..Converted::default()
    };
    let mut known = HashMap::new();
    let mut places = Vec::new();
    for topic in reader.topics() {
        let place = add(&mut writer, &mut known, topic);
        if let Err(error) = &place {
            converted.left_out.push(format!("{}: {error}", topic.name));
        }
        places.push(place.ok());
    }
    converted.topics = known.len();
    for message in reader.messages(&ReadOptions::default())? {
        let message = message?;
        if let Some(Some(topic)) = places.get(message.topic) {
            writer.write(*topic, message.log_time_ns, &message.data)?;
            converted.messages += 1;
        }
    }
    writer.finish()?;
    Ok(converted)
}
