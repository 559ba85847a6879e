//! Counting the occupied neighbours of all voxels.

use super::hash26::Cubes;
use super::{Report, timed};
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::{OccupancyList, VoxelStore};
use rayon::prelude::*;

/// Way to find neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NeighborMethod {
    /// One pass over the blocks of the store's cells.
    Pass,
    /// One look-up in the store for each touching neighbour of each voxel.
    Probe,
    /// The measure: 26 probes of a hash set for each cube.
    Hash26,
}

/// Counts pairs of a voxel and an occupied touching neighbour; `count` is that number.
///
/// `None` if the method is for cubes and the lattice is another.
pub fn neighbors(method: NeighborMethod, store: &dyn VoxelStore, name: &str) -> Option<Report> {
    let lattice = store.lattice();
    let (sys, (count, spent), bytes) = match method {
        NeighborMethod::Pass => {
            let cells = OccupancyList::from_keys(
                lattice.clone(),
                store.datum_index(),
                store.sorted_keys(),
                usize::MAX,
            );
            let result = timed(|| {
                let mut total = 0;
                cells.count_neighbors(lattice.touching_neighbors(), |_, count| {
                    total += u64::from(count);
                });
                total
            });
            (format!("{name}-pass"), result, cells.bytes())
        }
        NeighborMethod::Probe => {
            let result = timed(|| probe(store, lattice));
            (format!("{name}-probe"), result, store.bytes())
        }
        NeighborMethod::Hash26 => {
            if lattice.kind() != LatticeKind::Cubic {
                return None;
            }
            let cubes = Cubes::new(store);
            let result = timed(|| cubes.occupied_neighbors());
            ("hash26".to_owned(), result, cubes.bytes())
        }
    };
    Some(Report {
        n: store.len() as u64,
        voxels: store.len() as u64,
        bytes: bytes as u64,
        count: Some(count),
        ..Report::new(sys, lattice, spent)
    })
}

fn probe(store: &dyn VoxelStore, lattice: &Lattice) -> u64 {
    let around = lattice.touching_neighbors();
    let keys = store.sorted_keys();
    let occupied = |key: &MortonKey| {
        let w = key.unpack();
        let neighbors = around
            .iter()
            .filter_map(|n| MortonKey::pack([w[0] + n[0], w[1] + n[1], w[2] + n[2]]));
        neighbors.filter(|&k| store.contains(k)).count() as u64
    };
    keys.par_iter().map(occupied).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::{Store, insert};

    #[test]
    fn all_methods_count_the_same_pairs() {
        let lattice = Lattice::new(LatticeKind::Cubic, 1.0).unwrap();
        // A full 3 x 3 x 3 block and a cube apart: 27 cells with 3 indices in 7 adjacent pairs an axis.
        let mut points: Vec<[f32; 3]> = (0..27)
            .map(|i| [(i % 3) as f32, (i / 3 % 3) as f32, (i / 9) as f32])
            .collect();
        points.push([50.0, 0.0, -7.0]);
        let (_, store) = insert(Store::List, &lattice, points, None).unwrap();
        use NeighborMethod::{Hash26, Pass, Probe};
        for method in [Pass, Probe, Hash26] {
            let report = neighbors(method, store.as_ref(), "x").unwrap();
            assert_eq!(report.count, Some(7 * 7 * 7 - 27), "{method:?}");
            assert_eq!(report.n, 28);
        }
    }

    #[test]
    fn the_measure_is_for_cubes_only() {
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        let (_, store) = insert(Store::List, &lattice, vec![[0.0; 3]], None).unwrap();
        assert!(neighbors(NeighborMethod::Hash26, store.as_ref(), "x").is_none());
    }
}
