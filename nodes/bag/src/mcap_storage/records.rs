//! Records of an MCAP file (<https://mcap.dev/spec>): the `mcap` crate's reader with bounded input.

use std::{
    fmt,
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    ops::ControlFlow,
    path::Path,
};

use mcap::{
    McapError,
    records::{ChunkHeader, MessageHeader, Record, op},
    sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use super::lengths::parse_record;
use crate::{BagError, MAX_MESSAGE_BYTES};

/// Length of a record's opcode and length field, bytes.
pub(super) const RECORD_HEADER_BYTES: u64 = 9;
/// Longest accepted record, chunks included, bytes.
const MAX_RECORD_BYTES: usize = 2 << 30;
/// Longest accepted record in a chunk, bytes: a message with its 22-byte header.
const MAX_CHUNK_RECORD_BYTES: u64 = MAX_MESSAGE_BYTES + 22;
/// Largest compression ratio: zstd encodes a run of 128 KiB in 4 bytes.
const MAX_CHUNK_RATIO: u64 = 1 << 15;
/// Length of a chunk record without compression name and content, bytes.
pub(super) const CHUNK_HEADER_BYTES: usize = 40;
/// Bytes per read; memory grows with the available data, not with stated lengths.
const READ_BYTES: usize = 1 << 16;

/// Position of a record in its file, or in the content of the chunk at that byte.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub byte: u64,
    pub in_chunk: Option<u64>,
}

impl Place {
    pub(super) fn in_file(byte: u64) -> Place {
        Place {
            byte,
            in_chunk: None,
        }
    }

    fn advance(&mut self, bytes: u64) {
        let at = self.in_chunk.as_mut().unwrap_or(&mut self.byte);
        *at = at.saturating_add(bytes);
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.in_chunk {
            None => write!(f, "byte {}", self.byte),
            Some(at) => write!(
                f,
                "byte {at} of the content of the chunk at byte {}",
                self.byte
            ),
        }
    }
}

/// Error of reading records, with its position.
#[derive(Debug)]
pub(super) struct RecordError {
    pub place: Place,
    pub cause: Cause,
}

#[derive(Debug)]
pub(super) enum Cause {
    /// The data end inside the record.
    Cut,
    Bad(String),
    TooLarge {
        what: &'static str,
        size_bytes: u64,
        limit_bytes: u64,
    },
}

impl RecordError {
    pub(super) fn bad(place: Place, reason: impl ToString) -> RecordError {
        let cause = Cause::Bad(reason.to_string());
        RecordError { place, cause }
    }

    /// Error for a file of `size_bytes` with `readable_messages` before the damage.
    pub(super) fn in_file(self, path: &Path, size_bytes: u64, readable_messages: u64) -> BagError {
        let path = path.to_path_buf();
        match self.cause {
            Cause::Cut => BagError::Truncated {
                path,
                size_bytes,
                inside: format!("a record at {}", self.place),
                readable_messages,
            },
            Cause::Bad(reason) => BagError::Corrupt {
                path,
                position: self.place.to_string(),
                reason,
                remedy: "take another copy, or rescue the rest with `lattice bag recover`",
            },
            Cause::TooLarge {
                what,
                size_bytes,
                limit_bytes,
            } => BagError::TooLarge {
                path,
                what,
                position: self.place.to_string(),
                size_bytes,
                limit_bytes,
                remedy: "drop or sort topics with `mcap filter`, or record smaller messages",
            },
        }
    }
}

/// Callback with a record's position, opcode and body.
type Visit<'a> = dyn FnMut(Place, u8, &[u8]) -> Result<ControlFlow<()>, RecordError> + 'a;

/// Callback for a record in a chunk; the next one always follows.
type VisitInChunk<'a> = dyn FnMut(Place, u8, &[u8]) -> Result<(), RecordError> + 'a;

/// Calls `visit` for each record in `source`, the `len` bytes of a file from byte `start` on, until
/// it breaks. Chunks are passed as a whole.
pub(super) fn visit_records(
    source: impl Read,
    (start, len): (u64, u64),
    options: LinearReaderOptions,
    visit: &mut Visit<'_>,
) -> Result<ControlFlow<()>, RecordError> {
    let limit = options.record_length_limit.unwrap_or(MAX_RECORD_BYTES);
    let options = options
        .with_emit_chunks(true)
        .with_record_length_limit(limit);
    feed(source.take(len), len, options, Place::in_file(start), visit)
}

