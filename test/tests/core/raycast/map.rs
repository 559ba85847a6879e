//! Free space: the same as from the cells of each ray one by one, in any order of the points.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeIndex, LatticeKind, MortonKey};
use lattice_core::raycast::{
    Evidence, FreeSpaceMap, FreeSpaceOptions, MIN_MAP_BYTES, RayBundle, Reach, ScanReport,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::{any_kind, at, cloud, crossed, key_of, map, map_of, wall, with_level};

/// Origins and offsets from the datum, some in one cell, some that are no points.
fn any_scans() -> impl Strategy<Value = Vec<([f64; 3], Vec<[f32; 3]>)>> {
    let coordinate = prop_oneof![
        40 => -4.0..4.0_f32,
        20 => (-8..8_i32).prop_map(|i| i as f32 * 0.5),
        1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, 1e7]),
    ];
    let points = prop::collection::vec(prop::array::uniform3(coordinate), 0..40);
    let scan = (prop::array::uniform3(-1.0..1.0_f64), points);
    prop::collection::vec(scan, 1..5)
}

/// As printed, turned, and of a basis that has no name.
fn any_lattice() -> impl Strategy<Value = Lattice> {
    let skew = Matrix3::new(0.3, 0.1, 0.0, 0.0, 0.25, 0.1, 0.1, 0.0, 0.35);
    let mut lattices = vec![Lattice::from_basis(skew).unwrap()];
    lattices.extend(LatticeKind::ALL.map(|kind| Lattice::new(kind, 0.027).unwrap()));
    let turn = UnitQuaternion::from_euler_angles(0.5, -0.3, 1.1);
    let turned: Vec<_> = lattices.iter().map(|l| l.clone().oriented(turn)).collect();
    lattices.extend(turned);
    prop::sample::select(lattices)
}

fn to(max_range_m: f64) -> Reach {
    Reach {
        max_range_m,
        ..Reach::default()
    }
}

fn insert(map: &mut FreeSpaceMap, origin_m: Vector3<f64>, ends: &Cloud) -> ScanReport {
    map.insert_scan(&[RayBundle { origin_m, ends }])
}

/// The log-odds in 32nds by sets of cells.
#[derive(Default)]
struct Reference {
    cells: BTreeMap<LatticeIndex, i32>,
}

impl Reference {
    fn insert(&mut self, map: &FreeSpaceMap, origin_m: Vector3<f64>, scan: &Cloud) -> ScanReport {
        let from = origin_m - map.datum_m();
        let mut report = ScanReport {
            points: scan.len() as u64,
            ..ScanReport::default()
        };
        let mut ends = BTreeSet::new();
        for p in scan.points_m() {
            match key_of(map, &p) {
                Some(key) => drop(ends.insert(key.unpack())),
                None if p.iter().all(|x| x.is_finite()) => report.out_of_range += 1,
                None => report.not_finite += 1,
            }
        }
        let mut passed = BTreeSet::new();
        for end in &ends {
            let to = map.lattice().center(*end);
            let cells = crossed(map.lattice(), &from, &to);
            report.visits += cells.len() as u64 - 1;
            passed.extend(cells);
        }
        report.hits = ends.len() as u64;
        report.rays = report.hits;
        report.misses = passed.difference(&ends).count() as u64;
        for w in passed.union(&ends) {
            let value = self.cells.entry(*w).or_default();
            let step = if ends.contains(w) { 27 } else { -13 };
            *value = (*value + step).clamp(-64, 112);
        }
        report
    }
}

