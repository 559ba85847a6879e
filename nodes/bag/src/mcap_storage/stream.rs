//! Messages of an MCAP file in order of log time; only overlapping blocks are in memory.

use std::{
    cmp::Reverse,
    collections::{BinaryHeap, VecDeque},
    fs::File,
    io::{self, Cursor, Read, Seek, SeekFrom},
    ops::ControlFlow,
    path::PathBuf,
    sync::Arc,
};

use mcap::{records::op, sans_io::LinearReaderOptions};
use tempfile::TempPath;

use super::{
    McapFile,
    contents::{Block, Routes},
    packed::unpack,
    records::{Cause, Place, RecordError, parse_message, visit_chunk, visit_records},
    salvage,
};
use crate::{
    BagError,
    storage::{Filter, StorageMessage},
};

/// Memory limit for messages of overlapping blocks, bytes.
const MAX_WAITING_BYTES: u64 = 2 << 30;

pub(super) struct McapStream {
    file: File,
    path: PathBuf,
    /// Keeps a decompressed copy alive.
    _temporary: Option<Arc<TempPath>>,
    /// Unread blocks, by time.
    blocks: VecDeque<Block>,
    blocks_read: u64,
    topic_of: Arc<Routes>,
    filter: Filter,
    waiting: BinaryHeap<Reverse<Waiting>>,
    waiting_bytes: u64,
    damages: VecDeque<BagError>,
    /// True if messages outside of chunks may be altered.
    unchecked: bool,
}

/// A buffered message, ordered by time, then by position in the file.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Waiting {
    log_time_ns: i64,
    block: u64,
    record: u64,
    topic: usize,
    channel: u16,
    unchecked: bool,
    data: Vec<u8>,
}

impl Waiting {
    /// Memory use, including the entry itself.
    fn bytes(&self) -> u64 {
        (size_of::<Waiting>() + self.data.len()) as u64
    }
}

impl McapStream {
    pub(super) fn new(file: &McapFile, filter: Filter) -> Result<McapStream, BagError> {
        let topic_of = file.topic_of.clone();
        let is_wanted = |block: &&Block| {
            let clamp = |ns: u64| i64::try_from(ns).unwrap_or(i64::MAX);
            let has_topic = block.channels.as_ref().is_none_or(|channels| {
                channels
                    .iter()
                    .any(|id| topic_of.get(id).is_none_or(|(t, _)| filter.wants_topic(*t)))
            });
            // Empty chunks may have a reversed time range.
            let is_meant = filter.past_damage || !block.behind;
            is_meant && has_topic && filter.overlaps((clamp(block.start_ns), clamp(block.end_ns)))
        };
        let told = if filter.past_damage { usize::MAX } else { 1 };
        let damages = file.damages.iter().take(told).cloned().collect();
        let mut blocks: Vec<Block> = file.blocks.iter().filter(is_wanted).cloned().collect();
        blocks.sort_by_key(|block| (block.start_ns, block.offset));
        Ok(McapStream {
            file: File::open(&file.path).map_err(BagError::io(&file.path, "open"))?,
            path: file.path.clone(),
            _temporary: file.temporary.clone(),
            blocks: blocks.into(),
            blocks_read: 0,
            topic_of,
            filter,
            waiting: BinaryHeap::new(),
            waiting_bytes: 0,
            damages,
            unchecked: file.unchecked,
        })
    }

    /// True if a block may contain a message earlier than all buffered ones.
    fn needs_block(&self) -> bool {
        match (self.blocks.front(), self.waiting.peek()) {
            (None, _) => false,
            (Some(_), None) => true,
            (Some(block), Some(Reverse(first))) => {
                i64::try_from(block.start_ns).is_ok_and(|start_ns| start_ns < first.log_time_ns)
            }
        }
    }

    /// Replaces a damaged chunk by its recovered messages.
    fn salvage(&mut self, chunk: &Block) {
        if let Err(error) = self.try_salvage(chunk) {
            log::warn!("{}: {error}", self.path.display());
        }
    }

    fn try_salvage(&mut self, chunk: &Block) -> io::Result<()> {
        let stretch = (chunk.offset, chunk.offset.saturating_add(chunk.len));
        let Some(content) = unpack(&mut self.file, stretch)? else {
            let blocks = salvage::messages(&mut self.file, stretch, &self.topic_of)?;
            let blocks = blocks.into_iter().rev();
            blocks.for_each(|block| self.blocks.push_front(block));
            return Ok(());
        };
        let span = salvage::span_at(&mut self.file, chunk.offset)?;
        let (mut source, part) = (Cursor::new(&content), (0, content.len() as u64));
        for block in salvage::messages_within(&mut source, part, span, &self.topic_of)? {
            if let Err(error) = self.read_block(&block, Some(&content)) {
                log::debug!("{:?}", error.in_file(&self.path, 0, 0));
            }
        }
        Ok(())
    }

