//! Shared corners of adjacent cells, identified once per lattice and then exactly.

use lattice_core::lattice::{Lattice, LatticeIndex};
use nalgebra::Vector3;

/// Corners closer than this, relative to the covering radius, are equal.
const SAME: f64 = 1e-6;

/// Unique identifier of every corner, independent of the cell it is looked up from.
#[derive(Clone, Debug)]
pub struct SharedVertices {
    /// For each corner of cell 0: the adjacent cell of lowest index, and the corner's number in
    /// that cell.
    owners: Vec<(LatticeIndex, u16)>,
}

impl SharedVertices {
    /// Matches the corners of a cell with those of all touching cells.
    pub fn new(lattice: &Lattice) -> SharedVertices {
        let corners = &lattice.cell().vertices;
        let limit_m = SAME * lattice.covering_radius_m();
        let cells = || std::iter::once([0; 3]).chain(lattice.touching_neighbors().iter().copied());
        let owner = |corner: &Vector3<f64>| {
            let is_same =
                |w, other: &Vector3<f64>| (lattice.center(w) + other - corner).norm() <= limit_m;
            let same = cells().flat_map(|w| {
                let numbered = (0..)
                    .zip(corners)
                    .filter(move |(_, other)| is_same(w, other));
                numbered.map(move |(number, _)| (w, number))
            });
            same.min().unwrap_or_default()
        };
        SharedVertices {
            owners: corners.iter().map(owner).collect(),
        }
    }

    /// Identifier of a corner of the cell with this index, equal for all cells that share the corner: a cell, and the
    /// number of the corner in it.
    ///
    /// `None` if there is no such corner, or an index overflows.
    pub fn name(&self, [x, y, z]: LatticeIndex, corner: u16) -> Option<(LatticeIndex, u16)> {
        let &([dx, dy, dz], number) = self.owners.get(usize::from(corner))?;
        let w = [x.checked_add(dx)?, y.checked_add(dy)?, z.checked_add(dz)?];
        Some((w, number))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use lattice_core::lattice::LatticeKind;

    use super::*;

    #[test]
    fn names_agree_where_positions_do_and_only_there() {
        for kind in LatticeKind::ALL {
            let lattice = Lattice::new(kind, 0.3).unwrap();
            let shared = SharedVertices::new(&lattice);
            let mut names = HashMap::new();
            let mut positions = HashMap::new();
            for w in (0..64).map(|i| [i % 4 - 2, i / 4 % 4, i / 16 + 5]) {
                for (number, corner) in (0..).zip(&lattice.cell().vertices) {
                    let p = lattice.center(w) + corner;
                    let p = [p.x, p.y, p.z].map(|c| (c * 1e7).round() as i64 / 10);
                    let name = shared.name(w, number).unwrap();
                    assert_eq!(*names.entry(p).or_insert(name), name, "{kind}");
                    assert_eq!(*positions.entry(name).or_insert(p), p, "{kind}");
                }
            }
        }
    }

    #[test]
    fn a_corner_is_shared_by_as_many_cells_as_the_theory_says() {
        // Cubic, BCC, FCC, MCC and both hexagonal ones.
        for (kind, per_cell) in LatticeKind::ALL.into_iter().zip([1, 6, 3, 6, 2, 2]) {
            let lattice = Lattice::new(kind, 1.0).unwrap();
            let shared = SharedVertices::new(&lattice);
            // Corners that a cell owns: all corners of space by the number of cells.
            let corners = 0..lattice.cell().vertices.len() as u16;
            let own = corners.filter(|&c| shared.name([7; 3], c) == Some(([7; 3], c)));
            assert_eq!(own.count(), per_cell, "{kind}");
            assert_eq!(shared.name([0; 3], u16::MAX), None);
        }
    }
}
