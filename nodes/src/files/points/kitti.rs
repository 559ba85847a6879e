//! KITTI Velodyne scans: records of x, y, z and intensity as little-endian f32, and nothing else.

use super::collect::Collector;
use super::scalar::Scalar;
use super::source::Source;
use super::{PointFileError, PointFormat};

/// Bytes of a point.
const RECORD: usize = 16;

pub(super) fn read(
    source: &mut Source,
    points: &mut Collector,
) -> Result<PointFormat, PointFileError> {
    let mut record = [0; RECORD];
    let mut number = 0_u64;
    while !source.peek()?.is_empty() {
        number += 1;
        source.exact(
            &mut record,
            format_args!("point {number} of {RECORD} bytes"),
        )?;
        let coordinate = |at: usize| {
            let bytes = record.get(at..).unwrap_or_default();
            Scalar::F32.decode(bytes).unwrap_or(f64::NAN)
        };
        points.push([0, 4, 8].map(coordinate))?;
    }
    Ok(PointFormat::KittiBin)
}
