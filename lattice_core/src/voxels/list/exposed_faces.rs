//! Faces of occupied cells visible from outside.

use rayon::prelude::*;

use super::VoxelList;
use crate::lattice::MortonKey;

impl VoxelList {
    /// Faces of a cell without an occupied cell behind them, as indices of `VoronoiCell::faces`.
    ///
    /// The cell itself need not be occupied. Cells out of the range of keys are unoccupied.
    fn exposed_faces_of(&self, key: MortonKey) -> impl Iterator<Item = usize> + '_ {
        let [x, y, z] = key.unpack();
        let faces = self.lattice.face_neighbors().iter().enumerate();
        faces.filter_map(move |(face, [dx, dy, dz])| {
            // 21-bit indices and small differences: no overflow.
            let behind = MortonKey::pack([x + dx, y + dy, z + dz]);
            let covered = behind.is_some_and(|key| self.contains(key));
            (!covered).then_some(face)
        })
    }

    /// All exposed faces of occupied cells, in Morton order of the cells and then by face.
    ///
    /// The number is the index of the face in `VoronoiCell::faces`.
    pub fn exposed_faces(&self) -> Vec<(MortonKey, usize)> {
        self.sorted()
            .into_par_iter()
            .flat_map_iter(|(key, _)| self.exposed_faces_of(key).map(move |face| (key, face)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::cloud::Cloud;
    use crate::lattice::{Lattice, LatticeIndex, LatticeKind};

    fn list(kind: LatticeKind, cells: &[LatticeIndex]) -> VoxelList {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        let centers: Vec<_> = cells.iter().map(|&w| lattice.center(w)).collect();
        let mut list = VoxelList::new(lattice, Vector3::zeros(), 1 << 20).unwrap();
        list.insert(&Cloud::from_points(0, Vector3::zeros(), &centers));
        list
    }

    #[test]
    fn a_lone_cell_shows_all_faces_and_a_pair_all_but_two() {
        for kind in LatticeKind::ALL {
            let lattice = Lattice::new(kind, 1.0).unwrap();
            let faces = lattice.face_neighbors();
            let alone: Vec<_> = list(kind, &[[3, -1, 2]]).exposed_faces();
            let key = MortonKey::pack([3, -1, 2]).unwrap();
            let expected: Vec<_> = (0..faces.len()).map(|face| (key, face)).collect();
            assert_eq!(alone, expected, "{kind}");
            for &other in faces {
                let pair = list(kind, &[[0, 0, 0], other]);
                let exposed = pair.exposed_faces();
                assert_eq!(exposed.len(), 2 * faces.len() - 2, "{kind}");
                assert!(exposed.is_sorted());
            }
        }
    }

    #[test]
    fn the_border_of_the_key_range_is_exposed() {
        let corner = MortonKey::pack([(1 << 20) - 1; 3]).unwrap();
        let list = list(LatticeKind::Cubic, &[]);
        assert_eq!(list.exposed_faces_of(corner).count(), 6);
    }

    proptest! {
        /// Without gaps every edge of the surface is walked as often in one direction as in the other.
        #[test]
        fn the_surface_is_closed(
            kind in prop::sample::select(&LatticeKind::ALL[..]),
            cells in prop::collection::vec([-2..3_i32, -2..3_i32, -2..3_i32], 1..60),
        ) {
            let list = list(kind, &cells);
            let cell = list.lattice().cell();
            let round = |v: Vector3<f64>| [v.x, v.y, v.z].map(|c| (c * 1e6).round() as i64);
            let mut edges: BTreeMap<_, i32> = BTreeMap::new();
            for (key, face) in list.exposed_faces() {
                let corners: Vec<_> = cell
                    .polygon(&cell.faces[face])
                    .map(|v| round(list.center_m(key) + v))
                    .collect();
                for (i, &from) in corners.iter().enumerate() {
                    let to = corners[(i + 1) % corners.len()];
                    *edges.entry((from.min(to), from.max(to))).or_default() +=
                        if from < to { 1 } else { -1 };
                }
            }
            prop_assert!(edges.values().all(|&turns| turns == 0));
        }
    }
}
