//! Reads an MCAP file from front to back where it has no usable summary: unfinished, cut or unchunked.

use std::{
    collections::BTreeSet,
    fs::File,
    io::{BufReader, Seek, SeekFrom},
    path::Path,
};

use mcap::records::op;

use super::{
    chunk::walk_chunk,
    contents::{Block, Contents},
    walk::{Event, RECORD_HEADER_BYTES, WalkError, record_header, record_name, walk},
};
use crate::{BagError, sniff::MCAP_MAGIC};

/// Messages outside of chunks are read in runs of about this many bytes.
const RUN_BYTES: u64 = 1 << 20;

/// Everything up to the end of the data or the first damage, which the contents then carry.
pub(super) fn scan(file: &mut BufReader<File>, path: &Path, size: u64) -> Contents {
    let mut scan = Scan {
        path,
        size,
        contents: Contents::default(),
        run: None,
    };
    if let Err(damage) = scan.records(file) {
        scan.contents.damage = Some(damage);
    }
    scan.end_run();
    scan.contents
}

struct Scan<'a> {
    path: &'a Path,
    size: u64,
    contents: Contents,
    /// Messages outside of chunks that are not yet a block.
    run: Option<(Block, BTreeSet<u16>)>,
}

impl Scan<'_> {
    fn records(&mut self, file: &mut BufReader<File>) -> Result<(), BagError> {
        let mut at = MCAP_MAGIC.len() as u64;
        loop {
            let left = self.size.saturating_sub(at);
            if left < RECORD_HEADER_BYTES {
                return Err(self.truncated(match left {
                    0 => format!("the data section: a record is due at byte {at}"),
                    _ => format!("a record at byte {at}"),
                }));
            }
            file.seek(SeekFrom::Start(at))
                .map_err(BagError::io(self.path, "read"))?;
            let (opcode, len) = record_header(file).map_err(BagError::io(self.path, "read"))?;
            if matches!(opcode, op::DATA_END | op::FOOTER) {
                return Ok(());
            }
            if opcode == 0 {
                return Err(self.bad(
                    at,
                    "opcode 0, which no record has; a crash may have left zeros".into(),
                ));
            }
            if len > left - RECORD_HEADER_BYTES {
                return Err(self.truncated(format!(
                    "a {} record of {len} bytes at byte {at}",
                    record_name(opcode)
                )));
            }
            match opcode {
                op::CHUNK => self.chunk(file, at, len)?,
                op::MESSAGE | op::SCHEMA | op::CHANNEL | op::METADATA => {
                    self.record(file, at, len)?
                }
                _ => {}
            }
            at += RECORD_HEADER_BYTES + len;
        }
    }

    fn chunk(&mut self, file: &mut BufReader<File>, at: u64, len: u64) -> Result<(), BagError> {
        self.end_run();
        let mut records = Vec::new();
        let mut messages = Vec::new();
        let walked = walk_chunk(file, at, len, &mut |_, event| {
            match event {
                Event::Message { header, .. } => {
                    messages.push((header.channel_id, header.log_time))
                }
                Event::Record { opcode, body } => records.push((opcode, body.to_vec())),
            }
            Ok(())
        });
        let header = walked.map_err(|e| self.walk_error(at, true, e))?;
        for (opcode, body) in records {
            self.take(at, opcode, &body)?;
        }
        let mut block = Block {
            offset: at,
            len,
            is_chunk: true,
            start_ns: header.start_ns,
            end_ns: header.end_ns,
            channels: None,
        };
        let mut channels = BTreeSet::new();
        for (channel, log_time_ns) in messages {
            self.known_channel(at, channel)?;
            self.contents.count(channel, log_time_ns);
            block.start_ns = block.start_ns.min(log_time_ns);
            block.end_ns = block.end_ns.max(log_time_ns);
            channels.insert(channel);
        }
        block.channels = Some(channels.into_iter().collect());
        self.contents.blocks.push(block);
        Ok(())
    }

    fn record(&mut self, file: &mut BufReader<File>, at: u64, len: u64) -> Result<(), BagError> {
        file.seek(SeekFrom::Start(at))
            .map_err(BagError::io(self.path, "read"))?;
        let mut message = None;
        let mut record = None;
        walk(file, RECORD_HEADER_BYTES + len, &mut |_, event| {
            match event {
                Event::Message { header, .. } => message = Some(header),
                Event::Record { opcode, body } => record = Some((opcode, body.to_vec())),
            }
            Ok(())
        })
        .map_err(|e| self.walk_error(at, false, e))?;
        if let Some((opcode, body)) = record {
            self.take(at, opcode, &body)?;
        }
        if let Some(header) = message {
            self.known_channel(at, header.channel_id)?;
            self.contents.count(header.channel_id, header.log_time);
            self.extend_run(at, len, header.channel_id, header.log_time);
        }
        Ok(())
    }

    fn extend_run(&mut self, at: u64, len: u64, channel: u16, log_time_ns: u64) {
        let (block, channels) = self.run.get_or_insert_with(|| {
            let block = Block {
                offset: at,
                len: 0,
                is_chunk: false,
                start_ns: log_time_ns,
                end_ns: log_time_ns,
                channels: None,
            };
            (block, BTreeSet::new())
        });
        block.len = (at - block.offset) + RECORD_HEADER_BYTES + len;
        block.start_ns = block.start_ns.min(log_time_ns);
        block.end_ns = block.end_ns.max(log_time_ns);
        channels.insert(channel);
        if block.len >= RUN_BYTES {
            self.end_run();
        }
    }

    fn end_run(&mut self) {
        if let Some((mut block, channels)) = self.run.take() {
            block.channels = Some(channels.into_iter().collect());
            self.contents.blocks.push(block);
        }
    }

    fn take(&mut self, at: u64, opcode: u8, body: &[u8]) -> Result<(), BagError> {
        let taken = self.contents.take(opcode, body);
        taken.map_err(|reason| self.bad(at, format!("a {} record: {reason}", record_name(opcode))))
    }

    fn known_channel(&self, at: u64, channel: u16) -> Result<(), BagError> {
        match self.contents.channels.contains_key(&channel) {
            true => Ok(()),
            false => Err(self.bad(
                at,
                format!("a message of channel {channel}, which no record announced"),
            )),
        }
    }

    fn walk_error(&self, at: u64, in_chunk: bool, error: WalkError) -> BagError {
        walk_error(self.path, at, in_chunk, error)
    }

    fn bad(&self, at: u64, reason: String) -> BagError {
        walk_error(self.path, at, false, WalkError::Bad { at: 0, reason })
    }

    fn truncated(&self, inside: String) -> BagError {
        BagError::Truncated {
            path: self.path.to_path_buf(),
            size_bytes: self.size,
            inside,
            readable_messages: self.contents.message_count,
        }
    }
}

/// Places an error of a walk that began at byte `base` of the file.
pub(super) fn walk_error(path: &Path, base: u64, in_chunk: bool, error: WalkError) -> BagError {
    let position = |at: u64| match in_chunk {
        true => format!("byte {at} of the content of the chunk at byte {base}"),
        false => format!("byte {}", base.saturating_add(at)),
    };
    match error {
        WalkError::Bad { at, reason } => BagError::corrupt(
            path,
            position(at),
            reason,
            "take another copy, or rescue the rest with `mcap recover`",
        ),
        WalkError::TooLarge {
            what,
            at,
            size_bytes,
            limit_bytes,
        } => BagError::TooLarge {
            path: path.to_path_buf(),
            what,
            position: position(at),
            size_bytes,
            limit_bytes,
            remedy: "drop or sort topics with `mcap filter`, or record smaller messages",
        },
    }
}