/// Occupied and free cells.
fn contents(map: &FreeSpaceMap) -> [Vec<MortonKey>; 2] {
    [map.occupied_keys(), map.free_keys()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn a_map_is_what_its_rays_say_one_by_one(
        kind in any_kind(),
        scans in any_scans(),
        steps in prop::sample::select(
            vec![-26, -25, -13, -12, 0, 1, 14, 15, 27, 28, 41, 42, 54, 55]
        ),
    ) {
        // A step from values that cells take.
        let threshold = 1.0 / (1.0 + (-f64::from(steps) / 32.0).exp());
        let evidence = Evidence { threshold, ..Evidence::default() };
        let mut map = map(kind, FreeSpaceOptions { evidence, ..FreeSpaceOptions::default() });
        let mut reference = Reference::default();
        for (offset, points) in scans {
            let (origin_m, scan) = (at(offset), cloud(points));
            let report = insert(&mut map, origin_m, &scan);
            prop_assert_eq!(report, reference.insert(&map, origin_m, &scan));
            let keys = |occupied: bool| {
                let cells = reference.cells.iter().filter(|(_, v)| (**v >= steps) == occupied);
                let keys: BTreeSet<_> = cells.map(|(w, _)| MortonKey::pack(*w).unwrap()).collect();
                keys.into_iter().collect::<Vec<_>>()
            };
            prop_assert_eq!(contents(&map), [true, false].map(keys));
        }
    }

    #[test]
    fn the_order_of_the_points_does_not_matter(
        kind in any_kind(),
        scans in any_scans(),
        free_level in prop::option::of(0..3_u32),
        max_range_m in prop::sample::select(vec![2.5, f64::INFINITY]),
    ) {
        let options = FreeSpaceOptions { reach: to(max_range_m), ..with_level(free_level) };
        let (mut one, mut other) = (map(kind, options), map(kind, options));
        for (offset, mut points) in scans {
            let first = insert(&mut one, at(offset), &cloud(points.clone()));
            points.reverse();
            let half = points.len() / 2;
            points.rotate_left(half);
            prop_assert_eq!(first, insert(&mut other, at(offset), &cloud(points)));
        }
        prop_assert_eq!(contents(&one), contents(&other));
        prop_assert!(one.bytes() <= options.max_bytes);
    }

    /// No point of an occupied cell is in a coarse cell that is called free, and every free coarse
    /// cell was passed through.
    #[test]
    fn coarse_free_cells_hold_nothing_occupied(
        lattice in any_lattice(),
        scans in any_scans(),
        free_level in 1..4_u32,
        inside in prop::array::uniform3(-0.5..0.5_f64),
    ) {
        let mut fine = map_of(lattice.clone(), FreeSpaceOptions::default());
        let mut coarse = map_of(lattice, with_level(Some(free_level)));
        for (offset, points) in scans {
            let (origin_m, scan) = (at(offset), cloud(points));
            let report = insert(&mut fine, origin_m, &scan);
            prop_assert_eq!(report, insert(&mut coarse, origin_m, &scan));
        }
        let lattice = coarse.free_lattice();
        let home = |p: Vector3<f64>| MortonKey::pack(lattice.quantize(&p).unwrap()).unwrap();
        // Fine lattice points may lie on the border of coarse cells.
        let homes = |p: Vector3<f64>| {
            let near = lattice.quantize(&p).unwrap();
            let around = lattice.touching_neighbors().iter().chain(&[[0; 3]]);
            let around = around.map(move |n| [near[0] + n[0], near[1] + n[1], near[2] + n[2]]);
            let least = (lattice.center(near) - p).norm() + 1e-9;
            let nearest = around.filter(move |w| (lattice.center(*w) - p).norm() < least);
            nearest.map(|w| MortonKey::pack(w).unwrap()).collect::<Vec<_>>()
        };
        let free: BTreeSet<MortonKey> = coarse.free_keys().into_iter().collect();
        let occupied = coarse.occupied_keys();
        for key in &occupied {
            let center = coarse.lattice().center(key.unpack());
            prop_assert!(homes(center).iter().all(|key| !free.contains(key)));
            for corner in &coarse.lattice().cell().vertices {
                prop_assert!(!free.contains(&home(center + corner * 0.999)));
            }
            let edge = Vector3::from(inside) * 0.3;
            if coarse.lattice().quantize(&(center + edge)) == Some(key.unpack()) {
                prop_assert!(!free.contains(&home(center + edge)));
            }
        }
        let passed: BTreeSet<MortonKey> = fine
            .free_keys()
            .into_iter()
            .chain(fine.occupied_keys())
            .flat_map(|key| homes(fine.lattice().center(key.unpack())))
            .collect();
        prop_assert!(free.is_subset(&passed));
    }
}

/// A wall seen from 4 m, then gone: it is freed, along the rays only.
#[test]
fn a_wall_that_goes_away_is_freed() {
    for kind in LatticeKind::ALL {
        for free_level in [0, 1, 2] {
            let mut map = map(kind, with_level(Some(free_level)));
            for _ in 0..3 {
                insert(&mut map, at([0.0; 3]), &wall(4.0, 30));
            }
            // Before, on and behind the wall.
            let places = [1.0, 4.0, 5.5].map(|x| at([x, 0.0, 0.0]));
            let state = |map: &FreeSpaceMap| {
                let coarse = |p| map.free_lattice().quantize(&(p - map.datum_m())).unwrap();
                let free = |p| {
                    map.free_keys()
                        .contains(&MortonKey::pack(coarse(p)).unwrap())
                };
                let occupied = |p| map.occupied_keys().contains(&key_of(map, &p).unwrap());
                places.map(|p| (occupied(p), free(p)))
            };
            let (occupied, free, unknown) = ((true, false), (false, true), (false, false));
            assert_eq!(
                state(&map),
                [free, occupied, unknown],
                "{kind} {free_level}"
            );
            for _ in 0..20 {
                insert(&mut map, at([0.0; 3]), &wall(9.0, 30));
            }
            assert_eq!(state(&map), [free; 3], "{kind} {free_level}");
        }
    }
}

#[test]
fn points_beyond_the_range_free_the_way_there_and_hit_nothing() {
    for kind in LatticeKind::ALL {
        let options = FreeSpaceOptions {
            reach: to(5.0),
            ..FreeSpaceOptions::default()
        };
        let mut map = map(kind, options);
        let report = insert(
            &mut map,
            at([0.0; 3]),
            &cloud(vec![[80.0, 0.0, 0.0], [3e38, 0.0, 0.0], [0.0, 2.0, 0.0]]),
        );
        assert_eq!(
            (report.beyond_max_range, report.hits, report.rays),
            (2, 1, 2)
        );
        let is_free = |x| {
            let key = key_of(&map, &at([x, 0.0, 0.0])).unwrap();
            map.free_keys().contains(&key)
        };
        assert_eq!(map.occupied_keys().len(), 1);
        assert!(is_free(4.3) && !is_free(5.7));
    }
}

#[test]
fn the_limit_of_memory_holds_and_what_it_refuses_is_counted() {
    let sphere = |n: u32| -> Vec<[f32; 3]> {
        (0..n)
            .map(|i| {
                let up = 2.0 * (i as f32 + 0.5) / n as f32 - 1.0;
                let (flat, a) = ((1.0 - up * up).sqrt(), 2.399_963 * i as f32);
                [30.0 * flat * a.cos(), 30.0 * flat * a.sin(), 30.0 * up]
            })
            .collect()
    };
    for free_level in [0, 2] {
        let options = FreeSpaceOptions {
            max_bytes: MIN_MAP_BYTES,
            ..with_level(Some(free_level))
        };
        let (mut one, mut other) = (
            map(LatticeKind::Fcc, options),
            map(LatticeKind::Fcc, options),
        );
        let mut points = sphere(3000);
        let first = insert(&mut one, at([0.0; 3]), &cloud(points.clone()));
        assert!(one.bytes() <= MIN_MAP_BYTES, "{}", one.bytes());
        assert!(first.entries_refused > 0, "{first:?}");
        points.reverse();
        let second = insert(&mut other, at([0.0; 3]), &cloud(points));
        assert_eq!(first, second);
        assert_eq!(contents(&one), contents(&other));
        assert!(!one.free_keys().is_empty());
        let mut refused = 0;
        for i in 0..20 {
            let from = at([f64::from(i), 0.0, 0.0]);
            refused += insert(&mut one, from, &cloud(sphere(500))).blocks_refused;
            assert!(one.bytes() <= MIN_MAP_BYTES, "{}", one.bytes());
        }
        assert!(refused > 0);
    }
}

#[test]
fn a_scan_from_nowhere_changes_nothing() {
    let scan = cloud(vec![[1.0, 2.0, 3.0]; 7]);
    for kind in LatticeKind::ALL {
        let mut map = map(kind, FreeSpaceOptions::default());
        for x in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, 1e6, -1e6] {
            let report = insert(&mut map, Vector3::new(0.0, x, 0.0), &scan);
            let not_finite = if x.is_finite() { 0 } else { 7 };
            assert_eq!((report.points, report.not_finite), (7, not_finite));
            assert_eq!(report.out_of_range, 7 - not_finite);
        }
        assert!(contents(&map).iter().all(Vec::is_empty));
    }
}

#[test]
fn options_that_cannot_be_are_refused() {
    let good = FreeSpaceOptions::default();
    let range = |range_m| FreeSpaceOptions {
        reach: to(range_m),
        ..good
    };
    let (hit, max_bytes) = (0.4, 1000);
    let evidence = Evidence {
        hit,
        ..good.evidence
    };
    for (bad, expected) in [
        (range(0.0), "max range 0 m"),
        (range(f64::NAN), "max range NaN m"),
        (with_level(Some(4)), "free level 4 "),
        (
            FreeSpaceOptions { max_bytes, ..good },
            "memory limit 1000 bytes",
        ),
        (FreeSpaceOptions { evidence, ..good }, "hit 0.4"),
    ] {
        let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
        let error = FreeSpaceMap::new(lattice, Vector3::zeros(), bad)
            .err()
            .unwrap();
        assert!(error.to_string().starts_with(expected), "{error}");
    }
    let far = Vector3::new(f64::NAN, 0.0, 0.0);
    let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
    assert!(FreeSpaceMap::new(lattice, far, good).is_err());
}
