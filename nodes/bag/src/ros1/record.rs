//! Records of a ROS 1 bag (format 2.0) with bounded lengths.

use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use crate::{BagError, MAX_MESSAGE_BYTES};

/// First line of the format.
pub(super) const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

/// Operation codes of records.
pub(super) mod op {
    pub const MESSAGE: u8 = 2;
    pub const BAG_HEADER: u8 = 3;
    pub const INDEX: u8 = 4;
    pub const CHUNK: u8 = 5;
    pub const CHUNK_INFO: u8 = 6;
    pub const CONNECTION: u8 = 7;
}

/// Longest accepted header of a record, bytes.
const MAX_HEADER_BYTES: usize = 1 << 20;
/// Bytes read at once of a header.
const HEADER_READ_BYTES: usize = 1 << 9;
/// Longest accepted data of a record, chunks included, bytes.
pub(super) const MAX_DATA_BYTES: u64 = MAX_MESSAGE_BYTES;

/// Position of a record in its file, or in the content of the chunk at that byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Place {
    pub byte: u64,
    pub in_chunk: Option<usize>,
}

impl Place {
    pub(super) fn in_file(byte: u64) -> Place {
        Place {
            byte,
            in_chunk: None,
        }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let byte = self.byte;
        match self.in_chunk {
            None => write!(f, "byte {byte}"),
            Some(at) => write!(f, "byte {at} of the content of the chunk at byte {byte}"),
        }
    }
}

/// Error of reading a record, with its position.
#[derive(Debug)]
pub(super) struct RecordError {
    pub place: Place,
    pub cause: Cause,
}

#[derive(Debug)]
pub(super) enum Cause {
    /// The file ends inside the record.
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

    /// The same as damage: what follows is readable, so that the file does not end there.
    pub(super) fn inside(self) -> RecordError {
        match self.cause {
            Cause::Cut => RecordError::bad(self.place, "a record beyond the end of the file"),
            _ => self,
        }
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
                remedy: "drop topics with `rosbag filter`, or record smaller chunks",
            },
        }
    }
}

/// Fields of a header: names and values.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    /// Fields of a header; `None` if a length exceeds it, or a name is missing.
    pub(super) fn parse(header: &'a [u8]) -> Option<Fields<'a>> {
        let mut rest = header;
        while !rest.is_empty() {
            let (field, behind) = split_prefixed(rest)?;
            let name_end = field.iter().position(|b| *b == b'=')?;
            if name_end == 0 {
                return None;
            }
            rest = behind;
        }
        Some(Fields(header))
    }

    pub(super) fn get(&self, name: &str) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((field, behind)) = split_prefixed(rest) {
            let value = field.strip_prefix(name.as_bytes());
            if let Some(value) = value.and_then(|value| value.strip_prefix(b"=")) {
                return Some(value);
            }
            rest = behind;
        }
        None
    }

    pub(super) fn text(&self, name: &str) -> Option<String> {
        Some(String::from_utf8_lossy(self.get(name)?).into_owned())
    }

    pub(super) fn u32(&self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    pub(super) fn u64(&self, name: &str) -> Option<u64> {
        Some(u64::from_le_bytes(self.get(name)?.try_into().ok()?))
    }

    /// Time, ns since the Unix epoch.
    pub(super) fn time_ns(&self, name: &str) -> Option<i64> {
        let time = self.u64(name)?;
        let (sec, nsec) = (time & u64::from(u32::MAX), time >> 32);
        i64::try_from(sec * 1_000_000_000 + nsec).ok()
    }

    /// Operation code; `None` if it is unknown.
    pub(super) fn op(&self) -> Option<u8> {
        match self.get("op")? {
            [op @ op::MESSAGE..=op::CONNECTION] => Some(*op),
            _ => None,
        }
    }
}

/// Length-prefixed bytes, and those behind them.
fn split_prefixed(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk::<4>()?;
    let length = usize::try_from(u32::from_le_bytes(*length)).ok()?;
    rest.split_at_checked(length)
}

/// A record in memory.
pub(super) struct Record<'a> {
    pub fields: Fields<'a>,
    pub op: u8,
    pub data: &'a [u8],
    /// First byte behind it.
    pub end: usize,
}

