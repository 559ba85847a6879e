//! PCD 0.7 of the Point Cloud Library: a header of fields, and the points as text, binary
//! or LZF-compressed.

mod data;
mod header;
mod lzf;
mod viewpoint;

use header::Header;

use super::collect::Collector;
use super::source::Source;
use super::{PointFileError, PointFormat};

pub(super) fn read(
    source: &mut Source,
    points: &mut Collector,
) -> Result<PointFormat, PointFileError> {
    let header = Header::read(source)?;
    points.promise(header.points)?;
    points.is_organized = header.rows > 1;
    points.remark.clone_from(&header.viewpoint);
    match header.format {
        PointFormat::PcdAscii => data::read_text(source, &header, points)?,
        PointFormat::PcdBinary => data::read_binary(source, &header, points)?,
        _ => data::read_compressed(source, &header, points)?,
    }
    Ok(header.format)
}

#[cfg(test)]
mod tests;
