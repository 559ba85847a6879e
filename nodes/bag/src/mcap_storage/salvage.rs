//! Recovery of individual records from a damaged part of an MCAP file.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use mcap::records::{Record, op};

use super::{
    contents::{Block, Contents},
    lengths::parse_record,
    records::RECORD_HEADER_BYTES,
};
use crate::{MAX_MESSAGE_BYTES, sniff::ZSTD_MAGIC};

/// Bytes per read.
const WINDOW_BYTES: u64 = 1 << 20;
/// Head of a message record: opcode, length, channel, sequence and two times, then the CDR header.
const MESSAGE_HEAD_BYTES: usize = 9 + 22 + 4;
/// Head of a chunk up to its times: opcode, length, first and last log time.
const CHUNK_SPAN_BYTES: usize = 9 + 16;
/// Valid log times, ns since the Unix epoch.
const ALL_TIMES: (u64, u64) = (0, i64::MAX as u64);
/// Longest recovered record of a schema or channel, bytes.
const MAX_DEFINITION_BYTES: u64 = 1 << 20;
/// Highest representation identifier of CDR (DDS-XTypes 1.3, table 60).
const MAX_REPRESENTATION: u8 = 0x0b;
/// Target size of blocks of consecutive messages, bytes.
const RUN_BYTES: u64 = 1 << 20;

/// Random access to bytes through a buffered window.
struct Window<'a, R> {
    source: &'a mut R,
    bytes: Vec<u8>,
    start: u64,
    /// End of the part, bytes from the start of the source.
    end: u64,
}

impl<'a, R: Read + Seek> Window<'a, R> {
    fn new(source: &'a mut R, end: u64) -> Window<'a, R> {
        Window {
            source,
            bytes: Vec::new(),
            start: 0,
            end,
        }
    }

    /// Up to `count` bytes at byte `at`, fewer at the end of the part.
    fn at(&mut self, at: u64, count: usize) -> io::Result<&[u8]> {
        let left = self.end.saturating_sub(at);
        let count = count.min(usize::try_from(left).unwrap_or(usize::MAX));
        let has = |window: &Window<'_, R>| {
            let from = usize::try_from(at.checked_sub(window.start)?).ok()?;
            let to = from.checked_add(count)?;
            (to <= window.bytes.len()).then_some(from..to)
        };
        if has(self).is_none() {
            self.source.seek(SeekFrom::Start(at))?;
            self.bytes.clear();
            self.start = at;
            let most = WINDOW_BYTES.max(count as u64).min(left);
            let mut part = self.source.by_ref().take(most);
            part.read_to_end(&mut self.bytes)?;
        }
        let found = has(self).and_then(|range| self.bytes.get(range));
        Ok(found.unwrap_or_default())
    }
}

/// A plausible record head.
#[derive(Clone, Copy)]
struct Head {
    opcode: u8,
    /// Length of its body, bytes.
    len: u64,
}

impl Head {
    /// Length of the record, bytes.
    fn bytes(self) -> u64 {
        RECORD_HEADER_BYTES + self.len
    }
}

fn number(bytes: &[u8], from: usize, count: usize) -> Option<u64> {
    let part = bytes.get(from..from + count)?;
    Some(part.iter().rev().fold(0, |n, &b| n << 8 | u64::from(b)))
}

/// Head of any record type that ends within `left` bytes.
fn any_head(head: &[u8], left: u64) -> Option<Head> {
    let opcode = *head.first()?;
    let len = number(head, 1, 8)?;
    let fits = len <= left.saturating_sub(RECORD_HEADER_BYTES);
    (fits && (op::HEADER..=op::DATA_END).contains(&opcode)).then_some(Head { opcode, len })
}

/// Head of a message of a known channel, with a CDR header or that of a zstd frame.
fn message_head<V>(head: &[u8], left: u64, bounds: &MessageBounds<'_, V>) -> Option<Head> {
    let found = any_head(head, left).filter(|found| found.opcode == op::MESSAGE)?;
    let shortest = MESSAGE_HEAD_BYTES as u64 - RECORD_HEADER_BYTES;
    let channel = u16::try_from(number(head, 9, 2)?).ok()?;
    let log_time = number(head, 15, 8)?;
    let data = head.get(31..MESSAGE_HEAD_BYTES)?;
    let is_cdr = matches!(data, [0, ..=MAX_REPRESENTATION, ..]);
    let is_message = (shortest..=MAX_MESSAGE_BYTES + 22).contains(&found.len)
        && bounds.channels.contains_key(&channel)
        && (bounds.span.0..=bounds.span.1).contains(&log_time)
        && (is_cdr || data.starts_with(ZSTD_MAGIC));
    is_message.then_some(found)
}

/// Recovers schemas and channels between two bytes of a file, if they parse without contradiction.
pub(super) fn definitions(
    source: &mut (impl Read + Seek),
    (start, end): (u64, u64),
    contents: &mut Contents,
) -> io::Result<()> {
    let mut window = Window::new(source, end);
    let mut at = start;
    while at < end {
        let left = end - at;
        let head = any_head(window.at(at, RECORD_HEADER_BYTES as usize)?, left);
        let head = head.filter(|head| {
            [op::SCHEMA, op::CHANNEL].contains(&head.opcode) && head.len <= MAX_DEFINITION_BYTES
        });
        let Some(head) = head else {
            at += 1;
            continue;
        };
        let bytes = usize::try_from(head.bytes()).unwrap_or(usize::MAX);
        let record = window.at(at, bytes)?;
        let body = record
            .get(RECORD_HEADER_BYTES as usize..)
            .unwrap_or_default();
        let is_definition = match parse_record(head.opcode, body) {
            Ok(Record::Schema { header, .. }) => header.id != 0 && is_name(&header.name),
            Ok(Record::Channel(channel)) => {
                is_name(&channel.topic) && is_name(&channel.message_encoding)
            }
            _ => false,
        };
        let taken = is_definition && contents.take(head.opcode, body).is_ok();
        at += if taken { head.bytes() } else { 1 };
    }
    Ok(())
}

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_graphic())
}

