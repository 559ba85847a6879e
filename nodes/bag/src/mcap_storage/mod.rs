//! MCAP storage files: indexed by the summary, or by a scan of the whole file.

mod contents;
mod file;
mod lengths;
mod packed;
mod records;
mod resume;
mod salvage;
mod scan;
mod stream;
mod summary;

use std::{fs::File, path::Path, sync::Arc};

use mcap::records::{Record, op};
use tempfile::TempPath;

use super::{
    BagError,
    sniff::MCAP_MAGIC,
    storage::{Filter, StorageStream},
};
pub(crate) use file::McapFile;
use lengths::parse_record;
use records::{Cause, Place, RecordError, first_record};
use stream::McapStream;

impl McapFile {
    /// Opens `path`, which may be a temporary copy that is deleted with the last reader.
    pub(crate) fn open(
        path: &Path,
        temporary: Option<Arc<TempPath>>,
    ) -> Result<McapFile, BagError> {
        let mut file = File::open(path).map_err(BagError::io(path, "open"))?;
        let size = file
            .metadata()
            .map_err(BagError::io(path, "examine"))?
            .len();
        let profile = read_profile(&mut file, path, size);
        let summary = summary::read_summary(&mut file, size);
        let claimed = summary.as_ref().ok().map(|contents| contents.seen.messages);
        let mut contents = summary.unwrap_or_else(|reason| {
            log::info!(
                "{}: {reason}; reading the whole file once to index it",
                path.display()
            );
            scan::scan(&mut file, path, size)
        });
        let profile = match profile {
            Err(error) if contents.channels.is_empty() => return Err(error),
            Err(error) => {
                log::warn!("{error}");
                String::new()
            }
            Ok(profile) => profile,
        };
        let (mut info, topic_of) = contents.topics(path, &profile)?;
        if let Some((first, last)) = contents.seen.range_ns {
            let signed = |ns: u64| {
                i64::try_from(ns).map_err(|_| {
                    let reason = format!("log time {ns} ns is beyond the year 2262");
                    BagError::corrupt(path, "its index", reason, "check the clock of the recorder")
                })
            };
            info.range_ns = Some((signed(first)?, signed(last)?));
        }
        Ok(McapFile {
            path: path.to_path_buf(),
            temporary,
            blocks: contents.blocks,
            topic_of: Arc::new(topic_of),
            damages: contents.damages,
            unchecked: false,
            claimed,
            info,
        })
    }

    /// Notes the damage of the compressed file of which this is the sound part.
    pub(crate) fn note_damage(&mut self, damage: BagError) {
        // The part has no end.
        self.damages
            .retain(|damage| !matches!(damage, BagError::Truncated { .. }));
        self.damages.push(damage);
        self.info.damage = self.damages.first().cloned();
        self.unchecked = true;
    }

    /// True if messages are converted from ROS 1.
    pub(crate) fn is_ros1(&self) -> bool {
        let converted = |(_, transcoder): &(_, Option<_>)| transcoder.is_some();
        self.topic_of.values().any(converted)
    }

    /// Selected messages in order of log time.
    pub(crate) fn stream(&self, filter: Filter) -> Result<StorageStream, BagError> {
        Ok(Box::new(McapStream::new(self, filter)?))
    }
}

/// Reads the header record, which must come first.
fn read_profile(file: &mut File, path: &Path, size: u64) -> Result<String, BagError> {
    let at = MCAP_MAGIC.len() as u64;
    let first = first_record(file, at, size).map_err(|error| error.in_file(path, size, 0))?;
    let place = Place::in_file(at);
    let error = match &first {
        Some((op::HEADER, body)) => match parse_record(op::HEADER, body) {
            Ok(Record::Header(header)) => return Ok(header.profile),
            Ok(_) => RecordError::bad(place, "no header record"),
            Err(error) => RecordError::bad(place, error),
        },
        Some((opcode, _)) => {
            let reason = format!("opcode {opcode} in place of the header record");
            RecordError::bad(place, reason)
        }
        None => RecordError {
            place,
            cause: Cause::Cut,
        },
    };
    Err(error.in_file(path, size, 0))
}