/// Calls `visit` for each record in the chunk record `body` at `byte` of its file. The chunk's CRC
/// is verified after its last record.
pub(super) fn visit_chunk(
    byte: u64,
    body: &[u8],
    visit: &mut VisitInChunk<'_>,
) -> Result<ChunkHeader, RecordError> {
    let header = match parse_record(op::CHUNK, body) {
        Ok(Record::Chunk { header, .. }) => header,
        Ok(_) => return Err(RecordError::bad(Place::in_file(byte), "no chunk record")),
        Err(error) => return Err(RecordError::bad(Place::in_file(byte), error)),
    };
    // Without padding after the content: the reader would subtract a record that extends into it.
    let content_bytes = usize::try_from(header.compressed_size).unwrap_or(usize::MAX);
    let unpadded = CHUNK_HEADER_BYTES
        .saturating_add(header.compression.len())
        .saturating_add(content_bytes);
    let body = body.get(..unpadded).unwrap_or(body);
    let len = (body.len() as u64).to_le_bytes();
    let framed = (&[op::CHUNK][..]).chain(&len[..]).chain(body);
    // The stated size is not trusted; the available bytes bound it.
    let limit = (body.len() as u64)
        .saturating_mul(MAX_CHUNK_RATIO)
        .min(header.uncompressed_size)
        .clamp(READ_BYTES as u64, MAX_CHUNK_RECORD_BYTES);
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(usize::try_from(limit).unwrap_or(usize::MAX));
    let start = Place {
        byte,
        in_chunk: Some(0),
    };
    let mut visit = |place, opcode, body: &[u8]| match opcode {
        0 | op::CHUNK => Err(RecordError::bad(
            place,
            format!("opcode {opcode} in a chunk"),
        )),
        _ => visit(place, opcode, body).map(ControlFlow::Continue),
    };
    match feed(framed, header.uncompressed_size, options, start, &mut visit) {
        Ok(_) => Ok(header),
        // A truncated chunk does not truncate the file.
        Err(RecordError {
            place,
            cause: Cause::Cut,
        }) => Err(RecordError::bad(place, "the chunk ends inside a record")),
        Err(error) => Err(error),
    }
}

/// Opcode and body of the record at byte `start` of a file of `size` bytes; `None` at its end.
pub(super) fn first_record(
    file: &mut File,
    start: u64,
    size: u64,
) -> Result<Option<(u8, Vec<u8>)>, RecordError> {
    file.seek(SeekFrom::Start(start))
        .map_err(|error| RecordError::bad(Place::in_file(start), error))?;
    let mut first = None;
    let range = (start, size.saturating_sub(start));
    let options = LinearReaderOptions::default().with_skip_end_magic(true);
    let _ = visit_records(file, range, options, &mut |_, opcode, body| {
        first = Some((opcode, body.to_vec()));
        Ok(ControlFlow::Break(()))
    })?;
    Ok(first)
}

/// Header and data of a message record.
pub(super) fn parse_message(
    place: Place,
    body: &[u8],
) -> Result<(MessageHeader, &[u8]), RecordError> {
    let parsed = parse_record(op::MESSAGE, body);
    match parsed.map_err(|error| RecordError::bad(place, error))? {
        Record::Message {
            header,
            data: std::borrow::Cow::Borrowed(data),
        } if data.len() as u64 <= MAX_MESSAGE_BYTES => Ok((header, data)),
        _ => Err(RecordError {
            place,
            cause: Cause::TooLarge {
                what: "a message",
                size_bytes: body.len() as u64,
                limit_bytes: MAX_MESSAGE_BYTES,
            },
        }),
    }
}

/// Feeds a reader from `source`, whose records take `len` bytes, the first one at `place`.
fn feed(
    mut source: impl Read,
    len: u64,
    options: LinearReaderOptions,
    mut place: Place,
    visit: &mut Visit<'_>,
) -> Result<ControlFlow<()>, RecordError> {
    let limit_bytes = options
        .record_length_limit
        .map_or(u64::MAX, |limit| limit as u64);
    let mut reader = LinearReader::new_with_options(options.with_skip_start_magic(true));
    while let Some(event) = reader.next_event() {
        let event = event.map_err(|error| RecordError {
            place,
            cause: cause(error, len, limit_bytes),
        })?;
        match event {
            LinearReadEvent::ReadRequest(_) => {
                let read = read(&mut source, reader.insert(READ_BYTES));
                reader.notify_read(read.map_err(|error| RecordError::bad(place, error))?);
            }
            LinearReadEvent::Record { data, opcode } => {
                if visit(place, opcode, data)?.is_break() {
                    return Ok(ControlFlow::Break(()));
                }
                place.advance(RECORD_HEADER_BYTES + data.len() as u64);
            }
        }
    }
    Ok(ControlFlow::Continue(()))
}

fn read(source: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
}

fn cause(error: McapError, len: u64, limit_bytes: u64) -> Cause {
    match error {
        McapError::UnexpectedEof => Cause::Cut,
        McapError::RecordTooLarge { len: claimed, .. } if claimed > len => Cause::Cut,
        McapError::RecordTooLarge { len: claimed, .. } => Cause::TooLarge {
            what: "a record",
            size_bytes: claimed,
            limit_bytes,
        },
        other => Cause::Bad(other.to_string()),
    }
}
