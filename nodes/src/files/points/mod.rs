//! Points from files: PLY, PCD, text and KITTI scans, any of them packed with bzip2.
//!
//! Files are read as a stream, so that memory is bounded by the points kept and not by what a
//! header promises. Coordinates are taken as they stand, in metres: the viewpoint of a PCD file and
//! the like are not applied.

mod collect;
mod error;
mod format;
mod kitti;
mod pcd;
pub mod ply;
mod scalar;
pub mod source;
mod text;

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

pub use error::PointFileError;
pub use format::PointFormat;

use collect::Collector;
use source::Source;

/// Bytes read from the disk at once.
const BUFFER: usize = 1 << 16;

/// Bounds of what a point file may ask for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PointFileLimits {
    /// Most points that are taken.
    pub max_points: usize,
}

impl Default for PointFileLimits {
    /// A hundred million points, 2.4 GB.
    fn default() -> PointFileLimits {
        PointFileLimits {
            max_points: 100_000_000,
        }
    }
}

/// The points of a file.
#[derive(Clone, PartialEq, Debug)]
pub struct PointFile {
    /// Finite points in the order of the file, metres, in the frame of the file.
    pub points_m: Vec<[f64; 3]>,
    /// Class of each point, [`UNLABELED`](lattice_core::registration::UNLABELED) where it has none;
    /// empty if the file has no `label`.
    pub labels: Vec<u16>,
    /// Kind of the file.
    pub format: PointFormat,
    /// Points left out because a coordinate was NaN or infinite.
    pub skipped_not_finite: usize,
}

/// Reads the points of a file.
///
/// The content decides on the format where it has a signature, otherwise the extension does.
/// Errors do not name the file.
pub fn read_points(path: &Path, limits: &PointFileLimits) -> Result<PointFile, PointFileError> {
    let (reader, name) = open(path)?;
    read_stream(reader, &name, limits)
}

/// Content and name of a file, both after unpacking.
pub fn open(path: &Path) -> Result<(Box<dyn BufRead>, PathBuf), PointFileError> {
    let io = |source| PointFileError::Io { byte: 0, source };
    let mut packed = BufReader::with_capacity(BUFFER, File::open(path).map_err(io)?);
    let start = packed.fill_buf().map_err(io)?;
    if !format::is_bzip2(start) {
        if let Some(byte) = format::cut_bzip2(start) {
            let part = "its packed data".to_owned();
            return Err(PointFileError::Truncated { byte, part });
        }
        return Ok((Box::new(packed), path.to_owned()));
    }
    let name = match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("bz2") => path.with_extension(""),
        _ => path.to_owned(),
    };
    Ok((unpacked(packed)?, name))
}

#[cfg(feature = "bzip2")]
fn unpacked(packed: BufReader<File>) -> Result<Box<dyn BufRead>, PointFileError> {
    let decoder = bzip2::bufread::MultiBzDecoder::new(packed);
    Ok(Box::new(BufReader::with_capacity(BUFFER, decoder)))
}

#[cfg(not(feature = "bzip2"))]
fn unpacked(_packed: BufReader<File>) -> Result<Box<dyn BufRead>, PointFileError> {
    Err(PointFileError::Packed)
}

fn read_stream(
    reader: Box<dyn BufRead>,
    name: &Path,
    limits: &PointFileLimits,
) -> Result<PointFile, PointFileError> {
    let mut source = Source::new(reader);
    let mut points = Collector::new(limits.max_points);
    let format = match format::detect(source.peek()?, name)? {
        format::Family::Ply => ply::read(&mut source, &mut points)?,
        format::Family::Pcd => pcd::read(&mut source, &mut points)?,
        format::Family::Text => text::read(&mut source, &mut points)?,
        format::Family::Kitti => kitti::read(&mut source, name, &mut points)?,
    };
    Ok(PointFile {
        points_m: points.points_m,
        labels: points.labels,
        format,
        skipped_not_finite: points.skipped,
    })
}

#[cfg(test)]
mod tests;
