//! Records of a part of a file, with those inside of chunks; resynchronisation after damage.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use super::chunk::content;
use super::record::{Fields, Head, Place, Record, RecordError, op};

/// Window of a search, and the longest header of a chunk in it, bytes.
const WINDOW_BYTES: usize = 1 << 20;
const OVERLAP_BYTES: usize = 256;
/// Field that each chunk has.
const CHUNK_FIELD: &[u8] = b"compression=";
/// Field that each message has.
const MESSAGE_FIELD: &[u8] = b"conn=";
/// Farthest place of that field in its record, bytes.
const MESSAGE_HEAD_BYTES: usize = 64;

/// Step of a visit.
pub(super) enum Step<'a> {
    /// A chunk, whose records follow; the first byte behind it.
    Chunk { at: u64, end: u64 },
    /// Message or connection.
    Record(Place, Record<'a>),
}

/// Callback of a visit.
pub(super) type Visit<'a> = dyn FnMut(Step<'_>) -> Result<(), RecordError> + 'a;

/// Visits the records that begin at `start` and before `end`; one that begins at `stop` ends the visit.
///
/// Nothing of a compressed chunk is visited if it is damaged.
pub(super) fn visit_records(
    file: &mut File,
    (start, end): (u64, u64),
    (size, stop): (u64, u64),
    visit: &mut Visit<'_>,
) -> Result<(), RecordError> {
    let mut at = start;
    while at < end && at != stop {
        let head = Head::read(file, at, size)?;
        match head.op {
            op::CHUNK => {
                let content = content(file, &head)?;
                match content.damage {
                    Some(damage) if content.compressed => return Err(damage),
                    damage => {
                        let end = head.end();
                        visit(Step::Chunk { at, end })?;
                        visit_content(head.place, &content.bytes, visit)?;
                        damage.map_or(Ok(()), Err)?;
                    }
                }
            }
            op::MESSAGE | op::CONNECTION => {
                let data = head.data(file)?;
                let record = Record {
                    fields: head.fields(),
                    op: head.op,
                    data: &data,
                    end: 0,
                };
                visit(Step::Record(head.place, record))?;
            }
            _ => expect_sound(&head)?,
        }
        at = head.end();
    }
    Ok(())
}

/// Rejects a record of an index that may be another one with a damaged header.
fn expect_sound(head: &Head) -> Result<(), RecordError> {
    let fields = head.fields();
    let entries = |bytes: u64| {
        let count = fields.u32("count").map(u64::from);
        fields.u32("ver").is_some() && count.map(|count| count * bytes) == Some(head.data_bytes())
    };
    let is_sound = match head.op {
        op::INDEX => entries(12),
        op::CHUNK_INFO => entries(8),
        _ => fields.u64("index_pos").is_some(),
    };
    match is_sound {
        true => Ok(()),
        false => Err(RecordError::bad(
            head.place,
            "an invalid record of an index",
        )),
    }
}

/// Visits the records in the content of the chunk at a place.
fn visit_content(chunk: Place, content: &[u8], visit: &mut Visit<'_>) -> Result<(), RecordError> {
    let mut at = 0;
    while at < content.len() {
        let place = Place {
            in_chunk: Some(at),
            ..chunk
        };
        let record = Record::at(content, at)
            .filter(|record| matches!(record.op, op::MESSAGE | op::CONNECTION))
            .ok_or_else(|| RecordError::bad(place, "an invalid record in a chunk"))?;
        at = record.end;
        visit(Step::Record(place, record))?;
    }
    Ok(())
}

/// Visits what seem to be messages and connections in damaged bytes from `from` on.
pub(super) fn visit_damaged(bytes: &[u8], from: usize, visit: &mut dyn FnMut(usize, Record<'_>)) {
    let mut at = from;
    while at < bytes.len() {
        let record = Record::at(bytes, at);
        let record = record.filter(|record| matches!(record.op, op::MESSAGE | op::CONNECTION));
        at = match record {
            Some(record) => {
                let end = record.end;
                visit(at, record);
                end
            }
            None => match next_head(bytes, at + 1) {
                Some(next) => next,
                None => return,
            },
        };
    }
}

/// First byte from `from` on where a message or a connection seems to begin.
fn next_head(bytes: &[u8], from: usize) -> Option<usize> {
    let mut searched = from;
    loop {
        let found = find(bytes.get(searched..)?, MESSAGE_FIELD)? + searched;
        let least = found.saturating_sub(MESSAGE_HEAD_BYTES).max(from);
        let is_record = |at: &usize| {
            let record = Record::at(bytes, *at);
            record.is_some_and(|r| matches!(r.op, op::MESSAGE | op::CONNECTION))
        };
        if let Some(at) = (least..found).find(is_record) {
            return Some(at);
        }
        searched = found + MESSAGE_FIELD.len();
    }
}

fn find(bytes: &[u8], wanted: &[u8]) -> Option<usize> {
    bytes
        .windows(wanted.len())
        .position(|window| window == wanted)
}

/// First byte from `from` on where a chunk of a file of `size` bytes seems to begin.
pub(super) fn next_chunk(file: &mut File, from: u64, size: u64) -> io::Result<Option<u64>> {
    let mut at = from;
    let mut window = Vec::new();
    while at < size {
        file.seek(SeekFrom::Start(at))?;
        window.clear();
        let most = (WINDOW_BYTES + 2 * OVERLAP_BYTES) as u64;
        file.by_ref().take(most).read_to_end(&mut window)?;
        let mut searched = 0;
        while let Some(found) = window
            .get(searched..)
            .and_then(|rest| find(rest, CHUNK_FIELD))
        {
            let field = searched + found;
            let least = field.saturating_sub(OVERLAP_BYTES);
            let starts = least..field.min(WINDOW_BYTES + OVERLAP_BYTES);
            let mut starts = starts.filter(|start| is_chunk(&window, *start));
            if let Some(start) = starts.next() {
                return Ok(Some(at + start as u64));
            }
            searched = field + CHUNK_FIELD.len();
        }
        at += WINDOW_BYTES as u64;
    }
    Ok(None)
}

/// True where the header of a chunk is.
fn is_chunk(bytes: &[u8], at: usize) -> bool {
    let header = || {
        let (length, rest) = bytes.get(at..)?.split_first_chunk::<4>()?;
        let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
        Fields::parse(rest.get(..length)?)
    };
    header().is_some_and(|fields| {
        fields.op() == Some(op::CHUNK)
            && fields.u32("size").is_some()
            && matches!(fields.get("compression"), Some(b"none" | b"bz2" | b"lz4"))
    })
}
