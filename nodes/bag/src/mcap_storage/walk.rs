//! Walks the records of an MCAP data section or chunk (<https://mcap.dev/spec>), without trust.

use std::io::{self, Read};

use mcap::records::{MessageHeader, op};

use crate::MAX_MESSAGE_BYTES;

/// Schemas, channels and metadata larger than this are refused, bytes.
pub(super) const MAX_RECORD_BYTES: u64 = 64 << 20;
/// Opcode and length.
pub(super) const RECORD_HEADER_BYTES: u64 = 9;
const MESSAGE_HEADER_BYTES: u64 = 22;

/// A record on its way by.
pub(super) enum Event<'a> {
    /// A message whose `len` data bytes are at the front of `body`.
    Message {
        header: MessageHeader,
        len: u64,
        body: &'a mut dyn Read,
    },
    /// A schema, a channel or metadata.
    Record { opcode: u8, body: &'a [u8] },
}

/// Why a walk stopped; `at` counts from where the walk began.
#[derive(Debug)]
pub(super) enum WalkError {
    Bad {
        at: u64,
        reason: String,
    },
    TooLarge {
        what: &'static str,
        at: u64,
        size_bytes: u64,
        limit_bytes: u64,
    },
}

impl WalkError {
    pub(super) fn bad(at: u64, reason: impl ToString) -> WalkError {
        WalkError::Bad {
            at,
            reason: reason.to_string(),
        }
    }
}

/// The opcode's name.
pub(super) fn record_name(opcode: u8) -> &'static str {
    match opcode {
        op::HEADER => "header",
        op::FOOTER => "footer",
        op::SCHEMA => "schema",
        op::CHANNEL => "channel",
        op::MESSAGE => "message",
        op::CHUNK => "chunk",
        op::MESSAGE_INDEX => "message index",
        op::ATTACHMENT => "attachment",
        op::METADATA => "metadata",
        op::DATA_END => "data end",
        _ => "other",
    }
}

/// Calls `visit` for the messages, schemas, channels and metadata in the next `total` bytes.
pub(super) fn walk(
    reader: &mut dyn Read,
    total: u64,
    visit: &mut dyn FnMut(u64, Event<'_>) -> Result<(), WalkError>,
) -> Result<(), WalkError> {
    let mut at = 0_u64;
    while at < total {
        let left = total - at;
        if left < RECORD_HEADER_BYTES {
            return Err(WalkError::bad(
                at,
                format!("{left} bytes left where a record needs 9"),
            ));
        }
        let (opcode, len) = record_header(reader).map_err(|e| WalkError::bad(at, e))?;
        let left = left - RECORD_HEADER_BYTES;
        if len > left {
            let name = record_name(opcode);
            return Err(WalkError::bad(
                at,
                format!("a {name} record of {len} bytes where {left} are left"),
            ));
        }
        visit_record(reader, at, opcode, len, visit)?;
        at += RECORD_HEADER_BYTES + len;
    }
    Ok(())
}

fn visit_record(
    reader: &mut dyn Read,
    at: u64,
    opcode: u8,
    len: u64,
    visit: &mut dyn FnMut(u64, Event<'_>) -> Result<(), WalkError>,
) -> Result<(), WalkError> {
    let cut = |e: io::Error| WalkError::bad(at, format!("a {} record: {e}", record_name(opcode)));
    let mut body = reader.take(len);
    match opcode {
        op::MESSAGE => {
            if len < MESSAGE_HEADER_BYTES {
                return Err(WalkError::bad(
                    at,
                    format!("a message record of {len} bytes; its header takes 22"),
                ));
            }
            let header = message_header(&mut body).map_err(cut)?;
            let len = len - MESSAGE_HEADER_BYTES;
            if len > MAX_MESSAGE_BYTES {
                return Err(WalkError::TooLarge {
                    what: "a message",
                    at,
                    size_bytes: len,
                    limit_bytes: MAX_MESSAGE_BYTES,
                });
            }
            visit(
                at,
                Event::Message {
                    header,
                    len,
                    body: &mut body,
                },
            )?;
        }
        op::SCHEMA | op::CHANNEL | op::METADATA => {
            let bytes = read_body(&mut body, len).map_err(|e| match e {
                Some(e) => cut(e),
                None => WalkError::TooLarge {
                    what: "a record",
                    at,
                    size_bytes: len,
                    limit_bytes: MAX_RECORD_BYTES,
                },
            })?;
            visit(
                at,
                Event::Record {
                    opcode,
                    body: &bytes,
                },
            )?;
        }
        op::CHUNK => return Err(WalkError::bad(at, "a chunk inside a chunk")),
        0 => return Err(WalkError::bad(at, "opcode 0, which no record has")),
        _ => {}
    }
    io::copy(&mut body, &mut io::sink()).map_err(cut)?;
    match body.limit() {
        0 => Ok(()),
        missing => Err(WalkError::bad(
            at,
            format!(
                "a {} record lacks its last {missing} bytes",
                record_name(opcode)
            ),
        )),
    }
}

/// Reads opcode and length.
pub(super) fn record_header(reader: &mut dyn Read) -> io::Result<(u8, u64)> {
    let mut opcode = [0];
    let mut len = [0; 8];
    reader.read_exact(&mut opcode)?;
    reader.read_exact(&mut len)?;
    let [opcode] = opcode;
    Ok((opcode, u64::from_le_bytes(len)))
}

/// Reads a record body whole; `None` is a body beyond the limit.
pub(super) fn read_body(reader: &mut dyn Read, len: u64) -> Result<Vec<u8>, Option<io::Error>> {
    if len > MAX_RECORD_BYTES {
        return Err(None);
    }
    let mut body = Vec::new();
    let read = reader.take(len).read_to_end(&mut body).map_err(Some)?;
    match read as u64 {
        read if read == len => Ok(body),
        read => Err(Some(io::Error::new(
            io::ErrorKind::UnexpectedEof,
            format!("{read} of {len} bytes are there"),
        ))),
    }
}

fn message_header(reader: &mut dyn Read) -> io::Result<MessageHeader> {
    let (mut channel_id, mut sequence) = ([0; 2], [0; 4]);
    let (mut log_time, mut publish_time) = ([0; 8], [0; 8]);
    reader.read_exact(&mut channel_id)?;
    reader.read_exact(&mut sequence)?;
    reader.read_exact(&mut log_time)?;
    reader.read_exact(&mut publish_time)?;
    Ok(MessageHeader {
        channel_id: u16::from_le_bytes(channel_id),
        sequence: u32::from_le_bytes(sequence),
        log_time: u64::from_le_bytes(log_time),
        publish_time: u64::from_le_bytes(publish_time),
    })
}
