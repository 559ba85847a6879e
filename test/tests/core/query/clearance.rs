//! Clearance of points and lines.

use lattice_core::lattice::{LatticeKind, MortonKey};
use lattice_core::query::{Clearance, Query, QueryError, Segment};
use lattice_core::voxels::{VoxelList, VoxelStore};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::polyhedra::distance;
use super::worlds::{any_offset, any_world, cells, ground};

/// Distance to every occupied cell of a line in the frame of the datum.
fn distances(voxels: &VoxelList, line: [Vector3<f64>; 2]) -> Vec<(MortonKey, f64)> {
    let distance = |key: MortonKey| (key, distance(voxels.lattice(), key.unpack(), &line));
    voxels.sorted_keys().into_iter().map(distance).collect()
}

/// Checks that the answer is the least of all distances, belongs to its cell, and obeys the bound.
fn check(
    all: &[(MortonKey, f64)],
    found: Option<Clearance>,
    max_m: f64,
    tolerance_m: f64,
) -> Result<(), TestCaseError> {
    let least = all.iter().map(|(_, d)| *d).fold(f64::INFINITY, f64::min);
    match found {
        None => prop_assert!(
            all.is_empty() || least > max_m - tolerance_m,
            "{least} missed below {max_m}"
        ),
        Some(found) => {
            prop_assert!(
                (found.distance_m - least).abs() <= tolerance_m,
                "{found:?} {least}"
            );
            prop_assert!(found.distance_m <= max_m);
            let own = all.iter().find(|(key, _)| *key == found.key).unwrap().1;
            prop_assert!(
                (own - least).abs() <= tolerance_m,
                "{found:?} {own} {least}"
            );
        }
    }
    Ok(())
}

fn any_max() -> impl Strategy<Value = f64> {
    prop_oneof![Just(f64::INFINITY), Just(0.0), 0.0..3.0]
}

/// The cell of a point has distance 0 and its neighbours the distance of their polyhedra.
fn tolerance_m(offset: &Vector3<f64>) -> f64 {
    1e-9 + 1e-13 * offset.norm()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn points_and_lines_have_the_distance_of_brute_force(
        world in any_world(60),
        a in any_offset(4.0),
        b in prop_oneof![any_offset(4.0), any_offset(60.0)],
        max_m in any_max(),
    ) {
        let voxels = world.voxels();
        let query = Query::new(&voxels);
        let (p, q) = (world.datum_m + a, world.datum_m + b);
        let [a, b] = [p, q].map(|x| x - voxels.datum_m());
        let line = Segment { from_m: p, to_m: q };
        let found = query.clearance(&line, max_m).unwrap();
        let all = distances(&voxels, [a, b]);
        check(&all, found, max_m, tolerance_m(&b))?;
        prop_assert_eq!(query.is_free(&line, 0.3).unwrap(),
            query.clearance(&line, 0.3).unwrap().is_none());

        let found = query.clearance(&Segment::point(p), max_m).unwrap();
        let all = distances(&voxels, [a, a]);
        check(&all, found, max_m, tolerance_m(&a))?;
        let exact = query.clearance(&Segment::point(p), f64::INFINITY).unwrap();
        if let Some(key) = query.occupied(&p) {
            prop_assert_eq!(exact, Some(Clearance { distance_m: 0.0, key }));
        }
    }
}

/// Shells, octree and both after another give the same cell.
#[test]
fn large_stores_answer_the_same_before_and_after_sorting() {
    for kind in LatticeKind::ALL {
        let datum = Vector3::new(4.4e5, -5.5e6, 120.0);
        let voxels = ground(kind, datum);
        let (fresh, warm) = (Query::new(&voxels), Query::new(&voxels));
        warm.nearest(&(datum + Vector3::x() * 1e5), 1).unwrap();
        for i in 0..40 {
            let t = f64::from(i);
            let at = datum + Vector3::new(9.0 * t.sin(), 9.0 * (1.7 * t).cos(), 1.0 + t.cos());
            let line = Segment {
                from_m: at,
                to_m: at + Vector3::new(0.5, 0.0, 0.4),
            };
            assert_eq!(
                fresh.clearance(&line, 0.5).unwrap(),
                warm.clearance(&line, 0.5).unwrap()
            );
            // Least of all by brute force on the cells around.
            let ends = [line.from_m, line.to_m].map(|p| p - voxels.datum_m());
            let near = |(_, c): &(MortonKey, Vector3<f64>)| (c - ends[0]).norm() < 4.0;
            let around = cells(&voxels).into_iter().filter(near);
            let least = around
                .map(|(key, _)| distance(voxels.lattice(), key.unpack(), &ends))
                .fold(f64::INFINITY, f64::min);
            let found = fresh.clearance(&line, f64::INFINITY).unwrap().unwrap();
            assert!(
                (found.distance_m - least).abs() < 1e-9,
                "{kind} {found:?} {least}"
            );
        }
    }
}

#[test]
fn senseless_shapes_are_refused() {
    let voxels = ground(LatticeKind::Bcc, Vector3::zeros());
    let query = Query::new(&voxels);
    let from_m = Vector3::zeros();
    for bad in [f64::NAN, f64::INFINITY, -1e13] {
        let to_m = Vector3::new(bad, 0.0, 0.0);
        let error = query.clearance(&Segment::point(to_m), 1.0);
        assert!(matches!(error, Err(QueryError::Point(_))));
        let error = query.clearance(&Segment { from_m, to_m }, 1.0);
        assert!(matches!(error, Err(QueryError::Point(_))));
    }
    for bad in [f64::NAN, -1.0] {
        let error = query.is_free(&Segment::point(from_m), bad);
        assert!(matches!(error, Err(QueryError::Distance(_))));
    }
}
