//! The cells along a ray.

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeIndex, MortonKey};
use lattice_core::raycast::{FreeSpaceMap, FreeSpaceOptions, RayBundle};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::{any_kind, near_cells};

/// A ray frees all cells that it enters and none that it does not touch, each at one step.
fn check(lattice: &Lattice, from: &Vector3<f64>, end: LatticeIndex) -> Result<(), TestCaseError> {
    let options = FreeSpaceOptions::default();
    let mut map = FreeSpaceMap::new(lattice.clone(), Vector3::zeros(), options).unwrap();
    let to = lattice.center(end);
    let ends = &Cloud::from_points(0, to, &[to]);
    let origin_m = *from;
    let report = map.insert_scan(&[RayBundle { origin_m, ends }]);
    prop_assert_eq!(map.occupied_keys(), [MortonKey::pack(end).unwrap()]);
    let free: Vec<LatticeIndex> = map.free_keys().iter().map(|key| key.unpack()).collect();
    prop_assert_eq!(report.visits, free.len() as u64, "a cell comes twice");
    let near = near_cells(lattice, from, &to);
    for w in &free {
        prop_assert!(near.contains_key(w), "{w:?} is not on the ray");
    }
    for (w, _) in near.iter().filter(|(w, deep)| **deep && **w != end) {
        prop_assert!(free.contains(w), "{w:?} is missing");
    }
    Ok(())
}

fn any_lattice() -> impl Strategy<Value = Lattice> {
    let volume = prop::sample::select(vec![1.0, 0.001, 0.125, 27.0, 1e-9]);
    (any_kind(), volume).prop_map(|(kind, volume)| Lattice::new(kind, volume).unwrap())
}

/// Points in cell sides: anywhere, or where cells meet.
fn any_point(reach: i32) -> impl Strategy<Value = Vector3<f64>> {
    let coordinate = prop_oneof![
        2 => -f64::from(reach)..f64::from(reach),
        1 => (-2 * reach..2 * reach).prop_map(|i| 0.5 * f64::from(i)),
    ];
    prop::array::uniform3(coordinate).prop_map(Vector3::from)
}

/// A point of the lattice's own: indices in halves or thirds, so that rays hit vertices and edges.
fn special(lattice: &Lattice, u: [i32; 3], parts: i32) -> Vector3<f64> {
    lattice.generator() * Vector3::from(u.map(|i| f64::from(i) / f64::from(parts)))
}

fn add(a: LatticeIndex, b: LatticeIndex) -> LatticeIndex {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn short_rays_pass_the_cells_that_clipping_finds(
        lattice in any_lattice(),
        from in any_point(5),
        end in prop::array::uniform3(-5..6_i32),
    ) {
        check(&lattice, &(from * lattice.cell_side_m()), end)?;
    }

    #[test]
    fn rays_through_vertices_edges_and_faces_are_followed(
        lattice in any_lattice(),
        from in prop::array::uniform3(-12..13_i32),
        end in prop::array::uniform3(-12..13_i32),
        parts in prop::sample::select(vec![1, 2, 3, 4, 6]),
    ) {
        check(&lattice, &special(&lattice, from, parts), end)?;
    }

    /// Along a face, an edge or a diagonal, almost or exactly.
    #[test]
    fn nearly_parallel_rays_are_followed(
        lattice in any_lattice(),
        end in prop::array::uniform3(-4..5_i32),
        step in prop::array::uniform3(-2..3_i32),
        halves in prop::array::uniform3(0..2_i32),
        off in prop::array::uniform3(prop::sample::select(
            vec![0.0, 1e-17, -1e-17, 1e-15, -1e-14, 1e-12, -1e-8]
        )),
    ) {
        let start = add(add(end, end), add(step.map(|i| 14 * i), halves));
        let off = Vector3::from(off) * lattice.cell_side_m();
        check(&lattice, &(special(&lattice, start, 2) + off), end)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn long_rays_far_from_the_datum_are_followed(
        lattice in any_lattice(),
        from in any_point(300),
        end in prop::array::uniform3(-300..300_i32),
        far in prop::array::uniform3(-100_000..100_000_i32),
    ) {
        let from = from * lattice.cell_side_m() + lattice.center(far);
        check(&lattice, &from, add(end, far))?;
    }
}
