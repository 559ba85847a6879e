//! k nearest occupied cells.

use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::query::{Query, QueryError};
use lattice_core::voxels::{VoxelList, VoxelStore};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::worlds::{World, any_offset, any_world, cells, ground};

/// Distance and key of the k nearest by looking at all.
fn nearest_of_all(voxels: &VoxelList, p: &Vector3<f64>, k: usize) -> Vec<(f64, MortonKey)> {
    let local = p - voxels.datum_m();
    let distance = |(key, center): (MortonKey, Vector3<f64>)| ((center - local).norm(), key);
    let mut all: Vec<_> = cells(voxels).into_iter().map(distance).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    all.truncate(k);
    all
}

fn found(query: &Query<'_, VoxelList>, p: &Vector3<f64>, k: usize) -> Vec<(f64, MortonKey)> {
    let found = query.nearest(p, k).unwrap();
    found.iter().map(|n| (n.distance_m, n.key)).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn nearest_are_those_of_brute_force(
        world in any_world(120),
        at in prop_oneof![any_offset(3.0), any_offset(40.0), any_offset(1e7)],
        k in prop_oneof![0_usize..12, Just(usize::MAX)],
    ) {
        let voxels = world.voxels();
        let p = world.datum_m + at;
        let query = Query::new(&voxels);
        prop_assert_eq!(found(&query, &p, k), nearest_of_all(&voxels, &p, k));
        for neighbor in query.nearest(&p, k).unwrap() {
            prop_assert!(voxels.contains(neighbor.key));
            prop_assert_eq!(neighbor.center_m, VoxelStore::center_m(&voxels, neighbor.key));
        }
    }
}

/// Probing and the octree of a large store agree with brute force, whichever comes first.
#[test]
fn near_and_far_questions_of_a_large_store_are_exact() {
    for kind in LatticeKind::ALL {
        for datum in [Vector3::zeros(), Vector3::new(4.4e5, -5.5e6, 120.0)] {
            let voxels = ground(kind, datum);
            assert!(voxels.len() > 6000, "{}", voxels.len());
            let points: Vec<_> = (0..60)
                .map(|i| {
                    let t = f64::from(i);
                    let spread = if i % 10 == 9 { 400.0 } else { 14.0 };
                    let z = 3.0 * (0.77 * t).cos();
                    datum + Vector3::new((1.3 * t).sin() * spread, (2.1 * t).cos() * spread, z)
                })
                .collect();
            // The first query probes until a far point comes, the second has sorted before.
            let (fresh, warm) = (Query::new(&voxels), Query::new(&voxels));
            warm.nearest(&(datum + Vector3::x() * 1e5), 1).unwrap();
            for p in &points {
                let expected = nearest_of_all(&voxels, p, 5);
                assert_eq!(found(&fresh, p, 5), expected, "{kind} {p}");
                assert_eq!(found(&warm, p, 5), expected, "{kind} {p}");
            }
        }
    }
}

#[test]
fn equal_distances_go_to_the_lower_key() {
    let offsets =
        (0..27).map(|i| Vector3::from([i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1].map(f64::from)));
    let voxels = World {
        kind: LatticeKind::Cubic,
        cell_volume_m3: 1.0,
        datum_m: Vector3::zeros(),
        offsets_m: offsets.filter(|o| *o != Vector3::zeros()).collect(),
    }
    .voxels();
    let neighbors = Query::new(&voxels).nearest(&Vector3::zeros(), 4).unwrap();
    assert!(neighbors.iter().all(|n| n.distance_m == 1.0));
    assert!(neighbors.is_sorted_by_key(|n| n.key));
    let lowest = [[-1, 0, 0], [0, -1, 0], [0, 0, -1]].map(|w| MortonKey::pack(w).unwrap());
    assert!(neighbors.iter().filter(|n| lowest.contains(&n.key)).count() == 3);
}

#[test]
fn senseless_questions_are_refused() {
    let lattice = Lattice::new(LatticeKind::Bcc, 0.125).unwrap();
    let mut voxels = VoxelList::new(lattice, Vector3::zeros(), 10).unwrap();
    for filled in [false, true] {
        if filled {
            let points = [Vector3::zeros()];
            voxels.insert(&lattice_core::cloud::Cloud::from_points(
                0, points[0], &points,
            ));
        }
        let query = Query::new(&voxels);
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e13] {
            let error = query.nearest(&Vector3::new(0.0, bad, 0.0), 1).unwrap_err();
            assert!(matches!(error, QueryError::Point(_)));
            assert_eq!(query.occupied(&Vector3::new(bad, 0.0, 0.0)), None);
        }
        let far = Vector3::new(1e12, -1e12, 1e12);
        let found = query.nearest(&far, 3).unwrap();
        assert_eq!(found.len(), usize::from(filled));
        assert_eq!(query.nearest(&far, 0).unwrap(), []);
        assert_eq!(query.occupied(&Vector3::zeros()).is_some(), filled);
    }
}
