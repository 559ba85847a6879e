//! Messages of a ROS 1 bag in order of log time, as CDR; only overlapping chunks are in memory.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::sync::Arc;

use tempfile::TempPath;

use super::chunk::content;
use super::contents::{Block, Contents, Routes};
use super::record::{Cause, Head, Place, Record, RecordError, op};
use super::scan::message_fields;
use super::visit::{Step, visit_damaged, visit_records};
use crate::BagError;
use crate::storage::{Filter, StorageMessage};

/// Memory limit for messages of overlapping chunks, bytes.
const MAX_WAITING_BYTES: u64 = 2 << 30;
/// Longest damaged part in which messages are searched, bytes.
const MAX_DAMAGED_BYTES: u64 = 256 << 20;

pub(super) struct Ros1Stream {
    file: File,
    path: PathBuf,
    size: u64,
    /// Keeps a decompressed copy alive.
    _temporary: Option<Arc<TempPath>>,
    /// Unread blocks, by time.
    blocks: VecDeque<Block>,
    routes: Arc<Routes>,
    filter: Filter,
    waiting: BinaryHeap<Reverse<Waiting>>,
    waiting_bytes: u64,
    damages: VecDeque<BagError>,
}

/// A buffered message, ordered by time, then by position in the file.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Waiting {
    log_time_ns: i64,
    place: Place,
    connection: u32,
    topic: usize,
    unchecked: bool,
    data: Vec<u8>,
}

impl Waiting {
    /// Memory use, including the entry itself.
    fn bytes(&self) -> u64 {
        (size_of::<Waiting>() + self.data.len()) as u64
    }
}

impl Ros1Stream {
    pub(super) fn new(
        (file, path, size): (File, PathBuf, u64),
        temporary: Option<Arc<TempPath>>,
        contents: &Contents,
        routes: Arc<Routes>,
        filter: Filter,
    ) -> Ros1Stream {
        let is_wanted = |block: &&Block| {
            let has_topic = |id| {
                let route = routes.get(id);
                route.is_none_or(|(topic, _)| filter.wants_topic(*topic))
            };
            let is_damaged = block.counts.is_empty();
            let is_meant = filter.past_damage || !block.behind;
            is_meant
                && (is_damaged
                    || block.counts.keys().any(has_topic)
                        && filter.overlaps((block.start_ns, block.end_ns)))
        };
        let mut blocks: Vec<Block> = contents.blocks.iter().filter(is_wanted).cloned().collect();
        blocks.sort_by_key(|block| (block.start_ns, block.offset));
        let told = if filter.past_damage { usize::MAX } else { 1 };
        let told = contents.damages.iter().take(told);
        let unread = told.filter(|(_, in_block)| !in_block);
        Ros1Stream {
            file,
            path,
            size,
            _temporary: temporary,
            blocks: blocks.into(),
            filter,
            waiting: BinaryHeap::new(),
            waiting_bytes: 0,
            damages: unread.map(|(damage, _)| damage.clone()).collect(),
            routes,
        }
    }

    /// True if a block may contain a message earlier than all buffered ones.
    fn needs_block(&self) -> bool {
        match (self.blocks.front(), self.waiting.peek()) {
            (None, _) => false,
            (Some(_), None) => true,
            (Some(block), Some(Reverse(first))) => block.start_ns < first.log_time_ns,
        }
    }

    /// Reads the messages of a block.
    fn read_block(&mut self, block: &Block) -> Result<(), RecordError> {
        let mut reading = Reading {
            routes: &self.routes,
            filter: &self.filter,
            waiting: &mut self.waiting,
            waiting_bytes: &mut self.waiting_bytes,
            counts: BTreeMap::new(),
            times_ns: None,
        };
        let mut is_first = true;
        let range = (block.offset, block.end);
        let read = visit_records(&mut self.file, range, (self.size, 0), &mut |step| {
            let is_chunk = matches!(step, Step::Chunk { .. });
            if std::mem::take(&mut is_first) && block.indexed && !is_chunk {
                let place = Place::in_file(block.offset);
                return Err(RecordError::bad(place, "no chunk, where the index has one"));
            }
            match step {
                Step::Record(place, record) if record.op == op::MESSAGE => {
                    reading.message(place, &record, false)
                }
                _ => Ok(()),
            }
        });
        read.map_err(RecordError::inside)?;
        let (counts, times_ns) = (reading.counts, reading.times_ns);
        let is_within =
            times_ns.is_none_or(|(first, last)| first >= block.start_ns && last <= block.end_ns);
        if block.indexed && (counts != block.counts || !is_within) {
            let total = |counts: &BTreeMap<u32, u64>| counts.values().sum::<u64>();
            let reason = format!(
                "a chunk of {} messages, which contradict the {} of the index",
                total(&counts),
                total(&block.counts)
            );
            return Err(RecordError::bad(Place::in_file(block.offset), reason));
        }
        Ok(())
    }

