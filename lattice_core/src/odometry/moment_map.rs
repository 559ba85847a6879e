//! A voxel list whose cells keep moments of their points.

use std::sync::OnceLock;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::moments::Moments;
use super::surface::Surface;
use crate::lattice::{BlockKey, Lattice, LatticeIndex};
use crate::voxels::store::hash_table::{Place, Row, Table};

#[derive(Clone)]
struct Cell {
    code: u64,
    index: LatticeIndex,
    moments: Moments,
    /// Surface, computed at the first query after a change.
    surface: OnceLock<Surface>,
}

impl Row for Cell {
    fn code(&self) -> u64 {
        self.code
    }
}

/// Occupied cells of a lattice, each with count, sums and second moments of its points.
///
/// All sums are integers: results do not depend on the order of points or the number of threads, and subtraction is
/// exact.
#[derive(Clone)]
pub struct MomentMap {
    lattice: Lattice,
    cells: Table<Cell>,
    max_cells: usize,
}

impl MomentMap {
    /// Creates a map of at most `max_cells` cells; points of further cells are ignored.
    pub fn new(lattice: Lattice, max_cells: usize) -> MomentMap {
        MomentMap {
            lattice,
            cells: Table::new(),
            max_cells,
        }
    }

    /// Lattice of the map.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Number of cells with points.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// True if the map has no points.
    pub fn is_empty(&self) -> bool {
        self.cells.len() == 0
    }

    /// Adds points, map frame, metres.
    pub fn add(&mut self, points_m: &[Vector3<f64>]) {
        for point in points_m {
            self.change(point, 1);
        }
    }

    /// Discards cached surfaces of the changed cells and their neighbours. To be called after points have changed.
    pub(super) fn renew_surfaces(&mut self) {
        for number in 0..self.cells.len() as u32 {
            if let Some(cell) = self.cells.row_mut(number) {
                cell.surface = OnceLock::new();
            }
        }
    }

    /// Subtracts points that were added before, map frame, metres.
    pub fn subtract(&mut self, points_m: &[Vector3<f64>]) {
        for point in points_m {
            self.change(point, -1);
        }
    }

    fn change(&mut self, point: &Vector3<f64>, sign: i64) {
        let Some(index) = self.lattice.quantize(point) else {
            return;
        };
        let Some(code) = BlockKey::pack(index).map(BlockKey::raw) else {
            return;
        };
        let new = || Cell {
            code,
            index,
            moments: Moments::default(),
            surface: OnceLock::new(),
        };
        let limit = if sign > 0 { self.max_cells } else { 0 };
        let place = self.cells.find_or_add(code, limit, new);
        let Some(Place::Known(number) | Place::New(number)) = place else {
            return;
        };
        if let Some(cell) = self.cells.row_mut(number) {
            let offset = point - self.lattice.center(index);
            cell.moments.add(&Moments::of(&offset), sign);
            cell.surface = OnceLock::new();
            if cell.moments.count() <= 0 {
                self.cells.remove(code);
            }
        }
    }

    /// Moments of the cell that contains a point (map frame, metres); `None` for a cell without points.
    pub fn moments_at(&self, point: &Vector3<f64>) -> Option<&Moments> {
        let code = BlockKey::pack(self.lattice.quantize(point)?)?.raw();
        Some(&self.cell(code)?.moments)
    }

    /// Cells by lattice index, in ascending order.
    pub fn sorted(&self) -> Vec<(LatticeIndex, Moments)> {
        let mut all: Vec<_> = (self.cells.rows().iter())
            .map(|cell| (cell.index, cell.moments))
            .collect();
        all.sort_by_key(|(index, _)| *index);
        all
    }

    /// Centroids of all cells in the order of their creation, metres.
    pub fn centroids_m(&self) -> Vec<Vector3<f64>> {
        let cells = self.cells.rows().par_iter();
        cells
            .map(|cell| self.lattice.center(cell.index) + cell.moments.mean_m())
            .collect()
    }

    /// Removes the cells beyond a distance from a point, metres.
    pub fn keep_within(&mut self, center_m: &Vector3<f64>, distance_m: f64) {
        let is_far = |cell: &&Cell| {
            (self.lattice.center(cell.index) - center_m).norm_squared() > distance_m * distance_m
        };
        let far = self.cells.rows().iter().filter(is_far);
        let far: Vec<u64> = far.map(|cell| cell.code).collect();
        for code in far {
            self.cells.remove(code);
        }
    }

