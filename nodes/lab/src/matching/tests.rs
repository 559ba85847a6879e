//! A synthetic room.

use super::*;
use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind};
use lattice_core::voxels::VoxelStore;
use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const PLENTY: usize = 1 << 28;

/// Points on the floor, the walls and two boxes of a room of 5 x 4 x 2.5 m.
fn room(points: usize, seed: u64) -> Vec<Vector3<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let boxes = [
        ([0.0, 0.0, 0.0], [5.0, 4.0, 2.5]),
        ([1.0, 0.5, 0.0], [1.8, 1.1, 0.9]),
        ([3.6, 2.2, 0.0], [4.1, 3.3, 1.6]),
    ];
    let mut point = || {
        let (low, high) = boxes[random.random_range(0..boxes.len())];
        let mut p: [f64; 3] = std::array::from_fn(|i| random.random_range(low[i]..high[i]));
        let axis = random.random_range(0..3);
        p[axis] = if random.random() {
            low[axis]
        } else {
            high[axis]
        };
        Vector3::from(p)
    };
    (0..points).map(|_| point()).collect()
}

fn list(
    kind: LatticeKind,
    side_m: f64,
    levels: usize,
    points: &[Vector3<f64>],
) -> MultiResolutionList {
    let lattice = Lattice::new(kind, side_m.powi(3)).unwrap();
    let mut list = MultiResolutionList::new(&lattice, Vector3::zeros(), levels, PLENTY).unwrap();
    list.insert(&Cloud::from_points(0, Vector3::zeros(), points));
    list
}

/// The points as seen from a pose.
fn seen_from(pose: &Isometry3<f64>, points: &[Vector3<f64>]) -> Cloud {
    let inverse = pose.inverse();
    let points: Vec<_> = points
        .iter()
        .map(|p| inverse * nalgebra::Point3::from(*p))
        .map(|p| p.coords)
        .collect();
    Cloud::from_points(0, Vector3::zeros(), &points)
}

fn viewpoint() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(2.4, 1.9, 1.1), Vector3::new(0.01, -0.02, 0.6))
}

/// Largest distance between a point of the room at one pose and at the other, metres.
fn apart_m(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    let corners = (0..8).map(|i| {
        Vector3::new(
            (i & 1) as f64 * 2.0,
            (i >> 1 & 1) as f64 * 2.0,
            (i >> 2) as f64,
        )
    });
    let move_m =
        |p: Vector3<f64>| (a * nalgebra::Point3::from(p) - b * nalgebra::Point3::from(p)).norm();
    corners.map(move_m).fold(0.0, f64::max)
}

#[test]
fn every_level_holds_the_cells_of_all_points() {
    let points = room(3000, 1);
    for kind in LatticeKind::ALL {
        let list = list(kind, 0.1, 3, &points);
        let sides = list.levels().iter().map(|l| l.lattice().cell_side_m());
        for (side, expected) in sides.zip([0.1, 0.2, 0.4]) {
            assert!((side - expected).abs() < 1e-12);
        }
        let cloud = Cloud::from_points(0, Vector3::zeros(), &points);
        for level in list.levels() {
            let identity = Isometry3::identity();
            assert_eq!(level.overlap(&identity, &cloud.offsets_m), points.len());
            let keys: std::collections::BTreeSet<_> =
                cloud.points_m().map(|p| level.key_of(&p)).collect();
            assert_eq!(keys.len(), level.len());
        }
    }
}

#[test]
fn a_known_pose_is_found_from_nearby() {
    let points = room(20_000, 2);
    let truth = viewpoint();
    let scan = seen_from(&truth, &room(20_000, 3));
    for kind in LatticeKind::ALL {
        let map = list(kind, 0.1, 3, &points);
        let start = Isometry3::new(Vector3::new(2.6, 1.75, 1.2), Vector3::new(0.03, 0.0, 0.65));
        let found = align(&map, &scan, &start).unwrap();
        let off_m = apart_m(&found.map_from_cloud, &truth);
        assert!(
            off_m < 0.075,
            "{kind}: {off_m} m from {} m",
            apart_m(&start, &truth)
        );
        assert!(found.points > 1000 && found.hits > found.points / 2);
        let hits = |pose| map.levels()[0].overlap(pose, &scan.offsets_m);
        assert!(hits(&found.map_from_cloud) > hits(&start));
        assert!(found.evaluations > 13 * 5);
    }
}

#[test]
fn a_search_needs_no_guess_of_place_and_heading() {
    let points = room(20_000, 4);
    let map = list(LatticeKind::Fcc, 0.1, 4, &points);
    let truth = viewpoint();
    let scan = seen_from(&truth, &points);
    let about = Isometry3::new(Vector3::new(1.9, 2.3, 1.0), Vector3::zeros());
    let spread = Spread {
        translation_m: [1.2, 1.2, 0.3],
        rotation_rad: [0.0, 0.0, std::f64::consts::PI],
    };
    let found = search(&map, &scan, &about, &spread).unwrap();
    assert_eq!(found.len(), search::KEEP);
    assert!(found.windows(2).all(|pair| pair[0].hits >= pair[1].hits));
    // Before it is refined.
    let off_m = apart_m(&found[0].map_from_cloud, &truth);
    assert!(off_m < 0.2, "{off_m} m");
    let best = align(&map, &scan, &found[0].map_from_cloud).unwrap();
    let off_m = apart_m(&best.map_from_cloud, &truth);
    assert!(off_m < 0.06, "{off_m} m");
}

