//! Free space along the rays of scans.

use lattice_core::lattice::Lattice;
use lattice_core::raycast::{FreeSpaceError, FreeSpaceMap, FreeSpaceOptions};
use nalgebra::Vector3;

use super::insert::clouds;
use super::points::ScanRecord;
use super::{Report, timed};

/// Most memory of a map, bytes: more than any benchmark makes.
const MAX_BYTES: usize = 1 << 40;

/// Inserts all scans without a range limit; only the insertions are timed.
///
/// The report counts occupied voxels, and as `count` all known cells.
pub fn raycast(
    lattice: &Lattice,
    res_m: f64,
    points_m: Vec<[f32; 3]>,
    scans: &[ScanRecord],
) -> Result<Report, FreeSpaceError> {
    let n = points_m.len();
    let clouds = clouds(points_m, Some(scans));
    let options = FreeSpaceOptions {
        max_bytes: MAX_BYTES,
        ..FreeSpaceOptions::default()
    };
    let mut map = FreeSpaceMap::new(lattice.clone(), Vector3::zeros(), options)?;
    let (refused, spent) = timed(|| {
        let pairs = scans.iter().zip(&clouds);
        let refused = pairs.map(|(scan, cloud)| {
            let report = map.insert_scan(scan.origin_m, cloud);
            report.out_of_range + report.not_finite + report.blocks_refused
        });
        refused.sum::<u64>()
    });
    debug_assert_eq!(refused, 0);
    let counts = map.counts();
    let mut report = Report::new("lattice-free-space", lattice.kind().name(), res_m, spent);
    report.n = n as u64;
    report.voxels = counts.occupied;
    report.bytes = map.bytes() as u64;
    report.count = Some(counts.occupied + counts.free);
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;

    #[test]
    fn a_ray_along_an_axis_frees_the_cubes_before_its_end() {
        let lattice = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
        let scan = ScanRecord {
            origin_m: Vector3::zeros(),
            points: 1,
        };
        let report = raycast(&lattice, 1.0, vec![[10.0, 0.1, 0.1]], &[scan]).unwrap();
        assert_eq!((report.n, report.voxels, report.count), (1, 1, Some(11)));
    }
}
