//! Clearing voxels along rays: what is passed through goes, what the scan sees stays.

use std::collections::BTreeSet;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::raycast::{
    ClearOptions, ClearReport, Evidence, FreeSpaceMap, FreeSpaceOptions, RayBundle, RayClearer,
    Reach,
};
use lattice_core::voxels::{OccupancyList, VoxelList, VoxelStore};
use nalgebra::Vector3;
use proptest::prelude::*;

use super::{any_kind, at, cloud, crossed, key_of, map, wall, with_level};

fn list(kind: LatticeKind, points: &[[f32; 3]]) -> VoxelList {
    let lattice = Lattice::new(kind, 0.027).unwrap();
    let mut list = VoxelList::new(lattice, at([0.3, 0.2, 0.1]), usize::MAX).unwrap();
    list.insert(&cloud(points.to_vec()));
    list
}

fn bundle(origin_m: Vector3<f64>, ends: &Cloud) -> RayBundle<'_> {
    RayBundle { origin_m, ends }
}

/// Clears what the rays of one scan cross, or with `spare_touching` what they pass through.
fn clear_rays(
    store: &mut VoxelList,
    origin_m: Vector3<f64>,
    ends: &Cloud,
    (keep_m, spare_touching): (f64, bool),
) -> ClearReport {
    let options = ClearOptions {
        misses: 1,
        reach: Reach {
            keep_m,
            ..Reach::default()
        },
        spare_touching,
        ..ClearOptions::default()
    };
    let mut clearer = RayClearer::new(&store.lattice().clone(), options);
    clearer.clear(store, &[bundle(origin_m, ends)])
}

