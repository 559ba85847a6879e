//! Inserting a cloud into a store.

use lattice_core::cloud::Cloud;
use lattice_core::lattice::Lattice;
use lattice_core::voxels::{DatumError, OccupancyList, VoxelList, VoxelStore};
use nalgebra::Vector3;

use super::points::ScanRecord;
use super::{Report, timed};

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

/// An empty store about the origin.
fn empty(store: Store, lattice: &Lattice) -> Result<Box<dyn VoxelStore + Send>, DatumError> {
    match store {
        Store::Occupancy => {
            let list = OccupancyList::new(lattice.clone(), Vector3::zeros(), usize::MAX)?;
            Ok(Box::new(list))
        }
        Store::List => {
            let list = VoxelList::new(lattice.clone(), Vector3::zeros(), MAX_VOXELS)?;
            Ok(Box::new(list))
        }
    }
}

/// Options of an insertion.
#[derive(Clone, Copy, Debug)]
pub struct InsertOptions {
    /// The store.
    pub store: Store,
    /// Side of a cube of the cells' volume, m; for the report.
    pub res_m: f64,
}

/// Inserts `points_m`, scan by scan where scans are given; only the insertions are timed.
///
/// Runs on the threads of the current rayon pool. Also returns the filled store.
pub fn insert(
    options: InsertOptions,
    lattice: &Lattice,
    points_m: Vec<[f32; 3]>,
    scans: Option<&[ScanRecord]>,
) -> Result<(Report, Box<dyn VoxelStore + Send>), DatumError> {
    let n = points_m.len();
    let clouds = clouds(points_m, scans);
    let mut store = empty(options.store, lattice)?;
    let (inserted, spent) = timed(|| {
        let reports = clouds.iter().map(|cloud| store.insert(cloud).inserted);
        reports.sum::<u64>()
    });
    let mut report = Report::new(
        options.store.name(),
        lattice.kind().name(),
        options.res_m,
        spent,
    );
    report.n = n as u64;
    report.voxels = store.len() as u64;
    report.bytes = store.bytes() as u64;
    report.count = (inserted != n as u64).then_some(inserted);
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
            let options = InsertOptions { store, res_m: 0.1 };
            let (whole, _) = insert(options, &lattice, points.clone(), None).unwrap();
            let (parts, store) = insert(options, &lattice, points.clone(), Some(&scans)).unwrap();
            assert_eq!(whole.voxels, 301);
            assert_eq!(parts.voxels, 301);
            assert_eq!(store.len(), 301);
            assert_eq!((parts.n, parts.count), (1000, None));
        }
    }
}