impl<'a> Record<'a> {
    /// Record at a byte of the content of a chunk.
    pub(super) fn at(content: &'a [u8], at: usize) -> Option<Record<'a>> {
        let (header, rest) = split_prefixed(content.get(at..)?)?;
        let fields = Fields::parse(header)?;
        let (data, rest) = split_prefixed(rest)?;
        Some(Record {
            op: fields.op()?,
            fields,
            data,
            end: content.len() - rest.len(),
        })
    }
}

/// Header of a record in a file.
pub(super) struct Head {
    pub place: Place,
    header: Vec<u8>,
    pub op: u8,
    /// First byte of the data.
    data_at: u64,
    data_bytes: u32,
}

impl Head {
    /// Reads the header of the record at a byte of a file of `size` bytes.
    pub(super) fn read(file: &mut File, at: u64, size: u64) -> Result<Head, RecordError> {
        let place = Place::in_file(at);
        let wrong = |reason: &str| RecordError::bad(place, reason);
        let cut = || RecordError {
            place,
            cause: Cause::Cut,
        };
        let io = |error: io::Error| RecordError::bad(place, error);
        file.seek(SeekFrom::Start(at)).map_err(io)?;
        let mut bytes = Vec::new();
        let mut part = file.by_ref().take(HEADER_READ_BYTES as u64);
        part.read_to_end(&mut bytes).map_err(io)?;
        let length = bytes.first_chunk::<4>().ok_or_else(cut)?;
        let length = usize::try_from(u32::from_le_bytes(*length)).unwrap_or(usize::MAX);
        if length > MAX_HEADER_BYTES {
            return Err(wrong(&format!(
                "a header of {length} bytes, more than {MAX_HEADER_BYTES}"
            )));
        }
        let whole = length + 8;
        if at.saturating_add(whole as u64) > size {
            return Err(cut());
        }
        if let Some(more) = whole.checked_sub(bytes.len()) {
            let mut part = file.by_ref().take(more as u64);
            part.read_to_end(&mut bytes).map_err(io)?;
        }
        let data_bytes = bytes.get(length + 4..).and_then(|rest| rest.first_chunk());
        let data_bytes = u32::from_le_bytes(*data_bytes.ok_or_else(cut)?);
        let header = bytes.get(4..length + 4).unwrap_or_default().to_vec();
        let op = Fields::parse(&header).ok_or_else(|| wrong("an invalid header of a record"))?;
        let op = op.op().ok_or_else(|| wrong("an unknown kind of record"))?;
        let head = Head {
            place,
            header,
            op,
            data_at: at + whole as u64,
            data_bytes,
        };
        match head.end() > size {
            true => Err(cut()),
            false => Ok(head),
        }
    }

    pub(super) fn fields(&self) -> Fields<'_> {
        Fields(&self.header)
    }

    /// First byte behind the record.
    pub(super) fn end(&self) -> u64 {
        self.data_at.saturating_add(u64::from(self.data_bytes))
    }

    /// Length of the data, bytes.
    pub(super) fn data_bytes(&self) -> u64 {
        u64::from(self.data_bytes)
    }

    /// Reads the data, which lie within the file.
    pub(super) fn data(&self, file: &mut File) -> Result<Vec<u8>, RecordError> {
        if self.data_bytes() > MAX_DATA_BYTES {
            let cause = Cause::TooLarge {
                what: "a record",
                size_bytes: self.data_bytes(),
                limit_bytes: MAX_DATA_BYTES,
            };
            return Err(RecordError {
                place: self.place,
                cause,
            });
        }
        let io = |error: io::Error| RecordError::bad(self.place, error);
        file.seek(SeekFrom::Start(self.data_at)).map_err(io)?;
        let mut data = Vec::new();
        let mut part = file.by_ref().take(self.data_bytes());
        part.read_to_end(&mut data).map_err(io)?;
        match data.len() as u64 == self.data_bytes() {
            true => Ok(data),
            false => Err(RecordError {
                place: self.place,
                cause: Cause::Cut,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(text: &[u8]) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes()[..], text].concat()
    }

    #[test]
    fn fields_are_found_and_lengths_are_checked() {
        let header = [field(b"op=\x02"), field(b"time=\x01\0\0\0\x02\0\0\0")].concat();
        let fields = Fields::parse(&header).unwrap();
        assert_eq!(fields.op(), Some(op::MESSAGE));
        assert_eq!(fields.time_ns("time"), Some(1_000_000_002));
        assert_eq!(fields.u32("time"), None);
        assert!(fields.get("tim").is_none());
        for end in 1..header.len() {
            assert_eq!(Fields::parse(&header[..end]).is_some(), end == 8, "{end}");
        }
        assert!(Fields::parse(&field(b"=x")).is_none());
        assert!(Fields::parse(&field(b"x")).is_none());
        let unknown = field(b"op=\x09");
        assert_eq!(Fields::parse(&unknown).unwrap().op(), None);
    }
}