/// Blocks of messages between two bytes of the file, with a wrong or missing checksum.
///
/// A message is accepted if its head is plausible and is followed by a plausible record, or by nothing that could be
/// a message. In a chunk its time must lie within that of the chunk, unless no message's does.
pub(super) fn messages<V>(
    file: &mut File,
    (start, end): (u64, u64),
    channels: &BTreeMap<u16, V>,
) -> io::Result<Vec<Block>> {
    let span = span_at(file, start)?;
    messages_within(file, (start, end), span, channels)
}

/// Span of the log times of the chunk at a byte of the file.
pub(super) fn span_at(file: &mut File, start: u64) -> io::Result<Option<(u64, u64)>> {
    let mut window = Window::new(file, start.saturating_add(CHUNK_SPAN_BYTES as u64));
    Ok(chunk_span(window.at(start, CHUNK_SPAN_BYTES)?))
}

/// Blocks of messages between two bytes of a source, such as the content of a chunk with a known span of log times.
pub(super) fn messages_within<V>(
    source: &mut (impl Read + Seek),
    (start, end): (u64, u64),
    span: Option<(u64, u64)>,
    channels: &BTreeMap<u16, V>,
) -> io::Result<Vec<Block>> {
    let mut window = Window::new(source, end);
    let of = |span| MessageBounds { channels, span };
    let found = runs(&mut window, start, &of(span.unwrap_or(ALL_TIMES)))?;
    match span {
        Some(_) if found.is_empty() => runs(&mut window, start, &of(ALL_TIMES)),
        _ => Ok(found),
    }
}

/// First and last log time of a chunk, from its head.
fn chunk_span(head: &[u8]) -> Option<(u64, u64)> {
    let span = (number(head, 9, 8)?, number(head, 17, 8)?);
    (head.first() == Some(&op::CHUNK) && span.0 <= span.1).then_some(span)
}

/// Known channels and log time range of the messages in a part.
struct MessageBounds<'a, V> {
    channels: &'a BTreeMap<u16, V>,
    /// First and last log time, ns.
    span: (u64, u64),
}

fn runs<V>(
    window: &mut Window<'_, impl Read + Seek>,
    start: u64,
    bounds: &MessageBounds<'_, V>,
) -> io::Result<Vec<Block>> {
    let end = window.end;
    let mut runs = Runs::default();
    let mut next = next_message(window, start, bounds)?;
    while let Some((at, head)) = next {
        let behind = at + head.bytes();
        let follows = window.at(behind, RECORD_HEADER_BYTES as usize)?;
        let is_followed = behind == end || any_head(follows, end - behind).is_some();
        // An excessive length would hide the message after it.
        let inside = match is_followed {
            true => None,
            false => next_message(window, at + 1, bounds)?.filter(|(at, _)| *at < behind),
        };
        next = match inside {
            Some(inside) => Some(inside),
            None => {
                let head_bytes = window.at(at, MESSAGE_HEAD_BYTES)?;
                runs.add(at, head.bytes(), head_bytes);
                next_message(window, behind, bounds)?
            }
        };
    }
    runs.end();
    Ok(runs.blocks)
}

fn next_message<V>(
    window: &mut Window<'_, impl Read + Seek>,
    from: u64,
    bounds: &MessageBounds<'_, V>,
) -> io::Result<Option<(u64, Head)>> {
    for at in from..window.end {
        let left = window.end - at;
        if let Some(head) = message_head(window.at(at, MESSAGE_HEAD_BYTES)?, left, bounds) {
            return Ok(Some((at, head)));
        }
    }
    Ok(None)
}

/// Consecutive messages without a gap.
#[derive(Default)]
struct Runs {
    blocks: Vec<Block>,
    open: Option<(Block, BTreeSet<u16>)>,
}

impl Runs {
    fn add(&mut self, at: u64, bytes: u64, head: &[u8]) {
        let channel = number(head, 9, 2).and_then(|id| u16::try_from(id).ok());
        let (Some(channel), Some(log_time)) = (channel, number(head, 15, 8)) else {
            return;
        };
        let goes_on =
            |(block, _): &(Block, _)| block.offset + block.len == at && block.len < RUN_BYTES;
        if !self.open.as_ref().is_some_and(goes_on) {
            self.end();
        }
        let (block, channels) = self.open.get_or_insert_with(|| {
            let block = Block {
                offset: at,
                len: 0,
                opcode: op::MESSAGE,
                start_ns: log_time,
                end_ns: log_time,
                channels: None,
                behind: true,
                unchecked: true,
            };
            (block, BTreeSet::new())
        });
        block.len += bytes;
        block.start_ns = block.start_ns.min(log_time);
        block.end_ns = block.end_ns.max(log_time);
        channels.insert(channel);
    }

    fn end(&mut self) {
        if let Some((mut block, channels)) = self.open.take() {
            block.channels = Some(channels.into_iter().collect());
            self.blocks.push(block);
        }
    }
}
