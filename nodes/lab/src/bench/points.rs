//! Raw point files and their scans.

use crate::{AnyError, at};
use nalgebra::Vector3;
use std::ffi::OsString;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes of a point: x, y, z (m) and intensity as little-endian f32.
const POINT_BYTES: usize = 16;
/// Bytes of a scan's record: position of the scanner as three f64 (m), points as u64; little-endian.
const SCAN_BYTES: usize = 32;

/// One scan of a point file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanRecord {
    /// Position of the scanner, m.
    pub origin_m: Vector3<f64>,
    /// Number of points of the scan; scans are consecutive in the file.
    pub points: usize,
}

impl ScanRecord {
    pub(super) fn to_bytes(self) -> [[u8; 8]; 4] {
        let [x, y, z] = <[f64; 3]>::from(self.origin_m).map(f64::to_le_bytes);
        [x, y, z, (self.points as u64).to_le_bytes()]
    }
}

/// Path of the scans of a point file: its name with `.scans` added.
pub fn scans_path(points: &Path) -> PathBuf {
    let mut name = OsString::from(points);
    name.push(".scans");
    PathBuf::from(name)
}

/// Reads the positions (m) of a point file, at most `max_points` from its start.
pub fn read_points(path: &Path, max_points: usize) -> Result<Vec<[f32; 3]>, AnyError> {
    let bytes = read(path, POINT_BYTES, max_points)?;
    let points = bytes.as_chunks::<4>().0.as_chunks::<4>().0.iter();
    let position = |&[x, y, z, _]: &[[u8; 4]; 4]| [x, y, z].map(f32::from_le_bytes);
    Ok(points.map(position).collect())
}

/// Reads the scans beside a point file of which `points` were read; the last scan is cut to fit.
pub fn read_scans(points_path: &Path, points: usize) -> Result<Vec<ScanRecord>, AnyError> {
    let path = scans_path(points_path);
    let bytes = read(&path, SCAN_BYTES, usize::MAX)?;
    let (mut scans, mut left, mut scanned) = (Vec::new(), points, 0u128);
    for &[x, y, z, claimed] in bytes.as_chunks::<8>().0.as_chunks::<4>().0 {
        let claimed = u64::from_le_bytes(claimed);
        scanned += u128::from(claimed);
        let points = usize::try_from(claimed).unwrap_or(usize::MAX).min(left);
        left -= points;
        if points > 0 {
            let origin_m = Vector3::from([x, y, z].map(f64::from_le_bytes));
            scans.push(ScanRecord { origin_m, points });
        }
    }
    if left > 0 {
        let path = path.display();
        return Err(
            format!("{path}: the scans hold {scanned} points, the point file {points}").into(),
        );
    }
    Ok(scans)
}

fn read(path: &Path, record: usize, max_records: usize) -> Result<Vec<u8>, AnyError> {
    let limit = max_records.saturating_mul(record) as u64;
    let file = File::open(path).map_err(at(path))?;
    let mut bytes = Vec::new();
    file.take(limit).read_to_end(&mut bytes).map_err(at(path))?;
    if bytes.len() % record != 0 {
        let (path, bytes) = (path.display(), bytes.len());
        return Err(format!(
            "{path}: {bytes} bytes are not a whole number of {record}-byte records"
        )
        .into());
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn file_of(points: usize, scans: &[usize]) -> (tempfile::TempDir, PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.xyzi");
        let point = |i: usize| [i as f32, 0.5, -1.25, 7.0].map(f32::to_le_bytes);
        let bytes: Vec<_> = (0..points).flat_map(point).collect();
        fs::write(&path, bytes.as_flattened()).unwrap();
        let origin_m = Vector3::new(1.0, -2.0, 3.5);
        let record = |&points: &usize| ScanRecord { origin_m, points }.to_bytes();
        let records: Vec<_> = scans.iter().flat_map(record).collect();
        fs::write(scans_path(&path), records.as_flattened()).unwrap();
        (dir, path)
    }

    #[test]
    fn points_and_scans_come_back() {
        let (_dir, path) = file_of(5, &[2, 0, 3]);
        let points = read_points(&path, usize::MAX).unwrap();
        assert_eq!(points.len(), 5);
        assert_eq!(points[4], [4.0, 0.5, -1.25]);
        let scans = read_scans(&path, 5).unwrap();
        assert_eq!(scans.iter().map(|s| s.points).collect::<Vec<_>>(), [2, 3]);
        assert_eq!(scans[0].origin_m, Vector3::new(1.0, -2.0, 3.5));
    }

    #[test]
    fn fewer_points_cut_the_last_scan() {
        let (_dir, path) = file_of(9, &[4, 4, 1]);
        assert_eq!(read_points(&path, 6).unwrap().len(), 6);
        let scans = read_scans(&path, 6).unwrap();
        assert_eq!(scans.iter().map(|s| s.points).collect::<Vec<_>>(), [4, 2]);
    }

    #[test]
    fn cut_files_and_missing_scans_are_refused() {
        let (_dir, path) = file_of(3, &[2]);
        let error = read_scans(&path, 3).unwrap_err().to_string();
        assert!(error.contains("hold 2 points, the point file 3"), "{error}");
        let mut bytes = fs::read(&path).unwrap();
        bytes.pop();
        fs::write(&path, bytes).unwrap();
        let error = read_points(&path, usize::MAX).unwrap_err().to_string();
        assert!(error.contains("47 bytes"), "{error}");
        assert!(read_points(Path::new("/nonexistent"), 1).is_err());
    }
}
