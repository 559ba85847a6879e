//! KITTI Velodyne scans: records of x, y, z and intensity as little-endian f32 without a header, or other columns
//! stated by the caller; the labels of SemanticKITTI, a u32 per point, are in a separate file.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use lattice_core::registration::UNLABELED;

use super::bin_layout::{BinLayout, check_kitti};
use super::collect::Collector;
use super::source::Source;
use super::{PointFileError, PointFormat};

/// Label file of a scan: beside it, or in the folder `labels` beside its folder, as in SemanticKITTI.
fn labels_of(scan: &Path) -> Option<PathBuf> {
    let beside = scan.with_extension("label");
    let folder = scan.parent()?.parent().map(|above| above.join("labels"));
    let apart = folder.and_then(|folder| Some(folder.join(beside.file_name()?)));
    std::iter::once(beside)
        .chain(apart)
        .find(|path| path.is_file())
}

/// Labels in the order of the points.
struct Labels {
    path: PathBuf,
    source: Source,
}

impl Labels {
    fn open(scan: &Path) -> Result<Option<Labels>, PointFileError> {
        let Some(path) = labels_of(scan) else {
            return Ok(None);
        };
        let file = File::open(&path).map_err(|source| PointFileError::Io { byte: 0, source })?;
        let source = Source::new(Box::new(BufReader::new(file)));
        Ok(Some(Labels { path, source }))
    }

    /// Class of the next point: the low 16 bits, the others are the instance; 0 is unlabelled.
    fn next(&mut self, number: u64) -> Result<u16, PointFileError> {
        let mut label = [0; 4];
        let path = self.path.display();
        let part = format!("label {number} of {path}");
        self.source.exact(&mut label, part)?;
        let [low, high, ..] = label;
        Ok(match u16::from_le_bytes([low, high]) {
            0 => UNLABELED,
            class => class,
        })
    }

    /// Fails if there are more labels than points.
    fn end(mut self, points: u64) -> Result<(), PointFileError> {
        if self.source.peek()?.is_empty() {
            return Ok(());
        }
        Err(PointFileError::Data {
            format: PointFormat::KittiBin,
            byte: self.source.byte(),
            reason: format!(
                "{} has labels for more than {points} points",
                self.path.display()
            ),
        })
    }
}

/// Reads a scan, with its labels if their file is found by its name.
///
/// Without a layout it must be a KITTI scan; `size_bytes` is its length if known.
pub(super) fn read(
    source: &mut Source,
    (name, size_bytes): (&Path, Option<u64>),
    layout: Option<BinLayout>,
    points: &mut Collector,
) -> Result<PointFormat, PointFileError> {
    if layout.is_none() {
        check_kitti(source.peek()?, size_bytes).map_err(|reason| PointFileError::Data {
            format: PointFormat::KittiBin,
            byte: 0,
            reason,
        })?;
    }
    let layout = layout.unwrap_or(BinLayout::KITTI);
    let (bytes, scalar) = (layout.bytes(), layout.scalar);
    let mut labels = Labels::open(name)?;
    let mut record = vec![0; bytes];
    let mut number = 0_u64;
    while !source.peek()?.is_empty() {
        number += 1;
        source.exact(&mut record, format_args!("point {number} of {bytes} bytes"))?;
        let coordinate = |axis: usize| {
            let bytes = record.get(axis * scalar.size()..).unwrap_or_default();
            scalar.decode(bytes).unwrap_or(f64::NAN)
        };
        let point_m = [0, 1, 2].map(coordinate);
        match &mut labels {
            Some(labels) => points.push_labelled(point_m, labels.next(number)?)?,
            None => points.push(point_m)?,
        }
    }
    labels.map_or(Ok(()), |labels| labels.end(number))?;
    Ok(PointFormat::KittiBin)
}
