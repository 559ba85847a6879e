//! Free space along the rays of scans.

use super::insert::clouds;
use super::points::ScanRecord;
use super::{Report, timed};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::Lattice;
use lattice_core::raycast::{
    ClearOptions, FreeSpaceError, FreeSpaceMap, FreeSpaceOptions, RayBundle, RayClearer,
};
use lattice_core::voxels::{OccupancyList, VoxelStore};
use nalgebra::Vector3;

/// Most memory of a map, bytes: more than any benchmark makes.
const MAX_BYTES: usize = 1 << 40;

/// Use of the rays.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RaycastMethod {
    /// Log-odds of all cells, including free ones.
    Map,
    /// A store of voxels, from which those that rays pass through are removed.
    Clear,
    /// A store of voxels, from which those that are free by the log-odds are removed.
    Evidence,
}

/// Inserts all scans without a range limit; only the insertions are timed.
///
/// The report counts occupied voxels, and as `count` all known cells, or the voxels removed.
pub fn raycast(
    method: RaycastMethod,
    lattice: &Lattice,
    points_m: Vec<[f32; 3]>,
    scans: &[ScanRecord],
) -> Result<Report, FreeSpaceError> {
    let n = points_m.len() as u64;
    let clouds = clouds(points_m, Some(scans));
    let bundles = scans.iter().zip(&clouds).map(|(scan, ends)| RayBundle {
        origin_m: scan.origin_m,
        ends,
    });
    let report = match method {
        RaycastMethod::Map => map(lattice, bundles)?,
        RaycastMethod::Clear => {
            let options = ClearOptions {
                max_bytes: MAX_BYTES,
                ..ClearOptions::default()
            };
            let mut clearer = RayClearer::new(lattice, options);
            let clear = |store: &mut OccupancyList, scan: &[RayBundle]| {
                clearer.clear(store, scan).removed.len()
            };
            store("lattice-clear", lattice, bundles, clear)?
        }
        RaycastMethod::Evidence => {
            let options = FreeSpaceOptions {
                free_level: None,
                max_bytes: MAX_BYTES,
                ..FreeSpaceOptions::default()
            };
            let mut map = FreeSpaceMap::new(lattice.clone(), Vector3::zeros(), options)?;
            let clear = |store: &mut OccupancyList, scan: &[RayBundle]| {
                map.clear(store, scan).removed.len()
            };
            store("lattice-evidence", lattice, bundles, clear)?
        }
    };
    Ok(Report { n, ..report })
}

fn map<'a>(
    lattice: &Lattice,
    bundles: impl Iterator<Item = RayBundle<'a>>,
) -> Result<Report, FreeSpaceError> {
    let options = FreeSpaceOptions {
        max_bytes: MAX_BYTES,
        ..FreeSpaceOptions::default()
    };
    let mut map = FreeSpaceMap::new(lattice.clone(), Vector3::zeros(), options)?;
    let (refused, spent) = timed(|| {
        let refused = bundles.map(|bundle| {
            let report = map.insert_scan(&[bundle]);
            report.out_of_range + report.not_finite + report.blocks_refused
        });
        refused.sum::<u64>()
    });
    debug_assert_eq!(refused, 0);
    let occupied = map.occupied_keys().len() as u64;
    Ok(Report {
        voxels: occupied,
        bytes: map.bytes() as u64,
        count: Some(occupied + map.free_keys().len() as u64),
        ..Report::new("lattice-free-space", lattice, spent)
    })
}

fn store<'a>(
    name: &str,
    lattice: &Lattice,
    bundles: impl Iterator<Item = RayBundle<'a>>,
    mut clear: impl FnMut(&mut OccupancyList, &[RayBundle]) -> usize,
) -> Result<Report, FreeSpaceError> {
    let mut store = OccupancyList::new(lattice.clone(), Vector3::zeros(), MAX_BYTES)?;
    let (removed, spent) = timed(|| {
        let removed = bundles.map(|bundle| {
            let ends: &Cloud = bundle.ends;
            store.insert(ends);
            clear(&mut store, &[bundle])
        });
        removed.sum::<usize>()
    });
    Ok(Report {
        voxels: store.len() as u64,
        bytes: store.bytes() as u64,
        count: Some(removed as u64),
        ..Report::new(name, lattice, spent)
    })
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
        let points = vec![[5.0, 0.1, 0.1], [10.0, 0.1, 0.1], [10.0, 0.1, 0.1]];
        let run = |method| {
            let scans = [scan; 3];
            raycast(method, &lattice, points.clone(), &scans).unwrap()
        };
        let map = run(RaycastMethod::Map);
        assert_eq!((map.n, map.voxels, map.count), (3, 2, Some(11)));
        let clear = run(RaycastMethod::Clear);
        assert_eq!((clear.n, clear.voxels, clear.count), (3, 1, Some(1)));
        let evidence = run(RaycastMethod::Evidence);
        assert_eq!((evidence.voxels, evidence.count), (2, Some(0)));
    }
}
