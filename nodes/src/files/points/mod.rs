//! Point files: PLY, PCD, LAS, text, KITTI scans and OctoMap's trees, all optionally compressed with
//! bzip2; LAZ and E57 with the feature `survey`.
//!
//! Files are read as streams, so that memory is bounded by the points kept, not by a header.
//! Coordinates are used unchanged, in metres: the viewpoint of a PCD file and similar
//! properties are not applied but reported. Only the scans of an E57 file are transformed by their poses.

mod bin_layout;
mod collect;
mod detect;
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
pub use detect::is_named_as_points;
pub use error::PointFileError;
pub use format::PointFormat;

use collect::Collector;
use detect::Family;
use source::{BUFFER, Source};

/// Options for reading a point file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PointFileOptions {
    /// Limit of points.
    pub max_points: usize,
    /// Columns of a `.bin` file; `None`: those of KITTI, with a check.
    pub columns: Option<BinLayout>,
}

impl Default for PointFileOptions {
    /// A limit of a hundred million points, 2.4 GB.
    fn default() -> PointFileOptions {
        PointFileOptions {
            max_points: 100_000_000,
            columns: None,
        }
    }
}

/// Contents of a point file.
#[derive(Clone, PartialEq, Debug)]
pub struct PointFile {
    /// Finite points in the order of the file, metres, in the frame of the file.
    pub points_m: Vec<[f64; 3]>,
    /// Class of each point, [`UNLABELED`](lattice_core::registration::UNLABELED) if none;
    /// empty if the file has no `label`.
    pub labels: Vec<u16>,
    /// Format of the file.
    pub format: PointFormat,
    /// Skipped points with a NaN or infinite coordinate.
    pub skipped_not_finite: usize,
    /// Removed points at 0 0 0: rays without return.
    pub no_returns: usize,
    /// Voxel edge of an octree, whose points are voxel centres, metres.
    pub voxel_m: Option<f64>,
}

/// Reads the points of a file.
///
/// The format is detected by its signature, otherwise by the extension.
/// Errors do not name the file. Skipped points and ignored properties are logged as warnings.
pub fn read_points(path: &Path, options: &PointFileOptions) -> Result<PointFile, PointFileError> {
    let (reader, name, is_packed) = unpack(path)?;
    let mut source = Source::new(reader);
    let mut points = Collector::new(options.max_points);
    let mut voxel_m = None;
    // LAZ and E57 need random access.
    let file = (!is_packed).then_some(path);
    let format = match detect::detect(source.peek()?, &name)? {
        Family::Ply => ply::read(&mut source, &mut points)?,
        Family::Pcd => pcd::read(&mut source, &mut points)?,
        Family::Text => text::read(&mut source, &mut points)?,
        Family::Kitti => {
            let size_bytes = file.and_then(|file| file.metadata().ok());
            let named = (name.as_path(), size_bytes.map(|about| about.len()));
            kitti::read(&mut source, named, options.columns, &mut points)?
        }
        Family::Las => las::read(&mut source, file, &mut points)?,
        Family::E57 => read_e57(file, &mut points)?,
        Family::Octree => {
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

/// Reason why a file has no points, from the numbers of skipped ones.
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

/// Content and name of a file, both after decompression.
pub fn open(path: &Path) -> Result<(Box<dyn BufRead>, PathBuf), PointFileError> {
    unpack(path).map(|(reader, name, _)| (reader, name))
}

/// Content and name of a file, with true if it is compressed.
fn unpack(path: &Path) -> Result<(Box<dyn BufRead>, PathBuf, bool), PointFileError> {
    let io = |source| PointFileError::Io { byte: 0, source };
    let mut packed = BufReader::with_capacity(BUFFER, File::open(path).map_err(io)?);
    let start = packed.fill_buf().map_err(io)?;
    if !detect::is_bzip2(start) {
        if let Some(byte) = detect::cut_bzip2(start) {
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