#[test]
fn the_answer_is_the_same_on_any_number_of_threads() {
    let on = |threads: usize| {
        crate::pool(threads).unwrap().install(|| {
            let map = list(LatticeKind::Bcc, 0.1, 3, &room(20_000, 5));
            let scan = seen_from(&viewpoint(), &room(20_000, 6));
            let start = Isometry3::new(Vector3::new(2.5, 1.8, 1.2), Vector3::new(0.0, 0.0, 0.55));
            let spread = Spread {
                translation_m: [0.4; 3],
                rotation_rad: [0.0, 0.0, 0.2],
            };
            let aligned = align(&map, &scan, &start).unwrap();
            (aligned, search(&map, &scan, &start, &spread).unwrap())
        })
    };
    assert!(on(1) == on(3));
}

#[test]
fn a_datum_far_away_changes_nothing() {
    let (points, truth) = (room(10_000, 7), viewpoint());
    let map = list(LatticeKind::Fcc, 0.1, 3, &points);
    let scan = seen_from(&truth, &points);
    let moved = Cloud {
        datum_m: Vector3::new(5e5, -4e5, 30.0),
        ..scan.clone()
    };
    let start = Isometry3::new(Vector3::new(2.5, 1.8, 1.2), Vector3::new(0.0, 0.0, 0.55));
    let from_moved = start * nalgebra::Translation3::from(-moved.datum_m);
    let a = align(&map, &scan, &start).unwrap();
    let b = align(&map, &moved, &from_moved).unwrap();
    let b_pose = b.map_from_cloud * nalgebra::Translation3::from(moved.datum_m);
    assert!(apart_m(&a.map_from_cloud, &b_pose) < 1e-3);
}

#[test]
fn bad_input_is_refused() {
    let map = list(LatticeKind::Fcc, 0.1, 3, &room(1000, 8));
    let scan = seen_from(&viewpoint(), &room(1000, 8));
    let start = viewpoint();
    let lattice = Lattice::new(LatticeKind::Fcc, 1e-3).unwrap();
    for levels in [0, 13] {
        let made = MultiResolutionList::new(&lattice, Vector3::zeros(), levels, PLENTY);
        assert!(made.unwrap_err().to_string().contains("levels"));
    }
    let refused = |map: &MultiResolutionList, cloud: &Cloud, pose: &Isometry3<f64>| {
        let spread = Spread::default();
        let aligned = align(map, cloud, pose).unwrap_err().to_string();
        let found = search(map, cloud, pose, &spread);
        assert_eq!(found.unwrap_err().to_string(), aligned);
        aligned
    };
    let empty = MultiResolutionList::new(&lattice, Vector3::zeros(), 2, PLENTY).unwrap();
    assert_eq!(refused(&empty, &scan, &start), "the map is empty");
    for bad in [[f32::NAN; 3], [1e30; 3], [0.0, f32::INFINITY, 0.0]] {
        let cloud = Cloud {
            offsets_m: vec![bad; 7],
            ..scan.clone()
        };
        assert!(refused(&map, &cloud, &start).contains("none of 7 points"));
    }
    let pose = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert!(refused(&map, &scan, &pose).contains("not finite"));
    for wide in [1e4, f64::INFINITY, f64::NAN] {
        let spread = Spread {
            translation_m: [wide; 3],
            rotation_rad: [3.0; 3],
        };
        let found = search(&map, &scan, &start, &spread);
        assert!(found.is_err(), "{wide}");
    }
}

#[test]
fn a_full_list_refuses_points_and_says_so() {
    let lattice = Lattice::new(LatticeKind::Fcc, 1e-6).unwrap();
    let max_bytes = 1 << 19;
    let mut list = MultiResolutionList::new(&lattice, Vector3::zeros(), 3, max_bytes).unwrap();
    let reports = list.insert(&Cloud::from_points(0, Vector3::zeros(), &room(50_000, 9)));
    assert!(reports.len() == 3 && reports[0].list_full > 0);
    let bytes: usize = list.levels().iter().map(VoxelStore::bytes).sum();
    assert!(bytes <= max_bytes, "{bytes}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn no_pose_beats_the_true_one_of_a_copy(
        kind in 0..6_usize,
        shift in prop::array::uniform3(-0.6..0.6_f64),
        turn in prop::array::uniform3(-0.3..0.3_f64),
        level in 0..3_usize,
    ) {
        let points = room(2000, 10);
        let map = list(LatticeKind::ALL[kind], 0.1, 3, &points);
        let cloud = Cloud::from_points(0, Vector3::zeros(), &points);
        let there = map.levels()[level].overlap(&Isometry3::identity(), &cloud.offsets_m);
        prop_assert_eq!(there, points.len());
        let elsewhere = Isometry3::new(Vector3::from(shift), Vector3::from(turn));
        prop_assert!(map.levels()[level].overlap(&elsewhere, &cloud.offsets_m) <= there);
    }

    #[test]
    fn overlap_is_the_count_of_points_one_by_one(
        kind in 0..6_usize,
        shift in prop::array::uniform3(-3.0..3.0_f64),
        turn in prop::array::uniform3(-2.0..2.0_f64),
    ) {
        let map = list(LatticeKind::ALL[kind], 0.15, 1, &room(4000, 11));
        let level = &map.levels()[0];
        let mut points = Cloud::from_points(0, Vector3::zeros(), &room(700, 12)).offsets_m;
        points.extend([[f32::NAN; 3], [1e20; 3]]);
        let pose = Isometry3::new(Vector3::from(shift), Vector3::from(turn));
        let inside = |p: &&[f32; 3]| {
            let p = pose * nalgebra::Point3::from(p.map(f64::from));
            level.key_of(&p.coords).is_some_and(|key| level.contains(key))
        };
        let expected = points.iter().filter(inside).count();
        prop_assert_eq!(level.overlap(&pose, &points), expected);
    }

}