fn any_points(n: usize) -> impl Strategy<Value = Vec<[f32; 3]>> {
    prop::collection::vec(prop::array::uniform3(-3.0..3.0_f32), 0..n)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// A scan in parts from different places is one scan: one hit or miss for each cell.
    #[test]
    fn bundles_of_one_scan_count_once(
        kind in any_kind(),
        offsets in prop::array::uniform2(prop::array::uniform3(-1.0..1.0_f64)),
        points in prop::collection::vec(prop::array::uniform3(-4.0..4.0_f32), 1..40),
    ) {
        let clouds = [cloud(points[..points.len() / 2].to_vec()), cloud(points)];
        let bundles = offsets.iter().zip(&clouds).map(|(offset, ends)| bundle(at(*offset), ends));
        let scan: Vec<RayBundle> = bundles.collect();
        let insert = |threshold: f64| {
            let evidence = Evidence { threshold, ..Evidence::default() };
            let mut map = map(kind, FreeSpaceOptions { evidence, ..FreeSpaceOptions::default() });
            (map.insert_scan(&scan), map)
        };
        let (report, even) = insert(0.5);
        prop_assert_eq!(report.hits, even.occupied_keys().len() as u64);
        prop_assert_eq!(report.misses, even.free_keys().len() as u64);
        prop_assert_eq!(report.rays, report.hits, "one ray for each cell");
        // Two misses would make a cell free at the first threshold, two hits occupied at the second.
        prop_assert_eq!(insert(0.38).1.free_keys(), []);
        prop_assert_eq!(insert(0.8).1.occupied_keys(), []);
    }

    #[test]
    fn what_is_removed_is_what_rays_cross_and_less_of_what_they_graze(
        kind in any_kind(),
        (stored, mut scan) in (any_points(800), any_points(40)),
    ) {
        let mut store = list(kind, &stored);
        let (lattice, datum_m) = (store.lattice().clone(), store.datum_m());
        let before: BTreeSet<MortonKey> = store.sorted_keys().into_iter().collect();
        // No ray from here to a lattice point meets an edge.
        let origin_m = at([0.1013, 0.0207, 0.1991]);
        let from = origin_m - datum_m;
        let ends: BTreeSet<MortonKey> = cloud(scan.clone())
            .points_m()
            .map(|p| store.key_of(&p).unwrap())
            .collect();
        let is_touched = |key: &MortonKey| {
            let w = key.unpack();
            let mut around = lattice.touching_neighbors().iter().chain(&[[0; 3]]);
            around.any(|n| {
                let key = MortonKey::pack([w[0] + n[0], w[1] + n[1], w[2] + n[2]]).unwrap();
                ends.contains(&key)
            })
        };
        let mut expected = BTreeSet::new();
        for end in &ends {
            let cells = crossed(&lattice, &from, &lattice.center(end.unpack()));
            expected.extend(cells.into_iter().map(|w| MortonKey::pack(w).unwrap()));
        }
        expected.retain(|key| before.contains(key) && !ends.contains(key));
        let report = clear_rays(&mut store, origin_m, &cloud(scan.clone()), (0.0, false));
        prop_assert_eq!(&report.removed, &expected.iter().copied().collect::<Vec<_>>());
        prop_assert_eq!(report.missed as usize, expected.len());
        let left: Vec<MortonKey> = before.difference(&expected).copied().collect();
        prop_assert_eq!(store.sorted_keys(), left);
        let [mut spared, mut again] = [0; 2].map(|_| list(kind, &stored));
        let report = clear_rays(&mut spared, origin_m, &cloud(scan.clone()), (0.0, true));
        let removed: BTreeSet<MortonKey> = report.removed.iter().copied().collect();
        prop_assert!(removed.is_subset(&expected) && !removed.iter().any(is_touched));
        prop_assert_eq!((report.missed + report.kept) as usize, expected.len());
        scan.reverse();
        prop_assert_eq!(report, clear_rays(&mut again, origin_m, &cloud(scan), (0.0, true)));
    }

    /// Evidence of one hit, which one miss outweighs, removes what clearing removes.
    #[test]
    fn evidence_counts_no_miss_of_what_clearing_spares(
        kind in any_kind(),
        spare_touching in any::<bool>(),
        (stored, scan) in (any_points(800), any_points(40)),
    ) {
        let [mut by_rays, mut by_evidence] = [0; 2].map(|_| list(kind, &stored));
        let options = FreeSpaceOptions {
            evidence: Evidence { miss: 0.25, ..Evidence::default() },
            spare_touching,
            free_level: None,
            ..FreeSpaceOptions::default()
        };
        let (lattice, datum_m) = (by_evidence.lattice().clone(), by_evidence.datum_m());
        let mut map = FreeSpaceMap::new(lattice, datum_m, options).unwrap();
        map.insert_occupied(&by_evidence.sorted_keys());
        let (origin_m, ends) = (at([0.1013, 0.0207, 0.1991]), cloud(scan));
        let cleared = clear_rays(&mut by_rays, origin_m, &ends, (0.0, spare_touching));
        let counted = map.clear(&mut by_evidence, &[bundle(origin_m, &ends)]);
        prop_assert_eq!(counted.removed, cleared.removed);
        prop_assert_eq!((counted.missed, counted.kept), (cleared.missed, cleared.kept));
        prop_assert_eq!(by_evidence.sorted_keys(), by_rays.sorted_keys());
    }
}

/// Flat ground seen from 1.5 m above, out to 15 m where rays graze it; a post on it is gone.
#[test]
fn ground_at_a_flat_angle_does_not_clear_itself() {
    for kind in LatticeKind::ALL {
        let ground: Vec<[f32; 3]> = (0..40_000)
            .map(|i| [(i % 200) as f32 * 0.075, (i / 200) as f32 * 0.05 - 5.0, 0.0])
            .collect();
        let post: Vec<[f32; 3]> = (8..30).map(|i| [5.0, 0.0, i as f32 * 0.05]).collect();
        let mut store = list(kind, &ground);
        let on_ground = store.sorted_keys();
        store.insert(&cloud(post.clone()));
        let posts = store.len() - on_ground.len();
        assert!(posts >= 3, "{kind}");
        // Two ways, three scans needed.
        let options = ClearOptions {
            misses: 3,
            ..ClearOptions::default()
        };
        let mut clearer = RayClearer::new(&store.lattice().clone(), options);
        for scan in 1..=3 {
            let (origin_m, ends) = (at([0.0, 0.0, 1.5]), &cloud(ground.clone()));
            let report = clearer.clear(&mut store, &[bundle(origin_m, ends)]);
            assert!(report.missed > 0, "{kind}");
            assert_eq!(report.removed.is_empty(), scan < 3, "{kind}");
        }
        assert!(on_ground.iter().all(|key| store.contains(*key)), "{kind}");
        // All of the post that is not next to the ground and that rays to the ground cross.
        assert!(store.len() < on_ground.len() + posts, "{kind}");
    }
}

