//! Messages of an MCAP file in order of log time, holding only the blocks that overlap.

use std::{
    cmp::Reverse,
    collections::{BTreeMap, BinaryHeap, VecDeque},
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
    path::PathBuf,
    sync::Arc,
};

use tempfile::TempPath;

use super::{
    chunk::walk_chunk,
    contents::Block,
    scan::walk_error,
    walk::{Event, WalkError, walk},
};
use crate::{
    BagError,
    storage::{Filter, StorageMessage},
};

/// Messages of overlapping blocks may wait in memory up to this size, bytes.
const MAX_WAITING_BYTES: u64 = 2 << 30;
/// What is reserved for a message before its bytes are seen.
const RESERVED_BYTES: u64 = 1 << 20;

pub(super) struct McapStream {
    file: BufReader<File>,
    path: PathBuf,
    /// Keeps a decompressed copy alive.
    _temporary: Option<Arc<TempPath>>,
    /// Not yet read, by time.
    blocks: VecDeque<Block>,
    blocks_read: u64,
    topic_of: Arc<BTreeMap<u16, usize>>,
    filter: Filter,
    waiting: BinaryHeap<Reverse<Waiting>>,
    waiting_bytes: u64,
    damage: Option<BagError>,
    ended: bool,
}

/// A message that was read; sorts by time, then by place in the file.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Waiting {
    log_time_ns: i64,
    block: u64,
    record: u64,
    topic: usize,
    data: Vec<u8>,
}

impl McapStream {
    pub(super) fn new(
        path: PathBuf,
        temporary: Option<Arc<TempPath>>,
        blocks: &[Block],
        topic_of: Arc<BTreeMap<u16, usize>>,
        filter: Filter,
        damage: Option<BagError>,
    ) -> Result<McapStream, BagError> {
        let file = File::open(&path).map_err(BagError::io(&path, "open"))?;
        let is_wanted = |block: &&Block| {
            let clamp = |ns: u64| i64::try_from(ns).unwrap_or(i64::MAX);
            let has_topic = block.channels.as_ref().is_none_or(|channels| {
                channels
                    .iter()
                    .any(|id| topic_of.get(id).is_none_or(|t| filter.wants_topic(*t)))
            });
            // Empty chunks may carry a reversed range.
            has_topic && filter.overlaps((clamp(block.start_ns), clamp(block.end_ns)))
        };
        let mut blocks: Vec<Block> = blocks.iter().filter(is_wanted).cloned().collect();
        blocks.sort_by_key(|block| (block.start_ns, block.offset));
        Ok(McapStream {
            file: BufReader::with_capacity(1 << 16, file),
            path,
            _temporary: temporary,
            blocks: blocks.into(),
            blocks_read: 0,
            topic_of,
            filter,
            waiting: BinaryHeap::new(),
            waiting_bytes: 0,
            damage,
            ended: false,
        })
    }

    /// Whether a block may hold a message earlier than all that wait.
    fn needs_block(&self) -> bool {
        match (self.blocks.front(), self.waiting.peek()) {
            (None, _) => false,
            (Some(_), None) => true,
            (Some(block), Some(Reverse(first))) => {
                i64::try_from(block.start_ns).is_ok_and(|start_ns| start_ns < first.log_time_ns)
            }
        }
    }

    fn read_block(&mut self, block: &Block) -> Result<(), BagError> {
        let number = self.blocks_read;
        self.blocks_read += 1;
        let (filter, topic_of) = (&self.filter, &self.topic_of);
        let (waiting, waiting_bytes) = (&mut self.waiting, &mut self.waiting_bytes);
        // A chunk counts only once its CRC is right.
        let mut read = Vec::new();
        let mut visit = |at: u64, event: Event<'_>| {
            let Event::Message { header, len, body } = event else {
                return Ok(());
            };
            let Some(&topic) = topic_of.get(&header.channel_id) else {
                return Err(WalkError::bad(
                    at,
                    format!("a message of unknown channel {}", header.channel_id),
                ));
            };
            let log_time_ns = i64::try_from(header.log_time).map_err(|_| {
                WalkError::bad(
                    at,
                    format!("log time {} ns is beyond the year 2262", header.log_time),
                )
            })?;
            if !filter.wants(topic, log_time_ns) {
                return Ok(());
            }
            *waiting_bytes = waiting_bytes.saturating_add(len);
            if *waiting_bytes > MAX_WAITING_BYTES {
                return Err(WalkError::TooLarge {
                    what: "all that chunks overlapping in time hold",
                    at,
                    size_bytes: *waiting_bytes,
                    limit_bytes: MAX_WAITING_BYTES,
                });
            }
            let mut data =
                Vec::with_capacity(usize::try_from(len.min(RESERVED_BYTES)).unwrap_or(0));
            body.take(len)
                .read_to_end(&mut data)
                .map_err(|e| WalkError::bad(at, e))?;
            read.push(Waiting {
                log_time_ns,
                block: number,
                record: at,
                topic,
                data,
            });
            Ok(())
        };
        let (file, offset, len) = (&mut self.file, block.offset, block.len);
        let walked = match block.is_chunk {
            true => walk_chunk(file, offset, len, &mut visit).map(|_| ()),
            false => file
                .seek(SeekFrom::Start(offset))
                .map_err(|e| WalkError::bad(0, e))
                .and_then(|_| walk(file, len, &mut visit)),
        };
        walked.map_err(|e| walk_error(&self.path, offset, block.is_chunk, e))?;
        waiting.extend(read.into_iter().map(Reverse));
        Ok(())
    }
}

impl Iterator for McapStream {
    type Item = Result<StorageMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        while self.needs_block() {
            let block = self.blocks.pop_front()?;
            if let Err(error) = self.read_block(&block) {
                // What waits is whole, and earlier or close by: the damage is told after it.
                self.blocks.clear();
                self.damage = Some(error);
            }
        }
        if let Some(Reverse(message)) = self.waiting.pop() {
            self.waiting_bytes = self.waiting_bytes.saturating_sub(message.data.len() as u64);
            let Waiting {
                log_time_ns,
                topic,
                data,
                ..
            } = message;
            return Some(Ok(StorageMessage {
                topic,
                log_time_ns,
                data,
            }));
        }
        self.ended = true;
        self.damage.take().map(Err)
    }
}