    /// Reads what seem to be messages behind the damage of a block, or in it.
    fn salvage(&mut self, block: &Block, damage: Place) -> Result<(), RecordError> {
        let head = Head::read(&mut self.file, block.offset, self.size);
        let head = head.ok().filter(|head| head.op == op::CHUNK);
        let (bytes, from, unchecked) = match &head {
            Some(head) => {
                let content = content(&mut self.file, head)?;
                let from = damage.in_chunk.unwrap_or(0);
                (content.bytes, from, content.compressed)
            }
            None => {
                let io = |error| RecordError::bad(damage, error);
                let start = SeekFrom::Start(damage.byte);
                self.file.seek(start).map_err(io)?;
                let most = block.end.saturating_sub(damage.byte).min(MAX_DAMAGED_BYTES);
                let mut bytes = Vec::new();
                let mut part = self.file.by_ref().take(most);
                part.read_to_end(&mut bytes).map_err(io)?;
                (bytes, 0, false)
            }
        };
        let mut reading = Reading {
            routes: &self.routes,
            filter: &self.filter,
            waiting: &mut self.waiting,
            waiting_bytes: &mut self.waiting_bytes,
            counts: BTreeMap::new(),
            times_ns: None,
        };
        visit_damaged(&bytes, from, &mut |at, record| {
            let place = Place {
                byte: damage.byte,
                in_chunk: Some(at),
            };
            if record.op == op::MESSAGE {
                // One that is none is left out: the damage is known.
                let _ = reading.guess(place, &record, unchecked);
            }
        });
        Ok(())
    }

    /// A buffered message as CDR.
    fn converted(&self, message: Waiting) -> Result<StorageMessage, BagError> {
        let Waiting {
            log_time_ns,
            topic,
            unchecked,
            data,
            place,
            connection,
        } = message;
        let transcoder = self.routes.get(&connection).and_then(|(_, t)| t.as_ref());
        let data = match transcoder {
            None => Ok(data),
            Some(transcoder) => transcoder.to_cdr(&data),
        };
        let data = data.map_err(|reason| RecordError::bad(place, reason));
        Ok(StorageMessage {
            topic,
            log_time_ns,
            unchecked,
            data: data.map_err(|error| error.in_file(&self.path, self.size, 0))?,
        })
    }
}

/// Messages of a block being read.
struct Reading<'a> {
    routes: &'a Routes,
    filter: &'a Filter,
    waiting: &'a mut BinaryHeap<Reverse<Waiting>>,
    waiting_bytes: &'a mut u64,
    counts: BTreeMap<u32, u64>,
    /// First and last log time, ns.
    times_ns: Option<(i64, i64)>,
}

impl Reading<'_> {
    fn message(
        &mut self,
        place: Place,
        record: &Record<'_>,
        unchecked: bool,
    ) -> Result<(), RecordError> {
        let (connection, log_time_ns) = message_fields(place, record)?;
        let Some((topic, _)) = self.routes.get(&connection) else {
            let reason = format!("a message of the unknown connection {connection}");
            return Err(RecordError::bad(place, reason));
        };
        *self.counts.entry(connection).or_default() += 1;
        let (first_ns, last_ns) = self.times_ns.unwrap_or((log_time_ns, log_time_ns));
        self.times_ns = Some((first_ns.min(log_time_ns), last_ns.max(log_time_ns)));
        if !self.filter.wants(*topic, log_time_ns) {
            return Ok(());
        }
        let message = Waiting {
            log_time_ns,
            place,
            connection,
            topic: *topic,
            unchecked,
            data: record.data.to_vec(),
        };
        *self.waiting_bytes = self.waiting_bytes.saturating_add(message.bytes());
        if *self.waiting_bytes > MAX_WAITING_BYTES {
            let cause = Cause::TooLarge {
                what: "the content of chunks overlapping in time",
                size_bytes: *self.waiting_bytes,
                limit_bytes: MAX_WAITING_BYTES,
            };
            return Err(RecordError { place, cause });
        }
        self.waiting.push(Reverse(message));
        Ok(())
    }

    /// Adds what may be a message, if it converts.
    fn guess(
        &mut self,
        place: Place,
        record: &Record<'_>,
        unchecked: bool,
    ) -> Result<(), RecordError> {
        let (connection, _) = message_fields(place, record)?;
        let converts = match self.routes.get(&connection) {
            Some((_, Some(transcoder))) => transcoder.to_cdr(record.data).is_ok(),
            _ => false,
        };
        match converts {
            true => self.message(place, record, unchecked),
            false => Ok(()),
        }
    }
}

impl Iterator for Ros1Stream {
    type Item = Result<StorageMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.needs_block() {
            let block = self.blocks.pop_front()?;
            if block.behind && block.counts.is_empty() && block.end > block.offset + 1 {
                // Its damage is among the others.
                if let Err(error) = self.salvage(&block, Place::in_file(block.offset)) {
                    log::debug!("{:?}", error.cause);
                }
                continue;
            }
            if let Err(error) = self.read_block(&block) {
                let is_full = matches!(error.cause, Cause::TooLarge { .. });
                let place = error.place;
                let error = error.in_file(&self.path, self.size, 0);
                if self.filter.past_damage {
                    if !is_full && let Err(error) = self.salvage(&block, place) {
                        log::debug!("{:?}", error.cause);
                    }
                    return Some(Err(error));
                }
                // The buffered messages are valid, and earlier or close by: the error follows them.
                self.blocks.clear();
                self.damages = VecDeque::from([error]);
            }
        }
        if let Some(Reverse(message)) = self.waiting.pop() {
            self.waiting_bytes = self.waiting_bytes.saturating_sub(message.bytes());
            return Some(self.converted(message));
        }
        self.damages.pop_front().map(Err)
    }
}
