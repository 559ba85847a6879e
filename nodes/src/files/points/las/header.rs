//! Header of a LAS file and its variable length records.

use super::reference;
use crate::files::points::scalar::Scalar;
use crate::files::points::source::Source;
use crate::files::points::{PointFileError, PointFormat};

/// First bytes of every file.
pub(in crate::files::points) const SIGNATURE: &[u8] = b"LASF";
/// Length of the shortest header, that of version 1.0, bytes.
const MIN_HEADER: u16 = 227;
/// Length of the longest accepted header, bytes.
const MAX_HEADER: u16 = 4096;
/// Length of a record's own header, bytes.
const RECORD_HEADER: u64 = 54;
/// Bits of the point format that mark compressed points.
const PACKED: u8 = 0b1100_0000;

/// Offsets of the fields, bytes.
const VERSION: usize = 24;
const HEADER_BYTES: usize = 94;
const POINTS_AT: usize = 96;
const RECORDS: usize = 100;
const POINT_FORMAT: usize = 104;
const POINT_BYTES: usize = 105;
const OLD_POINTS: usize = 107;
const SCALE: usize = 131;
const OFFSET: usize = 155;
const POINTS: usize = 247;

/// Header fields needed for reading.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Header {
    pub(super) points: u64,
    pub(super) point_format: u8,
    pub(super) point_bytes: u16,
    pub(super) is_packed: bool,
    pub(super) scale: [f64; 3],
    pub(super) offset_m: [f64; 3],
    /// Compression parameters of the points, from the LASzip record.
    pub(super) laszip: Option<Vec<u8>>,
}

impl Header {
    /// Reads up to the first point. Fails if the records state other units than metres.
    pub(super) fn read(source: &mut Source) -> Result<Header, PointFileError> {
        let mut bytes = vec![0; usize::from(MIN_HEADER)];
        source.exact(&mut bytes, "the header")?;
        if !bytes.starts_with(SIGNATURE) {
            return Err(fault(
                source,
                "no `LASF` at the start of the file".to_owned(),
            ));
        }
        let of = |bytes: &[u8], at: usize, scalar: Scalar| {
            let bytes = bytes.get(at..).unwrap_or_default();
            scalar.decode(bytes).unwrap_or_default()
        };
        let length = of(&bytes, HEADER_BYTES, Scalar::U16) as u16;
        if !(MIN_HEADER..=MAX_HEADER).contains(&length) {
            let bounds = format!("{MIN_HEADER} to {MAX_HEADER}");
            return Err(fault(
                source,
                format!("a header of {length} bytes, expected {bounds}"),
            ));
        }
        bytes.resize(usize::from(length), 0);
        let rest = bytes.get_mut(usize::from(MIN_HEADER)..);
        source.exact(rest.unwrap_or_default(), "the header")?;
        let number = |at: usize, scalar: Scalar| of(&bytes, at, scalar);
        let three = |at: usize| [0, 8, 16].map(|axis| number(at + axis, Scalar::F64));
        let format = number(POINT_FORMAT, Scalar::U8) as u8;
        let header = Header {
            points: points(&bytes),
            point_format: format & !PACKED,
            point_bytes: number(POINT_BYTES, Scalar::U16) as u16,
            is_packed: format & PACKED != 0,
            scale: three(SCALE),
            offset_m: three(OFFSET),
            laszip: None,
        };
        header.check().map_err(|reason| fault(source, reason))?;
        let points_at = number(POINTS_AT, Scalar::U32) as u64;
        let records = number(RECORDS, Scalar::U32) as u64;
        header.read_records(source, records, points_at)
    }

    /// Reads the records and leaves the source at the first point.
    fn read_records(
        mut self,
        source: &mut Source,
        records: u64,
        points_at: u64,
    ) -> Result<Header, PointFileError> {
        for number in 1..=records {
            let part = format!("record {number} of {records}");
            let room = points_at.saturating_sub(source.byte());
            if room < RECORD_HEADER {
                break;
            }
            let head = source.take(RECORD_HEADER, &part)?;
            let owner = head.get(2..18).unwrap_or_default();
            let owner = owner.split(|byte| *byte == 0).next().unwrap_or_default();
            let field = |at: usize| {
                let bytes = head.get(at..).unwrap_or_default();
                Scalar::U16.decode(bytes).unwrap_or_default() as u16
            };
            let (id, length) = (field(18), field(20));
            if u64::from(length) > room - RECORD_HEADER {
                let reason = format!("{part} has {length} bytes, but the points begin in it");
                return Err(fault(source, reason));
            }
            let data = source.take(length.into(), &part)?;
            match (owner, id) {
                (b"laszip encoded", 22204) => self.laszip = Some(data),
                (b"LASF_Projection", _) => {
                    reference::check(id, &data).map_err(|reason| fault(source, reason))?;
                }
                _ => {}
            }
        }
        let behind = points_at.checked_sub(source.byte()).ok_or_else(|| {
            let reason = format!("points at byte {points_at}, which is inside the header");
            fault(source, reason)
        })?;
        source.skip(behind, "what precedes the points")?;
        Ok(self)
    }

    fn check(&self) -> Result<(), String> {
        let least: u16 = match self.point_format {
            0 => 20,
            1 => 28,
            2 => 26,
            3 => 34,
            4 => 57,
            5 => 63,
            6 => 30,
            7 => 36,
            8 => 38,
            9 => 59,
            10 => 67,
            other => return Err(format!("point format {other}, expected 0 to 10")),
        };
        if self.point_bytes < least {
            let (format, bytes) = (self.point_format, self.point_bytes);
            return Err(format!(
                "points of {bytes} bytes, but those of format {format} have {least} or more"
            ));
        }
        let is_scale = |scale: &f64| scale.is_finite() && *scale != 0.0;
        match self.scale.iter().all(is_scale) {
            true => Ok(()),
            false => Err(format!(
                "scale {:?}, expected finite numbers, not 0",
                self.scale
            )),
        }
    }
}

/// Number of points: in 64 bits since version 1.4.
fn points(header: &[u8]) -> u64 {
    let old = header
        .get(OLD_POINTS..)
        .and_then(|bytes| bytes.first_chunk());
    let old = u64::from(old.map_or(0, |bytes| u32::from_le_bytes(*bytes)));
    let is_new = header.get(VERSION..VERSION + 2) >= Some(&[1, 4]);
    let new = header.get(POINTS..).and_then(|bytes| bytes.first_chunk());
    let new = new.map_or(0, |bytes| u64::from_le_bytes(*bytes));
    // Some writers leave the new field empty.
    if is_new && new > 0 { new } else { old }
}

fn fault(source: &Source, reason: String) -> PointFileError {
    PointFileError::Data {
        format: PointFormat::Las,
        byte: source.byte(),
        reason,
    }
}
