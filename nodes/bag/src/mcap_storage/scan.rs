//! Index of an MCAP file without a usable summary (unfinished, truncated or unchunked), from its records.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs::File,
    io::{self, Cursor, Seek, SeekFrom},
    ops::ControlFlow,
    path::Path,
};

use mcap::{records::op, sans_io::LinearReaderOptions};

use super::{
    contents::{Block, Contents, Seen},
    packed::unpack,
    records::{Place, RECORD_HEADER_BYTES, RecordError, parse_message, visit_chunk, visit_records},
    resume::next_chunk,
    salvage::{definitions, messages, messages_within, span_at},
};
use crate::{BagError, sniff::MCAP_MAGIC};

/// Target size of blocks of messages outside of chunks, bytes.
const RUN_BYTES: u64 = 1 << 20;

/// Limit of damages after which valid chunks are searched.
const MAX_DAMAGES: usize = 1000;
/// Size of the file's end that is searched for schemas and channels, which a summary repeats, bytes.
const MAX_SUMMARY_BYTES: u64 = 16 << 20;

/// Indexes a file up to the end of the data or the first damage; after it only blocks, without counts.
pub(super) fn scan(file: &mut File, path: &Path, size: u64) -> Contents {
    let mut scan = Scan::default();
    let ended = scan.records(file, MCAP_MAGIC.len() as u64, size);
    scan.end_run();
    let readable_messages = scan.contents.seen.messages;
    match ended {
        Ok(ControlFlow::Break(())) => {}
        Ok(ControlFlow::Continue(())) => scan.contents.damages.push(BagError::Truncated {
            path: path.to_path_buf(),
            size_bytes: size,
            inside: format!("the data section: a record is expected at byte {size}"),
            readable_messages,
        }),
        Err(error) => scan.go_on(file, path, size, error),
    }
    scan.contents
}

#[derive(Default)]
struct Scan {
    contents: Contents,
    /// Messages outside of chunks that are not in a block yet.
    run: Option<(Block, BTreeSet<u16>)>,
    /// True after a damage.
    behind: bool,
}

impl Scan {
    /// Adds the messages of the damaged part, the valid chunks after it, and the records after them.
    fn go_on(&mut self, file: &mut File, path: &Path, size: u64, error: RecordError) {
        let readable_messages = self.contents.seen.messages;
        self.behind = true;
        let summary = (size.saturating_sub(MAX_SUMMARY_BYTES), size);
        let found = definitions(file, summary, &mut self.contents);
        let mut error = Some(error);
        while let Some(damage) = error.take() {
            let damaged = damage.place.byte;
            let damage = damage.in_file(path, size, readable_messages);
            self.contents.damages.push(damage);
            let is_last = self.contents.damages.len() >= MAX_DAMAGES;
            let chunk = match is_last {
                true => None,
                false => next_chunk(file, damaged.saturating_add(1), size).unwrap_or_default(),
            };
            let stretch = (damaged, chunk.unwrap_or(size));
            let salvaged = match unpack(file, stretch) {
                Ok(Some(content)) => self.packed(file, stretch, &content),
                Ok(None) => definitions(file, stretch, &mut self.contents)
                    .and_then(|()| messages(file, stretch, &self.contents.channels)),
                Err(error) => Err(error),
            };
            match salvaged {
                Ok(blocks) => self.contents.blocks.extend(blocks),
                Err(error) => log::warn!("{}: {error}", path.display()),
            }
            if let Some(chunk) = chunk {
                error = self.records(file, chunk, size).err();
                self.end_run();
            }
        }
        if let Err(error) = found {
            log::warn!("{}: {error}", path.display());
        }
    }

    /// Adds the definitions of a damaged compressed chunk; the chunk as one block, if it has messages.
    fn packed(
        &mut self,
        file: &mut File,
        (start, end): (u64, u64),
        content: &[u8],
    ) -> io::Result<Vec<Block>> {
        let (mut content, part) = (Cursor::new(content), (0, content.len() as u64));
        definitions(&mut content, part, &mut self.contents)?;
        let span = span_at(file, start)?;
        let found = messages_within(&mut content, part, span, &self.contents.channels)?;
        let first_ns = found.iter().map(|block| block.start_ns).min();
        let last_ns = found.iter().map(|block| block.end_ns).max();
        let chunk = first_ns.zip(last_ns).map(|(start_ns, end_ns)| Block {
            offset: start,
            len: end.saturating_sub(start),
            opcode: op::CHUNK,
            start_ns,
            end_ns,
            channels: None,
            behind: true,
            unchecked: true,
        });
        Ok(chunk.into_iter().collect())
    }

    /// Takes the records from byte `start` on; breaks at the end of the data section.
    fn records(
        &mut self,
        file: &mut File,
        start: u64,
        size: u64,
    ) -> Result<ControlFlow<()>, RecordError> {
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
                    let reason = "opcode 0 is not valid; a crash may have left zeros";
                    return Err(RecordError::bad(place, reason));
                }
                _ => {}
            }
            Ok(ControlFlow::Continue(()))
        })
    }

    fn chunk(&mut self, byte: u64, body: &[u8]) -> Result<(), RecordError> {
        self.end_run();
        // Per channel, so that a chunk of many small messages needs no memory for them.
        let mut seen: BTreeMap<u16, (Place, Seen)> = BTreeMap::new();
        let mut records = Vec::new();
        // The content of a chunk counts only with a valid CRC.
        let header = visit_chunk(byte, body, &mut |place, opcode, body| {
            match opcode {
                op::MESSAGE => {
                    let (message, _) = parse_message(place, body)?;
                    let (_, of_channel) = seen
                        .entry(message.channel_id)
                        .or_insert((place, Seen::default()));
                    of_channel.add(Seen::one(message.log_time));
                }
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
            behind: self.behind,
            unchecked: false,
        };
        for (channel, (place, _)) in &seen {
            self.expect_channel(*place, *channel)?;
        }
        block.channels = Some(seen.keys().copied().collect());
        for (channel, (_, of_channel)) in seen {
            self.count(channel, of_channel);
            if let Some((first_ns, last_ns)) = of_channel.range_ns {
                block.start_ns = block.start_ns.min(first_ns);
                block.end_ns = block.end_ns.max(last_ns);
            }
        }
        self.contents.blocks.push(block);
        Ok(())
    }

    /// Adds a message outside of chunks.
    fn message(&mut self, place: Place, body: &[u8]) -> Result<(), RecordError> {
        let (message, _) = parse_message(place, body)?;
        let (channel, log_time_ns) = (message.channel_id, message.log_time);
        self.expect_channel(place, channel)?;
        self.count(channel, Seen::one(log_time_ns));
        let (block, channels) = self.run.get_or_insert_with(|| {
            let block = Block {
                offset: place.byte,
                len: 0,
                opcode: op::MESSAGE,
                start_ns: log_time_ns,
                end_ns: log_time_ns,
                channels: None,
                behind: self.behind,
                unchecked: false,
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

    fn expect_channel(&self, place: Place, channel: u16) -> Result<(), RecordError> {
        match self.contents.channels.contains_key(&channel) {
            true => Ok(()),
            false => Err(RecordError::bad(
                place,
                format!("a message of the undeclared channel {channel}"),
            )),
        }
    }

    fn count(&mut self, channel: u16, seen: Seen) {
        if self.behind {
            return;
        }
        *self.contents.counts.entry(channel).or_default() += seen.messages;
        self.contents.seen.add(seen);
    }
}