    /// The buffered message; as CDR if it is of ROS 1.
    fn converted(&self, message: Waiting) -> Result<StorageMessage, BagError> {
        let route = self.topic_of.get(&message.channel);
        let data = match route.and_then(|(_, transcoder)| transcoder.as_ref()) {
            None => message.data,
            Some(transcoder) => transcoder.to_cdr(&message.data).map_err(|reason| {
                let (log_time_ns, channel) = (message.log_time_ns, message.channel);
                let position = format!("the message of channel {channel} at {log_time_ns} ns");
                let remedy = "take another copy, or rescue the rest with `lattice bag recover`";
                BagError::corrupt(&self.path, position, reason, remedy)
            })?,
        };
        Ok(StorageMessage {
            topic: message.topic,
            log_time_ns: message.log_time_ns,
            unchecked: message.unchecked,
            data,
        })
    }

    /// Reads the messages of a block of the file, or of the content of a damaged chunk.
    fn read_block(&mut self, block: &Block, content: Option<&[u8]>) -> Result<(), RecordError> {
        let number = self.blocks_read;
        self.blocks_read += 1;
        let start = Place::in_file(block.offset);
        let mut file = &self.file;
        let mut part = content.map(|content| {
            let from = usize::try_from(block.offset).unwrap_or(usize::MAX);
            content.get(from..).unwrap_or_default()
        });
        let source: &mut dyn Read = match &mut part {
            Some(part) => part,
            None => {
                file.seek(SeekFrom::Start(block.offset))
                    .map_err(|error| RecordError::bad(start, error))?;
                &mut file
            }
        };
        let unchecked = block.unchecked || self.unchecked && block.opcode == op::MESSAGE;
        let (filter, topic_of) = (&self.filter, &self.topic_of);
        // A chunk counts only with a valid CRC.
        let mut read = Vec::new();
        let mut waiting_bytes = self.waiting_bytes;
        let mut take = |place, opcode, body: &[u8]| {
            if opcode == op::MESSAGE
                && let Some(message) = wanted(place, body, topic_of, filter, (number, unchecked))?
            {
                waiting_bytes = waiting_bytes.saturating_add(message.bytes());
                if waiting_bytes > MAX_WAITING_BYTES {
                    let cause = Cause::TooLarge {
                        what: "the content of chunks overlapping in time",
                        size_bytes: waiting_bytes,
                        limit_bytes: MAX_WAITING_BYTES,
                    };
                    return Err(RecordError { place, cause });
                }
                read.push(message);
            }
            Ok(())
        };
        let options = LinearReaderOptions::default().with_skip_end_magic(true);
        let range = (block.offset, block.len);
        let _ = visit_records(source, range, options, &mut |place, opcode, body| {
            if place.byte == block.offset && opcode != block.opcode {
                let reason = format!("opcode {opcode}, where the index has {}", block.opcode);
                return Err(RecordError::bad(place, reason));
            }
            match opcode {
                op::CHUNK => drop(visit_chunk(place.byte, body, &mut take)?),
                _ => take(place, opcode, body)?,
            }
            Ok(ControlFlow::Continue(()))
        })
        .map_err(|error| match error.cause {
            Cause::Cut => RecordError::bad(error.place, "a record longer than stated in the index"),
            _ => error,
        })?;
        self.waiting_bytes = waiting_bytes;
        self.waiting.extend(read.into_iter().map(Reverse));
        Ok(())
    }
}

/// The message, if selected by the filter.
fn wanted(
    place: Place,
    body: &[u8],
    topic_of: &Routes,
    filter: &Filter,
    (block, unchecked): (u64, bool),
) -> Result<Option<Waiting>, RecordError> {
    let (header, data) = parse_message(place, body)?;
    let Some(&(topic, _)) = topic_of.get(&header.channel_id) else {
        let reason = format!("a message of unknown channel {}", header.channel_id);
        return Err(RecordError::bad(place, reason));
    };
    let log_time_ns = i64::try_from(header.log_time).map_err(|_| {
        let reason = format!("log time {} ns is beyond the year 2262", header.log_time);
        RecordError::bad(place, reason)
    })?;
    Ok(filter.wants(topic, log_time_ns).then(|| Waiting {
        log_time_ns,
        block,
        record: place.in_chunk.unwrap_or(place.byte),
        topic,
        channel: header.channel_id,
        unchecked,
        data: data.to_vec(),
    }))
}

impl Iterator for McapStream {
    type Item = Result<StorageMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        while self.needs_block() {
            let block = self.blocks.pop_front()?;
            if block.unchecked && block.opcode == op::CHUNK {
                self.salvage(&block);
                continue;
            }
            if let Err(error) = self.read_block(&block, None) {
                let is_full = matches!(error.cause, Cause::TooLarge { .. });
                let error = error.in_file(&self.path, 0, 0);
                if self.filter.past_damage {
                    if !block.unchecked && !is_full {
                        self.salvage(&block);
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
