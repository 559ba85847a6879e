//! Distance of every cell of a box to the nearest occupied cell.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::error::{check_distance, check_point};
use super::shells::dual;
use super::{Query, QueryError};
use crate::lattice::{Lattice, LatticeIndex, MortonKey};
use crate::voxels::VoxelStore;

/// Cells that one task works on.
const CHUNK: usize = 1024;

/// A box along the axes of the map frame, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bounds {
    /// Lowest corner.
    pub min_m: Vector3<f64>,
    /// Highest corner.
    pub max_m: Vector3<f64>,
}

impl Bounds {
    /// True for points in the box or on its surface.
    pub fn contains(&self, point_m: &Vector3<f64>) -> bool {
        (0..3).all(|i| (self.min_m[i]..=self.max_m[i]).contains(&point_m[i]))
    }

    pub(super) fn check(&self) -> Result<(), QueryError> {
        check_point(&self.min_m)?;
        check_point(&self.max_m)?;
        let extents = self.max_m - self.min_m;
        if extents.iter().all(|x| *x >= 0.0) {
            Ok(())
        } else {
            Err(QueryError::Box(extents.into()))
        }
    }

    pub(super) fn moved(&self, by_m: &Vector3<f64>) -> Bounds {
        Bounds {
            min_m: self.min_m + by_m,
            max_m: self.max_m + by_m,
        }
    }
}

/// Distances from centres of cells to the nearest centre of an occupied cell.
#[derive(Clone, PartialEq, Debug)]
pub struct DistanceField {
    /// Cells whose centres are in the box, ascending.
    pub keys: Vec<MortonKey>,
    /// For each key, metres; 0 in occupied cells, infinite where the bound cuts.
    pub distance_m: Vec<f64>,
}

impl DistanceField {
    /// The distance of a cell, metres; `None` for cells out of the box.
    pub fn at(&self, key: MortonKey) -> Option<f64> {
        let index = self.keys.binary_search(&key).ok()?;
        self.distance_m.get(index).copied()
    }
}

impl<S: VoxelStore> Query<'_, S> {
    /// The exact distance field of all cells with centres in a box; distances beyond `max_m` are
    /// given as infinite. Cells out of the range of keys are left out.
    ///
    /// Works on all threads of the pool; fails if the box has more than `max_cells`.
    pub fn distance_field(
        &self,
        bounds: &Bounds,
        max_m: f64,
        max_cells: usize,
    ) -> Result<DistanceField, QueryError> {
        bounds.check()?;
        check_distance(max_m)?;
        let local = bounds.moved(&-self.store.datum_m());
        let lattice = self.store.lattice();
        let mut keys = cells_in(lattice, &local, max_cells)?;
        keys.par_sort_unstable();
        let distances = |cells: &[MortonKey]| {
            // The nearest cell of the last one bounds the distance of the next.
            let mut last: Option<LatticeIndex> = None;
            let distance = |key: &MortonKey| {
                let center_m = lattice.center(key.unpack());
                let known_m = last.map_or(max_m, |w| (lattice.center(w) - center_m).norm());
                let nearest = self.nearest_to(center_m, 1, known_m.min(max_m));
                let found = nearest.first();
                last = found.map(|found| found.key.unpack());
                found.map_or(f64::INFINITY, |found| found.distance_m)
            };
            cells.iter().map(distance).collect::<Vec<_>>()
        };
        let parts: Vec<Vec<f64>> = keys.par_chunks(CHUNK).map(distances).collect();
        let distance_m = parts.concat();
        Ok(DistanceField { keys, distance_m })
    }
}

/// The cells whose centres are in a box of the frame of the datum, row by row.
fn cells_in(
    lattice: &Lattice,
    bounds: &Bounds,
    max_cells: usize,
) -> Result<Vec<MortonKey>, QueryError> {
    let extents = bounds.max_m - bounds.min_m;
    let refuse = |cells: f64| QueryError::TooManyCells { cells, max_cells };
    let cells = extents.product() / lattice.cell_volume_m3();
    // The count of a box differs from its volume by at most its surface layer of cells.
    let side_m = 2.0 * lattice.covering_radius_m();
    let inner = extents.map(|x| (x - side_m).max(0.0)).product() / lattice.cell_volume_m3();
    let outer = extents.map(|x| x + side_m).product() / lattice.cell_volume_m3();
    if inner > max_cells as f64 || outer > u32::MAX.into() {
        return Err(refuse(cells));
    }
    let middle = 0.5 * (bounds.min_m + bounds.max_m);
    let ranges = dual(lattice).map(|row| {
        let half = 0.5 * row.abs().dot(&extents) + 1e-6;
        let at = row.dot(&middle);
        // Casts saturate, and no key has an index beyond 2^20.
        let limit = f64::from(1 << 20);
        let (low, high) = ((at - half).ceil(), (at + half).floor());
        low.max(-limit) as i32..=high.min(limit - 1.0) as i32
    });
    let row_step = lattice.center([1, 0, 0]);
    let mut keys = Vec::new();
    for z in ranges[2].clone() {
        for y in ranges[1].clone() {
            let start = lattice.center([0, y, z]);
            let (low, high) = clip(bounds, &start, &row_step);
            let first = (low - 1e-6).ceil().max(f64::from(*ranges[0].start())) as i32;
            let last = (high + 1e-6).floor().min(f64::from(*ranges[0].end())) as i32;
            for x in first..=last {
                let w = [x, y, z];
                if bounds.contains(&lattice.center(w)) {
                    keys.extend(MortonKey::pack(w));
                }
            }
            if keys.len() > max_cells {
                return Err(refuse(cells));
            }
        }
    }
    Ok(keys)
}

/// For which t the point `start + t step` is in the box; an empty range if for none.
fn clip(bounds: &Bounds, start: &Vector3<f64>, step: &Vector3<f64>) -> (f64, f64) {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in 0..3 {
        let (a, b) = (bounds.min_m[i] - start[i], bounds.max_m[i] - start[i]);
        if step[i] == 0.0 {
            if a > 0.0 || b < 0.0 {
                return (1.0, 0.0);
            }
            continue;
        }
        let (a, b) = (a / step[i], b / step[i]);
        low = low.max(a.min(b));
        high = high.min(a.max(b));
    }
    (low, high)
}