    /// Surface of a cell, with the points of its neighbours if its own show no plane.
    fn surface_of(&self, cell: &Cell) -> Surface {
        let (center, side_m) = (self.lattice.center(cell.index), self.lattice.cell_side_m());
        let own = Surface::of(&cell.moments, &center, side_m);
        if own.plane.is_some() {
            return own;
        }
        let mut merged = cell.moments;
        for step in self.lattice.face_neighbors() {
            let index = [0, 1, 2].map(|i| cell.index[i].wrapping_add(step[i]));
            let near = BlockKey::pack(index).and_then(|key| self.cell(key.raw()));
            if let Some(near) = near {
                let offset = self.lattice.center(near.index) - center;
                merged.add(&near.moments.about(&offset), 1);
            }
        }
        own.with_plane_of(&merged, side_m)
    }

    fn cell(&self, code: u64) -> Option<&Cell> {
        self.cells.rows().get(self.cells.find(code)? as usize)
    }

    /// Surface with the nearest centroid to a point within `gate_m`, among its cell and the cells that share a face
    /// with it.
    pub(super) fn nearest(&self, point: &Vector3<f64>, gate_m: f64) -> Option<&Surface> {
        let index = self.lattice.quantize(point)?;
        let mut best = (gate_m * gate_m, None);
        let mut look = |index: LatticeIndex| {
            let Some(cell) = BlockKey::pack(index).and_then(|key| self.cell(key.raw())) else {
                return;
            };
            let surface = cell.surface.get_or_init(|| self.surface_of(cell));
            let distance = (surface.mean_m - point).norm_squared();
            if distance < best.0 {
                best = (distance, Some(surface));
            }
        };
        look(index);
        for step in self.lattice.face_neighbors() {
            look([0, 1, 2].map(|i| index[i].wrapping_add(step[i])));
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::lattice::LatticeKind;

    fn map() -> MomentMap {
        MomentMap::new(Lattice::new(LatticeKind::Fcc, 0.125).unwrap(), 1000)
    }

    fn points(max: usize) -> impl Strategy<Value = Vec<Vector3<f64>>> {
        let point = prop::array::uniform3(-3.0..3.0).prop_map(Vector3::<f64>::from);
        prop::collection::vec(point, 0..max)
    }

    proptest! {
        #[test]
        fn what_was_added_is_taken_out_exactly(first in points(60), second in points(60)) {
            let mut changed = map();
            changed.add(&first);
            let before = changed.sorted();
            changed.add(&second);
            changed.subtract(&second);
            prop_assert_eq!(&changed.sorted(), &before);
            changed.subtract(&first);
            prop_assert!(changed.is_empty());
        }

        #[test]
        fn the_order_of_points_changes_nothing(mut points in points(80)) {
            let mut forward = map();
            forward.add(&points);
            points.reverse();
            let mut backward = map();
            backward.add(&points);
            prop_assert_eq!(forward.sorted(), backward.sorted());
        }
    }

    #[test]
    fn moments_are_those_of_the_points() {
        let mut map = map();
        let center = map.lattice().center([1, 0, 0]);
        let offsets = [[0.05, 0.0, 0.0], [-0.03, 0.02, 0.0], [0.01, 0.01, -0.06]];
        let points = offsets.map(|offset| center + Vector3::from(offset));
        map.add(&points);
        let moments = map.moments_at(&center).unwrap();
        assert_eq!(moments.count(), 3);
        let mean = points.iter().sum::<Vector3<f64>>() / 3.0;
        assert!((center + moments.mean_m() - mean).norm() < 1e-9);
        let spread = points.map(|p| (p - mean) * (p - mean).transpose());
        let covariance = spread.iter().sum::<nalgebra::Matrix3<f64>>() / 3.0;
        assert!((moments.covariance_m2() - covariance).norm() < 1e-9);
    }

    #[test]
    fn a_full_map_takes_no_further_cells() {
        let mut map = MomentMap::new(Lattice::new(LatticeKind::Fcc, 1.0).unwrap(), 2);
        let apart = [0.0, 10.0, 20.0].map(|x| Vector3::new(x, 0.0, 0.0));
        map.add(&apart);
        assert_eq!(map.len(), 2);
        map.keep_within(&Vector3::zeros(), 5.0);
        assert_eq!(map.len(), 1);
    }
}
