//! LAS files of the ASPRS, versions 1.0 to 1.4, and LAZ, their LASzip-compressed form.

mod header;
#[cfg(feature = "survey")]
mod laz;
mod reference;

use std::path::Path;

use lattice_core::registration::UNLABELED;

use super::collect::Collector;
use super::scalar::Scalar;
use super::source::Source;
use super::{PointFileError, PointFormat};
use header::Header;

pub(super) use header::SIGNATURE;

/// Reads the points, with their classification as labels; `file` is the uncompressed input, if any.
pub(super) fn read(
    source: &mut Source,
    file: Option<&Path>,
    points: &mut Collector,
) -> Result<PointFormat, PointFileError> {
    let header = Header::read(source)?;
    points.promise(header.points)?;
    if header.is_packed {
        read_packed(source, file, &header, points)?;
    } else {
        let mut record = vec![0; usize::from(header.point_bytes)];
        for index in 1..=header.points {
            let part = format_args!("point {index} of {}", header.points);
            source.exact(&mut record, part)?;
            header.push(&record, points)?;
        }
    }
    if points.labels.iter().all(|label| *label == UNLABELED) {
        points.labels = Vec::new();
    }
    Ok(header.format())
}

#[cfg(feature = "survey")]
fn read_packed(
    source: &Source,
    file: Option<&Path>,
    header: &Header,
    points: &mut Collector,
) -> Result<(), PointFileError> {
    let file = file.ok_or(PointFileError::PACKED_TWICE)?;
    laz::read(file, source.byte(), header, points)
}

#[cfg(not(feature = "survey"))]
fn read_packed(
    _source: &Source,
    _file: Option<&Path>,
    _header: &Header,
    _points: &mut Collector,
) -> Result<(), PointFileError> {
    Err(PointFileError::NotRead {
        what: "LAZ (this build lacks the feature `survey`)",
        remedy: "unpack it to LAS, for example with `laszip`",
    })
}

impl Header {
    /// Adds the point of a record.
    fn push(&self, record: &[u8], points: &mut Collector) -> Result<(), PointFileError> {
        let mut point_m = [f64::NAN; 3];
        let axes = point_m
            .iter_mut()
            .zip(self.scale.iter().zip(&self.offset_m));
        for (axis, (coordinate, (scale, offset_m))) in axes.enumerate() {
            let bytes = record.get(4 * axis..).unwrap_or_default();
            let steps = Scalar::I32.decode(bytes).unwrap_or(f64::NAN);
            *coordinate = steps * scale + offset_m;
        }
        // Up to format 5 the higher bits are flags; the first two classes count as unlabelled.
        let class = match self.point_format {
            ..=5 => record.get(15).map(|bits| bits & 0x1f),
            _ => record.get(16).copied(),
        };
        let label = class.map_or(UNLABELED, |class| match class {
            0 | 1 => UNLABELED,
            class => u16::from(class),
        });
        points.push_labelled(point_m, label)
    }

    fn format(&self) -> PointFormat {
        match self.is_packed {
            true => PointFormat::Laz,
            false => PointFormat::Las,
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
