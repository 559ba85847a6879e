//! Inserting a cloud into a store.

use super::points::ScanRecord;
use super::{Report, timed};
use lattice_core::cloud::Cloud;
use lattice_core::lattice::Lattice;
use lattice_core::voxels::{DatumError, OccupancyList, VoxelList, VoxelStore};
use nalgebra::Vector3;

/// Most voxels of a list: more than any benchmark makes.
const MAX_VOXELS: usize = 1 << 31;

/// Store that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Store {
    /// [`OccupancyList`]: one bit of each voxel.
    Occupancy,
    /// [`VoxelList`]: count and sum of offsets of each voxel.
    List,
}

impl Store {
    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Occupancy => "lattice-occupancy",
            Self::List => "lattice-list",
        }
    }
}

fn empty(store: Store, lattice: &Lattice) -> Result<Box<dyn VoxelStore + Send>, DatumError> {
    let (lattice, datum_m) = (lattice.clone(), Vector3::zeros());
    Ok(match store {
        Store::Occupancy => Box::new(OccupancyList::new(lattice, datum_m, usize::MAX)?),
        Store::List => Box::new(VoxelList::new(lattice, datum_m, MAX_VOXELS)?),
    })
}

/// Inserts `points_m`, scan by scan where scans are given; only the insertions are timed.
///
/// Runs on the threads of the current rayon pool. Also returns the filled store.
pub fn insert(
    kind: Store,
    lattice: &Lattice,
    points_m: Vec<[f32; 3]>,
    scans: Option<&[ScanRecord]>,
) -> Result<(Report, Box<dyn VoxelStore + Send>), DatumError> {
    let n = points_m.len() as u64;
    let clouds = clouds(points_m, scans);
    let mut store = empty(kind, lattice)?;
    let (inserted, spent) = timed(|| {
        let reports = clouds.iter().map(|cloud| store.insert(cloud).inserted);
        reports.sum::<u64>()
    });
    let report = Report {
        n,
        voxels: store.len() as u64,
        bytes: store.bytes() as u64,
        count: (inserted != n).then_some(inserted),
        ..Report::new(kind.name(), lattice, spent)
    };
    Ok((report, store))
}

/// The whole cloud, or one cloud a scan.
pub(super) fn clouds(points_m: Vec<[f32; 3]>, scans: Option<&[ScanRecord]>) -> Vec<Cloud> {
    let cloud = |offsets_m| Cloud {
        stamp_ns: 0,
        datum_m: Vector3::zeros(),
        offsets_m,
    };
    let Some(scans) = scans else {
        return vec![cloud(points_m)];
    };
    let mut rest = points_m.as_slice();
    let mut clouds = Vec::with_capacity(scans.len());
    for scan in scans {
        let (own, others) = rest.split_at(scan.points.min(rest.len()));
        clouds.push(cloud(own.to_vec()));
        rest = others;
    }
    clouds
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;

    #[test]
    fn scan_by_scan_fills_the_same_voxels() {
        let lattice = Lattice::new(LatticeKind::Cubic, 0.001).unwrap();
        let points: Vec<[f32; 3]> = (0..1000).map(|i| [0.03 * i as f32, 0.0, 1.0]).collect();
        let scan = |points| ScanRecord {
            origin_m: Vector3::zeros(),
            points,
        };
        let scans = [scan(300), scan(1), scan(699)];
        for store in [Store::Occupancy, Store::List] {
            let (whole, _) = insert(store, &lattice, points.clone(), None).unwrap();
            let (parts, store) = insert(store, &lattice, points.clone(), Some(&scans)).unwrap();
            assert_eq!([whole.voxels, parts.voxels, store.len() as u64], [301; 3]);
            assert_eq!((parts.n, parts.count, parts.res), (1000, None, 0.1));
        }
    }
}
