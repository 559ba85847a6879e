//! Point data of a PCD file.

use super::header::{Axis, Header};
use super::lzf;
use crate::files::points::collect::Collector;
use crate::files::points::source::Source;
use crate::files::points::text::number;
use crate::files::points::{PointFileError, PointFormat};

/// Reads one point per line; empty lines are ignored.
pub(super) fn read_text(
    source: &mut Source,
    header: &Header,
    points: &mut Collector,
) -> Result<(), PointFileError> {
    for index in 1..=header.points {
        let part = format_args!("point {index} of {}", header.points);
        let mut line = String::new();
        while line.is_empty() {
            line.push_str(source.expect_line(part)?.trim());
        }
        let fault = |reason| PointFileError::Line {
            format: header.format,
            line: source.line_number(),
            reason,
        };
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.len() as u64 != header.columns {
            let (found, columns) = (words.len(), header.columns);
            return Err(fault(format!("{found} columns instead of {columns}")));
        }
        let mut point_m = [f64::NAN; 3];
        for (coordinate, axis) in point_m.iter_mut().zip(&header.axes) {
            let word = words.get(axis.column as usize).copied().unwrap_or_default();
            *coordinate = number(word).ok_or_else(|| {
                let word: String = word.chars().take(40).collect();
                fault(format!(
                    "column {} is {word:?}, not a number",
                    axis.column + 1
                ))
            })?;
        }
        let label = header.label.map(|label| {
            let word = words.get(label.column as usize).copied();
            word.and_then(number).unwrap_or(f64::NAN)
        });
        points.push_with(point_m, label)?;
    }
    Ok(())
}

/// Reads points in sequence.
pub(super) fn read_binary(
    source: &mut Source,
    header: &Header,
    points: &mut Collector,
) -> Result<(), PointFileError> {
    let mut record = vec![0; header.point_bytes as usize];
    for index in 1..=header.points {
        let part = format_args!("point {index} of {}", header.points);
        source.exact(&mut record, part)?;
        let value = |axis: Axis| {
            let bytes = record.get(axis.offset as usize..).unwrap_or_default();
            axis.scalar.decode(bytes).unwrap_or(f64::NAN)
        };
        points.push_with(header.axes.map(value), header.label.map(value))?;
    }
    Ok(())
}

/// Reads two lengths as u32, compressed and uncompressed, and one LZF block with the fields in sequence.
pub(super) fn read_compressed(
    source: &mut Source,
    header: &Header,
    points: &mut Collector,
) -> Result<(), PointFileError> {
    let fault = |byte, reason| PointFileError::Data {
        format: PointFormat::PcdBinaryCompressed,
        byte,
        reason,
    };
    let mut lengths = [[0; 4]; 2];
    for length in &mut lengths {
        source.exact(length, "the lengths of the compressed data")?;
    }
    let [packed, unpacked] = lengths.map(u32::from_le_bytes);
    // Both factors are bounded, by the limits of points and of bytes per point.
    let expected = header.points.saturating_mul(header.point_bytes);
    if u64::from(unpacked) != expected {
        let reason = format!(
            "{unpacked} bytes of data, but {} points of {} bytes are {expected}",
            header.points, header.point_bytes
        );
        return Err(fault(source.byte(), reason));
    }
    let start = source.byte();
    let part = format_args!("the {packed} bytes of compressed data");
    let packed = source.take(u64::from(packed), part)?;
    let data = lzf::unpack(&packed, unpacked as usize)
        .map_err(|lzf::Corrupt { byte, reason }| fault(start + byte as u64, reason))?;
    for index in 0..header.points {
        let value = |axis: Axis| {
            // Fields are contiguous; the offset is below 2^32.
            let at = axis.offset * header.points + index * axis.scalar.size() as u64;
            let bytes = data.get(at as usize..).unwrap_or_default();
            axis.scalar.decode(bytes).unwrap_or(f64::NAN)
        };
        points.push_with(header.axes.map(value), header.label.map(value))?;
    }
    Ok(())
}
