//! Points from files: PLY, PCD, LAS, text, KITTI scans and OctoMap's binary trees, any of them packed with
//! bzip2; LAZ and E57 with the feature `survey`.
//!
//! Files are read as a stream, so that memory is bounded by the points kept and not by what a
//! header promises. Coordinates are taken as they stand, in metres: the viewpoint of a PCD file and
//! the like are not applied. Only the scans of an E57 file are placed by their poses, as they are meant.

mod collect;
#[cfg(feature = "survey")]
mod e57;
mod error;
mod format;
mod kitti;
mod las;
mod octree;
mod pcd;
pub mod ply;
mod scalar;
pub mod source;
mod text;

use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

pub use error::PointFileError;
pub use format::{PointFormat, is_named_as_points};

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
    /// Edge of the voxels whose centres the points are, metres, if the file is an octree.
    pub voxel_m: Option<f64>,
}

/// Reads the points of a file.
///
/// The content decides on the format where it has a signature, otherwise the extension does.
/// Errors do not name the file.
pub fn read_points(path: &Path, limits: &PointFileLimits) -> Result<PointFile, PointFileError> {
    let (reader, name, is_packed) = unpack(path)?;
    let mut source = Source::new(reader);
    let mut points = Collector::new(limits.max_points);
    let mut voxel_m = None;
    // LAZ and E57 are not read from the start to the end.
    let file = (!is_packed).then_some(path);
    let format = match format::detect(source.peek()?, &name)? {
        format::Family::Ply => ply::read(&mut source, &mut points)?,
        format::Family::Pcd => pcd::read(&mut source, &mut points)?,
        format::Family::Text => text::read(&mut source, &mut points)?,
        format::Family::Kitti => kitti::read(&mut source, &name, &mut points)?,
        format::Family::Las => las::read(&mut source, file, &mut points)?,
        format::Family::E57 => read_e57(file, &mut points)?,
        format::Family::Octree => {
            let (format, edge_m) = octree::read(&mut source, &mut points)?;
            voxel_m = Some(edge_m);
            format
        }
    };
    Ok(PointFile {
        points_m: points.points_m,
        labels: points.labels,
        format,
        skipped_not_finite: points.skipped,
        voxel_m,
    })
}

#[cfg(feature = "survey")]
fn read_e57(file: Option<&Path>, points: &mut Collector) -> Result<PointFormat, PointFileError> {
    e57::read(file.ok_or(PointFileError::PACKED_TWICE)?, points)
}

#[cfg(not(feature = "survey"))]
fn read_e57(_file: Option<&Path>, _points: &mut Collector) -> Result<PointFormat, PointFileError> {
    Err(PointFileError::NotRead {
        what: "E57 (this build lacks the feature `survey`)",
        remedy: "convert it, for example with `pdal translate scan.e57 scan.las`",
    })
}

/// Content and name of a file, both after unpacking.
pub fn open(path: &Path) -> Result<(Box<dyn BufRead>, PathBuf), PointFileError> {
    unpack(path).map(|(reader, name, _)| (reader, name))
}

/// The same, with true if the file is packed.
fn unpack(path: &Path) -> Result<(Box<dyn BufRead>, PathBuf, bool), PointFileError> {
    let io = |source| PointFileError::Io { byte: 0, source };
    let mut packed = BufReader::with_capacity(BUFFER, File::open(path).map_err(io)?);
    let start = packed.fill_buf().map_err(io)?;
    if !format::is_bzip2(start) {
        if let Some(byte) = format::cut_bzip2(start) {
            let part = "its packed data".to_owned();
            return Err(PointFileError::Truncated { byte, part });
        }
        return Ok((Box::new(packed), path.to_owned(), false));
    }
    let name = match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("bz2") => path.with_extension(""),
        _ => path.to_owned(),
    };
    Ok((unpacked(packed)?, name, true))
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

#[cfg(test)]
mod tests;