#[test]
fn a_hit_between_starts_the_count_of_misses_anew() {
    let near = vec![[2.0, 0.0, 0.0]];
    let far = cloud(vec![[6.0, 0.0, 0.0]]);
    let mut store = list(LatticeKind::Fcc, &near);
    // The ray goes to a lattice point, so that the voxel has to be where it passes.
    let key = store.sorted_keys()[0];
    let through = store.center_m(key) - at([0.0; 3]);
    let origin = at([0.0; 3]) - through.normalize() * 1.0;
    let ahead = Cloud {
        datum_m: store.center_m(key) + through.normalize() * 4.0,
        ..cloud(vec![[0.0; 3]])
    };
    let options = ClearOptions {
        misses: 2,
        spare_touching: false,
        ..ClearOptions::default()
    };
    let mut clearer = RayClearer::new(&store.lattice().clone(), options);
    let mut clear = |scan: &Cloud| clearer.clear(&mut store, &[bundle(origin, scan)]);
    assert_eq!((clear(&ahead).missed, clear(&cloud(near)).missed), (1, 0));
    assert!(clear(&ahead).removed.is_empty());
    assert_eq!(clear(&ahead).removed, [key]);
    assert!(store.is_empty());
    let mut other = list(LatticeKind::Bcc, &[[2.0, 0.0, 0.0]]);
    let report = clearer.clear(&mut other, &[bundle(origin, &far)]);
    assert_eq!((report.removed.len(), other.len()), (0, 1));
}

#[test]
fn the_last_part_of_a_ray_clears_nothing() {
    for (keep_m, removed) in [(0.0, 1), (1.5, 1), (2.5, 0), (1e9, 0)] {
        let mut store = list(LatticeKind::Cubic, &[[4.0, 0.0, 0.0]]);
        let center = store.center_m(store.sorted_keys()[0]);
        let scan = Cloud {
            datum_m: center + Vector3::x() * 2.1,
            ..cloud(vec![[0.0; 3]])
        };
        let origin = center - Vector3::x() * 4.0;
        let report = clear_rays(&mut store, origin, &scan, (keep_m, false));
        assert_eq!(report.removed.len(), removed, "{keep_m}");
    }
}

/// A store holds what the evidence says is occupied, whatever free cells the map keeps.
#[test]
fn a_store_is_cleared_to_what_the_evidence_says() {
    for free_level in [None, Some(0), Some(2)] {
        let mut map = map(LatticeKind::Fcc, with_level(free_level));
        let lattice = map.lattice().clone();
        let mut store = OccupancyList::new(lattice, map.datum_m(), usize::MAX).unwrap();
        let mut see = |x: f32| {
            let ends = wall(x, 20);
            store.insert(&ends);
            let report = map.clear(&mut store, &[bundle(at([0.0; 3]), &ends)]);
            store.validate().unwrap();
            assert_eq!(
                store.sorted_keys(),
                map.occupied_keys(),
                "{free_level:?} {x} m"
            );
            report.removed.len()
        };
        assert_eq!([see(4.0), see(4.0), see(9.0), see(9.0), see(9.0)], [0; 5]);
        let gone: usize = (0..5).map(|_| see(9.0)).sum();
        assert!(gone > 50, "{free_level:?}: {gone}");
        assert!(see(4.0) > 50, "one hit is not enough after many misses");
    }
}

/// A loaded map has no scans: its cells count as hit once, so that rays can clear them.
#[test]
fn cells_that_were_loaded_can_be_cleared() {
    let mut map = map(LatticeKind::Bcc, with_level(None));
    let key = key_of(&map, &at([2.0, 0.1, 0.1])).unwrap();
    map.insert_occupied(&[key]);
    assert_eq!(map.occupied_keys(), [key]);
    map.reset();
    assert!(map.occupied_keys().is_empty() && map.free_keys().is_empty());
}
