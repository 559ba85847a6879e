//! E57 files (ASTM E2807): the scans in the file's frame, transformed by their poses.

use std::fs::File;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::e57::{CartesianCoordinate, E57Reader};

use super::collect::Collector;
use super::error::PointFileError;
use super::format::PointFormat;
use super::source::BUFFER;

/// Reads all scans of a file; points marked invalid are skipped and counted.
pub(super) fn read(path: &Path, points: &mut Collector) -> Result<PointFormat, PointFileError> {
    let io = |source| PointFileError::Io { byte: 0, source };
    let file = BufReader::with_capacity(BUFFER, File::open(path).map_err(io)?);
    let read = catch_unwind(AssertUnwindSafe(|| read_scans(file, points)));
    read.unwrap_or_else(|_| Err(fault("its data is damaged")))?;
    Ok(PointFormat::E57)
}

fn read_scans(file: BufReader<File>, points: &mut Collector) -> Result<(), PointFileError> {
    let mut file = E57Reader::new(file).map_err(fault)?;
    for (number, scan) in (1..).zip(file.pointclouds()) {
        let fault = |error| fault(format!("scan {number}: {error}"));
        points.promise_more(scan.records)?;
        let mut scan = file.pointcloud_simple(&scan).map_err(fault)?;
        scan.intensity_to_color(false);
        scan.normalize_intensity(false);
        scan.normalize_color(false);
        for point in scan {
            points.push(match point.map_err(fault)?.cartesian {
                CartesianCoordinate::Valid { x, y, z } => [x, y, z],
                _ => [f64::NAN; 3],
            })?;
        }
    }
    Ok(())
}

fn fault(error: impl ToString) -> PointFileError {
    PointFileError::Data {
        format: PointFormat::E57,
        byte: 0,
        reason: error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use ::e57::{E57Writer, Record, RecordValue};

    use crate::files::points::{PointFileOptions, read_points};

    fn written() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan.e57");
        let mut file = E57Writer::from_file(&path, "file").unwrap();
        let prototype = [
            Record::CARTESIAN_X_F64,
            Record::CARTESIAN_Y_F64,
            Record::CARTESIAN_Z_F64,
        ];
        for scan in ["first", "second"] {
            let mut scan = file.add_pointcloud(scan, prototype.to_vec()).unwrap();
            scan.set_transform(Some(::e57::Transform {
                rotation: ::e57::Quaternion {
                    w: 0.5_f64.sqrt(),
                    x: 0.0,
                    y: 0.0,
                    z: 0.5_f64.sqrt(),
                },
                translation: ::e57::Translation {
                    x: 10.0,
                    y: 0.0,
                    z: 0.0,
                },
            }));
            for i in 0..20 {
                let point = [f64::from(i), 0.0, 1.0].map(RecordValue::Double);
                scan.add_point(point.to_vec()).unwrap();
            }
            scan.finalize().unwrap();
        }
        file.finalize().unwrap();
        std::fs::read(&path).unwrap()
    }

    fn points(bytes: &[u8], max_points: usize) -> Result<Vec<[f64; 3]>, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan");
        std::fs::write(&path, bytes).unwrap();
        let read = read_points(
            &path,
            &PointFileOptions {
                max_points,
                ..PointFileOptions::default()
            },
        );
        read.map(|file| file.points_m).map_err(|e| e.to_string())
    }

    #[test]
    fn scans_are_placed_by_their_poses() {
        let bytes = written();
        let points_m = points(&bytes, 40).unwrap();
        assert_eq!(points_m.len(), 40);
        // Turned to the left.
        for (i, [x, y, z]) in points_m.into_iter().enumerate() {
            let expected = [10.0, (i % 20) as f64, 1.0];
            for (found, expected) in [x, y, z].into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{i}: {x} {y} {z}");
            }
        }
        let error = points(&bytes, 39).unwrap_err();
        assert!(error.contains("40 points or more"), "{error}");
    }

    #[test]
    fn damaged_files_are_errors() {
        let bytes = written();
        for length in (8..bytes.len()).step_by(97) {
            assert!(points(&bytes[..length], 40).is_err(), "{length}");
        }
        for at in (8..bytes.len()).step_by(31) {
            let mut bytes = bytes.clone();
            bytes[at] ^= 0x55;
            assert!(points(&bytes, 40).is_err(), "{at}");
        }
    }
}
