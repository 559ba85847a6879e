//! Stencils of cells that may hold a point nearer than a distance to some point of the own cell.

use lattice_core::lattice::{Lattice, LatticeIndex};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Distances within this share of the cell side are equal.
const SLACK: f64 = 1e-9;

/// Most cells that a ball about the stencil may have room for.
const MAX_STENCIL_CELLS: usize = 1 << 20;

/// Index differences to all cells with a point nearer than `radius_m` to some point of the own
/// cell, without 0; in the order of the indices.
///
/// `None` if the radius is NaN or there could be more than a million cells.
pub fn clearance_stencil(lattice: &Lattice, radius_m: f64) -> Option<Vec<LatticeIndex>> {
    let near = cells_within(lattice, radius_m)?;
    Some(near.into_keys().filter(|w| *w != [0; 3]).collect())
}

/// The largest radius for which the touching neighbours are enough: no point outside of them and
/// the own cell is nearer than this to a point of the own cell. Metres.
pub fn touching_clearance_m(lattice: &Lattice) -> f64 {
    // Beyond the nearest neighbour is one that does not touch, at most this far away.
    let reach_m = 2.0 * lattice.packing_radius_m();
    let slack_m = SLACK * lattice.cell_side_m();
    let near = cells_within(lattice, reach_m).into_iter().flatten();
    let apart = near
        .map(|(_, distance_m)| distance_m)
        .filter(|d| *d > slack_m);
    apart.fold(reach_m, f64::min)
}

/// The cells nearer than a distance to the cell 0, with their distances. They hang together by
/// faces, for they are the ones that meet a convex body.
fn cells_within(lattice: &Lattice, radius_m: f64) -> Option<BTreeMap<LatticeIndex, f64>> {
    let room_m = radius_m.max(0.0) + 3.0 * lattice.covering_radius_m();
    let cells = 4.2 * room_m * room_m * room_m / lattice.cell_volume_m3();
    if radius_m.is_nan() || cells > MAX_STENCIL_CELLS as f64 {
        return None;
    }
    let limit_m = radius_m - SLACK * lattice.cell_side_m();
    let mut found = BTreeMap::new();
    let mut open = Vec::new();
    if limit_m > 0.0 {
        found.insert([0; 3], 0.0);
        open.push([0; 3]);
    }
    while let Some(w) = open.pop() {
        for step in lattice.face_neighbors() {
            let w: LatticeIndex = [w[0] + step[0], w[1] + step[1], w[2] + step[2]];
            if found.contains_key(&w) {
                continue;
            }
            let distance_m = distance_between_cells_m(lattice, w);
            if distance_m < limit_m {
                found.insert(w, distance_m);
                open.push(w);
            }
        }
    }
    Some(found)
}

/// Smallest distance between a point of the cell 0 and one of the cell `w`, metres.
///
/// Cells are symmetric: it is the distance of the centre of `w` from the cell 0 twice as large.
pub fn distance_between_cells_m(lattice: &Lattice, w: LatticeIndex) -> f64 {
    let p = 0.5 * lattice.center(w);
    let faces = lattice.cell().faces.iter();
    let beyond = faces.filter(|face| {
        let normal = lattice.center(face.neighbor);
        normal.dot(&p) > 0.5 * normal.norm_squared()
    });
    let triangles = beyond.flat_map(|face| lattice.cell().triangles(face));
    let square = triangles
        .map(|t| square_from_triangle(&p, &t))
        .fold(f64::MAX, f64::min);
    if square == f64::MAX {
        0.0
    } else {
        2.0 * square.sqrt()
    }
}

/// Squared distance of a point from a triangle.
fn square_from_triangle(p: &Vector3<f64>, [a, b, c]: &[Vector3<f64>; 3]) -> f64 {
    let normal = (b - a).cross(&(c - a));
    let inside =
        |from: &Vector3<f64>, to: &Vector3<f64>| (to - from).cross(&(p - from)).dot(&normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        let height = normal.dot(&(p - a));
        return height * height / normal.norm_squared();
    }
    let edge = |from: &Vector3<f64>, to: &Vector3<f64>| {
        let along = to - from;
        let share = (along.dot(&(p - from)) / along.norm_squared()).clamp(0.0, 1.0);
        (p - from - along * share).norm_squared()
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lattice_core::lattice::LatticeKind;
    use nalgebra::Matrix3;

    #[test]
    fn stencils_have_as_many_cells_as_the_theory_says() {
        for (radius, counts) in [
            (0.25, [26, 14, 18, 18, 20]),
            (0.5, [26, 26, 18, 18, 20]),
            (0.648, [26, 26, 18, 26, 20]),
            (0.75, [26, 26, 42, 42, 38]),
            (1.0, [26, 50, 42, 50, 52]),
            (1.5, [116, 112, 86, 88, 94]),
        ] {
            let found = LatticeKind::PAPER.map(|kind| {
                let lattice = Lattice::new(kind, 8.0).unwrap();
                clearance_stencil(&lattice, 2.0 * radius).unwrap().len()
            });
            assert_eq!(found, counts, "{radius}");
        }
    }

    #[test]
    fn touching_neighbours_are_enough_up_to_the_known_distance() {
        for (kind, expected) in [
            (LatticeKind::Cubic, 1.0),
            (LatticeKind::Bcc, 0.445),
            (LatticeKind::Fcc, 0.648),
            (LatticeKind::Mcc, 0.246),
            (LatticeKind::Hex, 0.680),
        ] {
            let lattice = Lattice::new(kind, 8.0).unwrap();
            let found = touching_clearance_m(&lattice);
            assert!((found / 2.0 - expected).abs() < 5.1e-4, "{kind}: {found}");
            let mut stencil = clearance_stencil(&lattice, found).unwrap();
            let mut touching = lattice.touching_neighbors().to_vec();
            stencil.sort();
            touching.sort();
            assert_eq!(stencil, touching, "{kind}");
            assert!(clearance_stencil(&lattice, 1.001 * found).unwrap().len() > touching.len());
        }
    }

    #[test]
    fn a_skewed_basis_has_the_stencils_of_its_lattice() {
        let own = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        let change = Matrix3::new(1.0, 70.0, 0.0, 0.0, 1.0, 0.0, 0.0, -30.0, 1.0);
        let other = Lattice::from_basis(own.generator() * change).unwrap();
        assert!((touching_clearance_m(&own) - touching_clearance_m(&other)).abs() < 1e-6);
        assert_eq!(clearance_stencil(&other, 0.75).unwrap().len(), 42);
    }

    #[test]
    fn absurd_radii_have_no_stencil() {
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        for radius in [f64::NAN, f64::INFINITY, 1e9] {
            assert_eq!(clearance_stencil(&lattice, radius), None);
        }
        assert_eq!(clearance_stencil(&lattice, -1.0), Some(Vec::new()));
        assert_eq!(clearance_stencil(&lattice, 0.0), Some(Vec::new()));
    }
}
