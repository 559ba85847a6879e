//! The cells along a segment, against clipping it with the polyhedron of every cell near it.

use std::collections::BTreeMap;

use lattice_core::lattice::{Lattice, LatticeIndex, LatticeKind};
use lattice_core::raycast::{Traversal, TraversalError};
use nalgebra::Vector3;
use proptest::prelude::*;

/// Cells are distinguished to this part of a cell side.
const SLACK: f64 = 1e-9;

/// The part of the segment in the cell of `w` with all faces moved outwards by `grow_m`.
fn clip(
    lattice: &Lattice,
    w: LatticeIndex,
    from: &Vector3<f64>,
    to: &Vector3<f64>,
    grow_m: f64,
) -> Option<(f64, f64)> {
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    let (s, d) = (from - lattice.center(w), to - from);
    for &n in lattice.face_neighbors() {
        let n = lattice.center(n);
        let room = 0.5 * n.norm_squared() + grow_m * n.norm() - n.dot(&s);
        let along = n.dot(&d);
        if along > 0.0 {
            last = last.min(room / along);
        } else if along < 0.0 {
            first = first.max(room / along);
        } else if room < 0.0 {
            return None;
        }
    }
    (first <= last).then_some((first, last))
}

/// Every cell that the segment comes within `SLACK` of, found from the first by touching cells.
fn near_cells(
    lattice: &Lattice,
    from: &Vector3<f64>,
    to: &Vector3<f64>,
) -> BTreeMap<LatticeIndex, (f64, f64)> {
    let grow = SLACK * side(lattice);
    let mut found = BTreeMap::new();
    let mut open = vec![lattice.quantize(from).unwrap()];
    while let Some(w) = open.pop() {
        if found.contains_key(&w) {
            continue;
        }
        if let Some(range) = clip(lattice, w, from, to, grow) {
            found.insert(w, range);
            let around = lattice.touching_neighbors().iter();
            open.extend(around.map(|n| [w[0] + n[0], w[1] + n[1], w[2] + n[2]]));
        }
    }
    found
}

fn side(lattice: &Lattice) -> f64 {
    lattice.cell_volume_m3().cbrt()
}

fn check(lattice: &Lattice, from: &Vector3<f64>, to: &Vector3<f64>) -> Result<(), TestCaseError> {
    let cells = Traversal::new(lattice).cells(from, to).unwrap();
    prop_assert_eq!(cells.first().copied(), lattice.quantize(from));
    prop_assert_eq!(cells.last().copied(), lattice.quantize(to));
    for pair in cells.windows(2) {
        let step = [0, 1, 2].map(|i| pair[1][i] - pair[0][i]);
        prop_assert!(lattice.face_neighbors().contains(&step), "{step:?}");
    }
    let near = near_cells(lattice, from, to);
    let mut place = BTreeMap::new();
    for (i, w) in cells.iter().enumerate() {
        prop_assert!(near.contains_key(w), "{w:?} is not on the segment");
        prop_assert!(place.insert(*w, i).is_none(), "{w:?} comes twice");
    }
    // Cells that the segment enters deeper than the slack, in the order in which it enters them.
    let mut deep: Vec<(f64, LatticeIndex)> = near
        .keys()
        .filter_map(|w| {
            let (first, last) = clip(lattice, *w, from, to, -SLACK * side(lattice))?;
            Some((0.5 * (first + last), *w))
        })
        .collect();
    deep.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut last = None;
    for (_, w) in deep {
        let Some(&i) = place.get(&w) else {
            return Err(TestCaseError::fail(format!("{w:?} is missing")));
        };
        prop_assert!(last.is_none_or(|l| l < i), "{w:?} comes too early");
        last = Some(i);
    }
    Ok(())
}

