//! Reads the summary at the end of a finished MCAP file, so that chunks can be found by time.

use std::{
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
};

use mcap::records::{ChunkIndex, MetadataIndex, Record, Statistics, op};

use super::{
    contents::{Block, Contents, is_wanted},
    walk::{RECORD_HEADER_BYTES, read_body, record_header},
};
use crate::sniff::MCAP_MAGIC;

/// Footer record (9 + 20 bytes) and magic.
const TAIL_BYTES: u64 = 37;
/// Bytes of the footer that its CRC covers.
const FOOTER_HASHED_BYTES: usize = 25;

struct Footer {
    start: u64,
    crc: u32,
    hashed: [u8; FOOTER_HASHED_BYTES],
}

/// The contents that the summary tells, or why the file has to be scanned instead.
pub(super) fn read_summary(file: &mut BufReader<File>, size: u64) -> Result<Contents, String> {
    let footer = read_footer(file, size)?;
    let end = size.saturating_sub(TAIL_BYTES);
    if footer.start == 0 {
        return Err("it has no summary".into());
    }
    if footer.start > end {
        return Err(format!(
            "its summary starts at byte {}, beyond the footer at {end}",
            footer.start
        ));
    }
    let mut found = Found::default();
    found.read(file, &footer, end)?;
    let Found {
        mut contents,
        statistics,
        chunks,
        metadata,
        ..
    } = found;
    let statistics = statistics.ok_or("its summary lacks statistics")?;
    if chunks.len() as u64 != u64::from(statistics.chunk_count) {
        return Err(format!(
            "its summary indexes {} of {} chunks",
            chunks.len(),
            statistics.chunk_count
        ));
    }
    if chunks.is_empty() && statistics.message_count > 0 {
        return Err("its messages are not in chunks".into());
    }
    for chunk in chunks {
        contents.blocks.push(block(&chunk, footer.start)?);
    }
    contents.message_count = statistics.message_count;
    contents.counts = statistics.channel_message_counts;
    contents.range_ns = (statistics.message_count > 0)
        .then_some((statistics.message_start_time, statistics.message_end_time));
    if !contents.is_complete() {
        return Err("its summary lacks schemas or channels".into());
    }
    for index in metadata.iter().filter(|index| index.name == "rosbag2") {
        read_metadata(file, index, &mut contents);
    }
    Ok(contents)
}

fn read_footer(file: &mut BufReader<File>, size: u64) -> Result<Footer, String> {
    let mut tail = [0; TAIL_BYTES as usize];
    let at = size
        .checked_sub(TAIL_BYTES)
        .ok_or("it is shorter than a footer")?;
    file.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
    file.read_exact(&mut tail).map_err(|e| e.to_string())?;
    let [opcode, l0, l1, l2, l3, l4, l5, l6, l7, ..] = tail;
    let (hashed, rest) = tail
        .split_first_chunk::<FOOTER_HASHED_BYTES>()
        .ok_or("short footer")?;
    let (crc, magic) = rest.split_first_chunk::<4>().ok_or("short footer")?;
    let len = u64::from_le_bytes([l0, l1, l2, l3, l4, l5, l6, l7]);
    if magic != MCAP_MAGIC || opcode != op::FOOTER || len != 20 {
        return Err("it does not end with a footer".into());
    }
    let start = hashed
        .get(9..17)
        .and_then(|bytes| bytes.try_into().ok())
        .map(u64::from_le_bytes);
    Ok(Footer {
        start: start.ok_or("short footer")?,
        crc: u32::from_le_bytes(*crc),
        hashed: *hashed,
    })
}

#[derive(Default)]
struct Found {
    contents: Contents,
    statistics: Option<Statistics>,
    chunks: Vec<ChunkIndex>,
    metadata: Vec<MetadataIndex>,
}

impl Found {
    fn read(
        &mut self,
        file: &mut BufReader<File>,
        footer: &Footer,
        end: u64,
    ) -> Result<(), String> {
        file.seek(SeekFrom::Start(footer.start))
            .map_err(|e| e.to_string())?;
        let mut hasher = crc32fast::Hasher::new();
        let mut left = end.saturating_sub(footer.start);
        while left > 0 {
            let (opcode, len) = record_header(file).map_err(|e| format!("its summary: {e}"))?;
            let room = left.saturating_sub(RECORD_HEADER_BYTES);
            if len > room {
                return Err(format!(
                    "its summary holds a record of {len} bytes where {room} are left"
                ));
            }
            let body = read_body(file, len).map_err(|_| {
                format!("its summary holds a record of {len} bytes that cannot be read")
            })?;
            hasher.update(&[opcode]);
            hasher.update(&len.to_le_bytes());
            hasher.update(&body);
            if is_wanted(opcode) {
                self.take(opcode, &body)?;
            }
            left = room.saturating_sub(len);
        }
        hasher.update(&footer.hashed);
        let calculated = hasher.finalize();
        match footer.crc {
            0 => Ok(()),
            saved if saved == calculated => Ok(()),
            saved => Err(format!(
                "its summary has CRC {calculated:08X}, where {saved:08X} is stored"
            )),
        }
    }

    fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        match mcap::parse_record(opcode, body).map_err(|e| format!("its summary: {e}"))? {
            Record::Statistics(statistics) => self.statistics = Some(statistics),
            Record::ChunkIndex(index) => self.chunks.push(index),
            Record::MetadataIndex(index) => self.metadata.push(index),
            _ => self.contents.take(opcode, body)?,
        }
        Ok(())
    }
}

fn block(chunk: &ChunkIndex, data_end: u64) -> Result<Block, String> {
    let offset = chunk.chunk_start_offset;
    let end = offset.checked_add(chunk.chunk_length);
    let len = chunk.chunk_length.checked_sub(RECORD_HEADER_BYTES);
    match (end, len) {
        (Some(end), Some(len)) if end <= data_end => Ok(Block {
            offset,
            len,
            is_chunk: true,
            start_ns: chunk.message_start_time,
            end_ns: chunk.message_end_time,
            channels: (!chunk.message_index_offsets.is_empty())
                .then(|| chunk.message_index_offsets.keys().copied().collect()),
        }),
        _ => Err(format!(
            "its summary places a chunk of {} bytes at byte {offset}, beyond the data",
            chunk.chunk_length
        )),
    }
}

/// Metadata is a bonus: what cannot be read is left out.
fn read_metadata(file: &mut BufReader<File>, index: &MetadataIndex, contents: &mut Contents) {
    let Ok(_) = file.seek(SeekFrom::Start(index.offset)) else {
        return;
    };
    let Ok((op::METADATA, len)) = record_header(file) else {
        return;
    };
    let Ok(body) = read_body(file, len) else {
        return;
    };
    if let Ok(Record::Metadata(record)) = mcap::parse_record(op::METADATA, &body) {
        contents.take_metadata(&record);
    }
}
