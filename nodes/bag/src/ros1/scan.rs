//! Index of a ROS 1 bag without a usable one, from its records.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use super::contents::{Block, Contents};
use super::record::{Cause, Head, MAGIC, Place, Record, RecordError, op};
use super::visit::{Step, next_chunk, visit_records};
use crate::BagError;

/// Target size of blocks of messages outside of chunks, bytes.
const RUN_BYTES: u64 = 1 << 20;
/// Limit of damages after which chunks are searched.
const MAX_DAMAGES: usize = 1000;

/// Indexes a file; connections that are known already need not be in it. The index at `index_pos`, if any, is not read.
pub(super) fn scan(
    file: &mut File,
    path: &Path,
    (size, index_pos): (u64, u64),
    known: Contents,
) -> Contents {
    let contents = Contents {
        blocks: Vec::new(),
        counts: BTreeMap::new(),
        damages: Vec::new(),
        ..known
    };
    let mut scan = Scan {
        contents,
        open: None,
        behind: false,
    };
    let mut next = Some(MAGIC.len() as u64);
    while let Some(at) = next {
        let ended = visit_records(file, (at, size), (size, index_pos), &mut |step| {
            scan.step(step)
        });
        scan.close();
        next = match ended {
            Ok(()) => None,
            Err(error) => scan.go_on(file, path, size, error),
        };
    }
    if index_pos > size && scan.contents.damages.is_empty() {
        let truncated = BagError::Truncated {
            path: path.to_path_buf(),
            size_bytes: size,
            inside: format!("the chunks: the index is expected at byte {index_pos}"),
            readable_messages: scan.contents.messages(),
        };
        scan.contents.damages.push((truncated, false));
    }
    scan.contents
}

struct Scan {
    contents: Contents,
    /// Chunk being visited, or messages outside of chunks; true: a chunk.
    open: Option<(Block, bool)>,
    /// True after a damage.
    behind: bool,
}

impl Scan {
    fn step(&mut self, step: Step<'_>) -> Result<(), RecordError> {
        match step {
            Step::Chunk { at, end } => {
                self.close();
                self.open = Some((self.block(at, end), true));
                Ok(())
            }
            Step::Record(place, record) if record.op == op::CONNECTION => {
                let taken = self.contents.connection(&record);
                taken.map_err(|reason| RecordError::bad(place, reason))
            }
            Step::Record(place, record) => self.message(place, &record),
        }
    }

    fn message(&mut self, place: Place, record: &Record<'_>) -> Result<(), RecordError> {
        let (connection, log_time_ns) = message_fields(place, record)?;
        if !self.contents.connections.contains_key(&connection) {
            let reason = format!("a message of the unknown connection {connection}");
            return Err(RecordError::bad(place, reason));
        }
        let is_chunk = place.in_chunk.is_some();
        let goes_on = |(block, of_chunk): &(Block, bool)| {
            is_chunk == *of_chunk && (is_chunk || place.byte - block.offset < RUN_BYTES)
        };
        if !self.open.as_ref().is_some_and(goes_on) {
            self.close();
        }
        let new = self.block(place.byte, place.byte + 1);
        let (block, _) = self.open.get_or_insert((new, is_chunk));
        if !is_chunk {
            block.end = place.byte + 1;
        }
        if block.counts.is_empty() {
            (block.start_ns, block.end_ns) = (log_time_ns, log_time_ns);
        }
        block.start_ns = block.start_ns.min(log_time_ns);
        block.end_ns = block.end_ns.max(log_time_ns);
        *block.counts.entry(connection).or_default() += 1;
        if !self.behind {
            *self.contents.counts.entry(connection).or_default() += 1;
        }
        Ok(())
    }

    /// A block without messages, at the time of the one before.
    fn block(&self, offset: u64, end: u64) -> Block {
        let last_ns = self.contents.blocks.last().map_or(0, |block| block.end_ns);
        Block {
            offset,
            end,
            start_ns: last_ns,
            end_ns: last_ns,
            counts: BTreeMap::new(),
            indexed: false,
            behind: self.behind,
        }
    }

    fn close(&mut self) {
        if let Some((block, _)) = self.open.take() {
            self.contents.blocks.push(block);
        }
    }

    /// Notes a damage; returns the byte from which records follow.
    fn go_on(
        &mut self,
        file: &mut File,
        path: &Path,
        size: u64,
        error: RecordError,
    ) -> Option<u64> {
        let damaged = error.place.byte;
        let is_last = self.contents.damages.len() + 1 >= MAX_DAMAGES;
        let chunk = Head::read(file, damaged, size);
        let chunk = chunk.ok().filter(|head| head.op == op::CHUNK);
        let is_cut = matches!(error.cause, Cause::Cut);
        let behind = chunk.as_ref().filter(|_| !is_cut).map(Head::end);
        let behind = behind.filter(|end| *end == size || Head::read(file, *end, size).is_ok());
        let next = match behind {
            _ if is_last => None,
            Some(end) => Some(end).filter(|end| *end < size),
            None => next_chunk(file, damaged + 1, size).unwrap_or_default(),
        };
        let error = match next {
            Some(_) => error.inside(),
            None => error,
        };
        let in_block = chunk.is_some() && !is_cut;
        if in_block {
            let is_there = self
                .contents
                .blocks
                .last()
                .is_some_and(|b| b.offset == damaged);
            if !is_there {
                let block = self.block(damaged, damaged + 1);
                self.contents.blocks.push(block);
            }
        }
        let error = error.in_file(path, size, self.contents.messages());
        self.contents.damages.push((error, in_block));
        self.behind = true;
        if !in_block {
            // Messages in it, if any, are searched by those who read behind damages.
            let block = self.block(damaged, next.unwrap_or(size));
            self.contents.blocks.push(block);
        }
        next
    }
}

/// Connection and log time, ns, of a message.
pub(super) fn message_fields(place: Place, record: &Record<'_>) -> Result<(u32, i64), RecordError> {
    let fields = record.fields;
    let connection = fields.u32("conn");
    let log_time_ns = fields.time_ns("time");
    connection
        .zip(log_time_ns)
        .ok_or_else(|| RecordError::bad(place, "a message without connection or time"))
}