fn any_lattice() -> impl Strategy<Value = Lattice> {
    let volume = prop::sample::select(vec![1.0, 0.001, 0.125, 27.0, 1e-9]);
    (prop::sample::select(&LatticeKind::ALL[..]), volume)
        .prop_map(|(kind, volume)| Lattice::new(kind, volume).unwrap())
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

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn short_segments_pass_the_cells_that_clipping_finds(
        lattice in any_lattice(),
        (a, b) in (any_point(5), any_point(5)),
    ) {
        check(&lattice, &(a * side(&lattice)), &(b * side(&lattice)))?;
    }

    #[test]
    fn segments_through_vertices_edges_and_faces_are_followed(
        lattice in any_lattice(),
        a in prop::array::uniform3(-12..13_i32),
        b in prop::array::uniform3(-12..13_i32),
        parts in prop::sample::select(vec![1, 2, 3, 4, 6]),
    ) {
        check(&lattice, &special(&lattice, a, parts), &special(&lattice, b, parts))?;
    }

    /// Along a face, an edge or a diagonal, almost or exactly.
    #[test]
    fn nearly_parallel_segments_are_followed(
        lattice in any_lattice(),
        a in prop::array::uniform3(-4..5_i32),
        step in prop::array::uniform3(-2..3_i32),
        off in prop::array::uniform3(prop::sample::select(
            vec![0.0, 1e-17, -1e-17, 1e-15, -1e-14, 1e-12, -1e-8]
        )),
    ) {
        let from = special(&lattice, a, 2);
        let to = from + special(&lattice, step, 1) * 7.0 + Vector3::from(off) * side(&lattice);
        check(&lattice, &from, &to)?;
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn long_segments_far_from_the_origin_are_followed(
        lattice in any_lattice(),
        (a, b) in (any_point(300), any_point(300)),
        far in prop::array::uniform3(-100_000..100_000_i32),
    ) {
        let far = Vector3::from(far.map(f64::from));
        check(&lattice, &((a + far) * side(&lattice)), &((b + far) * side(&lattice)))?;
    }
}

#[test]
fn a_point_is_in_one_cell() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        for p in [Vector3::zeros(), Vector3::new(0.5, 0.5, 0.5)] {
            let cells = Traversal::new(&lattice).cells(&p, &p).unwrap();
            assert_eq!(cells, [lattice.quantize(&p).unwrap()]);
        }
    }
}

#[test]
fn what_is_not_a_segment_in_range_is_refused() {
    for kind in LatticeKind::ALL {
        let lattice = Lattice::new(kind, 0.001).unwrap();
        let traversal = Traversal::new(&lattice);
        let good = Vector3::new(1.0, 2.0, 3.0);
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let bad = Vector3::new(1.0, x, 3.0);
            assert_eq!(traversal.cells(&bad, &good), Err(TraversalError::NotFinite));
            assert_eq!(traversal.cells(&good, &bad), Err(TraversalError::NotFinite));
        }
        for x in [1e300, 3e5, -3e5] {
            let error = traversal.cells(&good, &Vector3::new(1.0, 2.0, x));
            assert!(matches!(error, Err(TraversalError::OutOfRange(_))));
        }
    }
}

/// A random line crosses surface / 4 faces per unit volume (Cauchy and Crofton).
#[test]
fn crossings_per_length_are_those_of_the_theory() {
    for (kind, expected) in [
        (LatticeKind::Cubic, 1.5),
        (LatticeKind::Fcc, 1.336),
        (LatticeKind::Bcc, 1.329),
    ] {
        let lattice = Lattice::new(kind, 1.0).unwrap();
        let area: f64 = lattice
            .cell()
            .faces
            .iter()
            .flat_map(|face| lattice.cell().triangles(face))
            .map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).norm())
            .sum();
        assert!((0.25 * area - expected).abs() < 1e-3, "{kind}: {area}");
        let traversal = Traversal::new(&lattice);
        let (mut crossings, mut length) = (0, 0.0);
        let mut state = 1_u64;
        let mut random = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        while length < 1e6 {
            let from = Vector3::new(random(), random(), random()) * 10.0;
            let ray = Vector3::new(random(), random(), random());
            if ray.norm() > 0.5 || ray.norm() < 0.01 {
                continue;
            }
            let ray = ray.normalize() * 300.0;
            crossings += traversal.cells(&from, &(from + ray)).unwrap().len() - 1;
            length += 300.0;
        }
        let rate = crossings as f64 / length;
        assert!((rate / (0.25 * area) - 1.0).abs() < 3e-3, "{kind}: {rate}");
    }
}
