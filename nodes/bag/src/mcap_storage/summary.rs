//! Index of a finished MCAP file, from the summary at its end.

use std::{
    fs::File,
    io::{Seek, SeekFrom},
    ops::ControlFlow,
};

use mcap::{
    records::{ChunkIndex, Record, Statistics, op},
    sans_io::LinearReaderOptions,
};

use super::{
    contents::{Block, Contents, Seen},
    lengths::parse_record,
    records::{Cause, RECORD_HEADER_BYTES, RecordError, first_record, visit_records},
};

/// Length of the footer record (9 + 20) and of the magic after it, bytes.
const TAIL_BYTES: u64 = 37;
/// Length of the data end record, which precedes the summary, bytes.
const DATA_END_BYTES: u64 = 13;
/// Longest accepted record of a summary, bytes.
const MAX_RECORD_BYTES: usize = 64 << 20;

/// Contents from the summary, or the reason to scan the file instead.
pub(super) fn read_summary(file: &mut File, size: u64) -> Result<Contents, String> {
    let start = summary_start(file, size)?;
    let mut found = Found::default();
    found.read(file, start, size)?;
    let Found {
        mut contents,
        statistics,
        chunks,
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
        contents.blocks.push(block(chunk, start)?);
    }
    contents.counts = statistics.channel_message_counts;
    contents.seen = Seen {
        messages: statistics.message_count,
        range_ns: (statistics.message_count > 0)
            .then_some((statistics.message_start_time, statistics.message_end_time)),
    };
    if !contents.is_complete() {
        return Err("its summary lacks schemas or channels".into());
    }
    Ok(contents)
}

fn summary_start(file: &mut File, size: u64) -> Result<u64, String> {
    let tail = size
        .checked_sub(TAIL_BYTES)
        .ok_or("it is shorter than a footer")?;
    let start = match first_record(file, tail, size) {
        Ok(Some((op::FOOTER, body))) => match parse_record(op::FOOTER, &body) {
            Ok(Record::Footer(footer)) => footer.summary_start,
            _ => return Err("its footer is invalid".into()),
        },
        _ => return Err("it does not end with a footer".into()),
    };
    match start {
        0 => Err("it has no summary".into()),
        DATA_END_BYTES.. if start <= tail => Ok(start),
        _ => Err(format!(
            "its summary starts at byte {start}, and its footer at {tail}"
        )),
    }
}

#[derive(Default)]
struct Found {
    contents: Contents,
    statistics: Option<Statistics>,
    chunks: Vec<ChunkIndex>,
}

impl Found {
    /// Reads from the end of the data section, so that the reader verifies the summary's CRC.
    fn read(&mut self, file: &mut File, start: u64, size: u64) -> Result<(), String> {
        let from = start.saturating_sub(DATA_END_BYTES);
        file.seek(SeekFrom::Start(from))
            .map_err(|e| e.to_string())?;
        let range = (from, size.saturating_sub(from));
        let options = LinearReaderOptions::default()
            .with_validate_summary_section_crc(true)
            .with_record_length_limit(MAX_RECORD_BYTES);
        visit_records(file, range, options, &mut |place, opcode, body| {
            if (place.byte == from) != (opcode == op::DATA_END) {
                let reason = "the data end record does not precede it";
                return Err(RecordError::bad(place, reason));
            }
            self.take(opcode, body)
                .map_err(|reason| RecordError::bad(place, reason))?;
            Ok(ControlFlow::Continue(()))
        })
        .map(|_| ())
        .map_err(|error| match error.cause {
            Cause::Bad(reason) => format!("its summary at {}: {reason}", error.place),
            _ => format!("its summary is truncated at {}", error.place),
        })
    }

    fn take(&mut self, opcode: u8, body: &[u8]) -> Result<(), String> {
        // Attachments are not used.
        match opcode {
            op::SCHEMA | op::CHANNEL => self.contents.take(opcode, body)?,
            op::CHUNK_INDEX | op::STATISTICS => match parse_record(opcode, body)? {
                Record::Statistics(statistics) => self.statistics = Some(statistics),
                Record::ChunkIndex(index) => self.chunks.push(index),
                _ => {}
            },
            _ => {}
        }
        Ok(())
    }
}

fn block(chunk: ChunkIndex, data_end: u64) -> Result<Block, String> {
    let (offset, len) = (chunk.chunk_start_offset, chunk.chunk_length);
    let ends_in_data = offset.checked_add(len).is_some_and(|end| end <= data_end);
    if !ends_in_data || len < RECORD_HEADER_BYTES {
        return Err(format!(
            "its summary places a chunk of {len} bytes at byte {offset}, outside the data"
        ));
    }
    let channels = chunk.message_index_offsets;
    Ok(Block {
        offset,
        len,
        opcode: op::CHUNK,
        start_ns: chunk.message_start_time,
        end_ns: chunk.message_end_time,
        channels: (!channels.is_empty()).then(|| channels.into_keys().collect()),
        behind: false,
        unchecked: false,
    })
}
