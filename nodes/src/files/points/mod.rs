//! Points from files: PLY, PCD, LAS, text, KITTI scans and OctoMap's binary trees, any of them packed with
//! bzip2; LAZ and E57 with the feature `survey`.
//!
//! Files are read as a stream, so that memory is bounded by the points kept and not by what a
//! header promises. Coordinates are taken as they stand, in metres: the viewpoint of a PCD file and
//! the like are not applied but warned of. Only the scans of an E57 file are placed by their poses, as they are meant.

mod bin_layout;
mod collect;
#[cfg(feature = "survey")]
mod e57;
mod error;
mod format;
mod kitti;
mod label;
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

pub use bin_layout::BinLayout;
pub use error::PointFileError;
pub use format::{PointFormat, is_named_as_points};

use collect::Collector;
use source::Source;

/// Bytes read from the disk at once.
const BUFFER: usize = 1 << 16;

/// Options of reading a point file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PointFileOptions {
    /// Most points that are taken.
    pub max_points: usize,
    /// Columns of a `.bin` file; those of KITTI, which are checked, where nothing.
    pub columns: Option<BinLayout>,
}

impl Default for PointFileOptions {
    /// A hundred million points, 2.4 GB.
    fn default() -> PointFileOptions {
        PointFileOptions {
            max_points: 100_000_000,
            columns: None,
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
    /// Points left out because they were 0 0 0: rays without return.
    pub no_returns: usize,
    /// Edge of the voxels whose centres the points are, metres, if the file is an octree.
    pub voxel_m: Option<f64>,
}

/// Reads the points of a file.
///
/// The content decides on the format where it has a signature, otherwise the extension does.
/// Errors do not name the file. What is left out or not applied of a file that is read is warned of.
pub fn read_points(path: &Path, options: &PointFileOptions) -> Result<PointFile, PointFileError> {
    let (reader, name, is_packed) = unpack(path)?;
    let mut source = Source::new(reader);
    let mut points = Collector::new(options.max_points);
    let mut voxel_m = None;
    // LAZ and E57 are not read from the start to the end.
    let file = (!is_packed).then_some(path);
    let format = match format::detect(source.peek()?, &name)? {
        format::Family::Ply => ply::read(&mut source, &mut points)?,
        format::Family::Pcd => pcd::read(&mut source, &mut points)?,
        format::Family::Text => text::read(&mut source, &mut points)?,
        format::Family::Kitti => {
            let size_bytes = file.and_then(|file| file.metadata().ok());
            let named = (name.as_path(), size_bytes.map(|about| about.len()));
            kitti::read(&mut source, named, options.columns, &mut points)?
        }
        format::Family::Las => las::read(&mut source, file, &mut points)?,
        format::Family::E57 => read_e57(file, &mut points)?,
        format::Family::Octree => {
            let (format, edge_m) = octree::read(&mut source, &mut points)?;
            voxel_m = Some(edge_m);
            format
        }
    };
    let no_returns = points.leave_out_no_returns();
    for note in points.notes(no_returns) {
        log::warn!("{}: {note}", path.display());
    }
    Ok(PointFile {
        no_returns,
        points_m: points.points_m,
        labels: points.labels,
        format,
        skipped_not_finite: points.skipped,
        voxel_m,
    })
}

/// Reason for which a file has no points, of those that were left out.
pub fn why_empty(not_finite: usize, no_returns: usize) -> String {
    match (not_finite, no_returns) {
        (0, 0) => "the file has no points".to_owned(),
        (n, 0) => format!("none of its {n} points is finite"),
        (0, n) => format!("all of its {n} points are 0 0 0, no returns"),
        (a, b) => format!("its points are not finite ({a}) or 0 0 0, no returns ({b})"),
    }
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
