//! Index of an MCAP file without a usable summary (unfinished, cut or unchunked), from its records.

use std::{
    collections::BTreeSet,
    fs::File,
    io::{Seek, SeekFrom},
    ops::ControlFlow,
    path::Path,
};

use mcap::{records::op, sans_io::LinearReaderOptions};

use super::{
    contents::{Block, Contents},
    records::{Place, RECORD_HEADER_BYTES, RecordError, parse_message, visit_chunk, visit_records},
};
use crate::{BagError, sniff::MCAP_MAGIC};

/// Messages outside of chunks are read in runs of about this many bytes.
const RUN_BYTES: u64 = 1 << 20;

/// Everything up to the end of the data or the first damage, which the contents then carry.
pub(super) fn scan(file: &mut File, path: &Path, size: u64) -> Contents {
    let mut scan = Scan::default();
    let ended = scan.records(file, size);
    scan.end_run();
    let mut contents = scan.contents;
    let readable_messages = contents.message_count;
    contents.damage = match ended {
        Ok(ControlFlow::Break(())) => None,
        Ok(ControlFlow::Continue(())) => Some(BagError::Truncated {
            path: path.to_path_buf(),
            size_bytes: size,
            inside: format!("the data section: a record is due at byte {size}"),
            readable_messages,
        }),
        Err(error) => Some(error.in_file(path, size, readable_messages)),
    };
    contents
}

#[derive(Default)]
struct Scan {
    contents: Contents,
    /// Messages outside of chunks that are not yet a block.
    run: Option<(Block, BTreeSet<u16>)>,
}

impl Scan {
    /// Breaks at the end of the data section.
    fn records(&mut self, file: &mut File, size: u64) -> Result<ControlFlow<()>, RecordError> {
        let start = MCAP_MAGIC.len() as u64;
        file.seek(SeekFrom::Start(start))
            .map_err(|error| RecordError::bad(Place::in_file(start), error))?;
        let range = (start, size.saturating_sub(start));
        let options = LinearReaderOptions::default().with_skip_end_magic(true);
        visit_records(file, range, options, &mut |place, opcode, body| {
            match opcode {
                op::DATA_END | op::FOOTER => return Ok(ControlFlow::Break(())),
                op::CHUNK => self.chunk(place.byte, body)?,
                op::MESSAGE => self.message(place, body)?,
                op::SCHEMA | op::CHANNEL => self.take(place, opcode, body)?,
                0 => {
                    let reason = "opcode 0, which no record has; a crash may have left zeros";
                    return Err(RecordError::bad(place, reason));
                }
                _ => {}
            }
            Ok(ControlFlow::Continue(()))
        })
    }

    fn chunk(&mut self, byte: u64, body: &[u8]) -> Result<(), RecordError> {
        self.end_run();
        let mut messages = Vec::new();
        let mut records = Vec::new();
        // The content of a chunk counts only once its CRC is right.
        let header = visit_chunk(byte, body, &mut |place, opcode, body| {
            match opcode {
                op::MESSAGE => messages.push((place, parse_message(place, body)?.0)),
                op::SCHEMA | op::CHANNEL => records.push((place, opcode, body.to_vec())),
                _ => {}
            }
            Ok(())
        })?;
        for (place, opcode, body) in records {
            self.take(place, opcode, &body)?;
        }
        let mut block = Block {
            offset: byte,
            len: RECORD_HEADER_BYTES + body.len() as u64,
            opcode: op::CHUNK,
            start_ns: header.message_start_time,
            end_ns: header.message_end_time,
            channels: None,
        };
        let mut channels = BTreeSet::new();
        for (place, message) in messages {
            self.count(place, message.channel_id, message.log_time)?;
            block.start_ns = block.start_ns.min(message.log_time);
            block.end_ns = block.end_ns.max(message.log_time);
            channels.insert(message.channel_id);
        }
        block.channels = Some(channels.into_iter().collect());
        self.contents.blocks.push(block);
        Ok(())
    }

    /// Takes a message outside of chunks.
    fn message(&mut self, place: Place, body: &[u8]) -> Result<(), RecordError> {
        let (message, _) = parse_message(place, body)?;
        let (channel, log_time_ns) = (message.channel_id, message.log_time);
        self.count(place, channel, log_time_ns)?;
        let (block, channels) = self.run.get_or_insert_with(|| {
            let block = Block {
                offset: place.byte,
                len: 0,
                opcode: op::MESSAGE,
                start_ns: log_time_ns,
                end_ns: log_time_ns,
                channels: None,
            };
            (block, BTreeSet::new())
        });
        block.len = (place.byte - block.offset) + RECORD_HEADER_BYTES + body.len() as u64;
        block.start_ns = block.start_ns.min(log_time_ns);
        block.end_ns = block.end_ns.max(log_time_ns);
        channels.insert(channel);
        if block.len >= RUN_BYTES {
            self.end_run();
        }
        Ok(())
    }

    fn end_run(&mut self) {
        if let Some((mut block, channels)) = self.run.take() {
            block.channels = Some(channels.into_iter().collect());
            self.contents.blocks.push(block);
        }
    }

    fn take(&mut self, place: Place, opcode: u8, body: &[u8]) -> Result<(), RecordError> {
        let taken = self.contents.take(opcode, body);
        taken.map_err(|reason| RecordError::bad(place, reason))
    }

    fn count(&mut self, place: Place, channel: u16, log_time_ns: u64) -> Result<(), RecordError> {
        if !self.contents.channels.contains_key(&channel) {
            let reason = format!("a message of channel {channel}, which no record announced");
            return Err(RecordError::bad(place, reason));
        }
        self.contents.count(channel, log_time_ns);
        Ok(())
    }
}
