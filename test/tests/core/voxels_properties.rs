//! The voxel list: the same bytes for any order, threads and grouping.

use std::collections::BTreeSet;

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::file::{MapContents, write_map};
use lattice_core::voxels::{InsertReport, VoxelList, VoxelStore};
use nalgebra::Vector3;
use proptest::prelude::*;

type Offsets = Vec<[f32; 3]>;

fn any_kind() -> impl Strategy<Value = LatticeKind> {
    prop::sample::select(&LatticeKind::ALL[..])
}

/// Points in a few cells, some not finite or too far.
fn any_offsets() -> impl Strategy<Value = Offsets> {
    let coordinate = prop_oneof![
        60 => -2.0..2.0_f32,
        20 => (-8..8_i32).prop_map(|i| i as f32 * 0.25),
        1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, f32::MIN, 1e7]),
    ];
    prop::collection::vec(prop::array::uniform3(coordinate), 0..150)
}

fn cloud(offsets_m: Offsets) -> Cloud {
    Cloud {
        stamp_ns: 0,
        datum_m: Vector3::new(10.0, 20.0, 30.0),
        offsets_m,
    }
}

fn empty(kind: LatticeKind, max_voxels: usize) -> VoxelList {
    let lattice = Lattice::new(kind, 0.125).unwrap();
    VoxelList::new(lattice, Vector3::new(9.0, 20.0, 31.0), max_voxels).unwrap()
}

fn filled(kind: LatticeKind, offsets: &[[f32; 3]]) -> VoxelList {
    let mut list = empty(kind, usize::MAX);
    list.insert(&cloud(offsets.to_vec()));
    list
}

fn bytes(list: &VoxelList) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_map(list, &mut bytes).unwrap();
    bytes
}

/// Some hundred thousand points on and off a grid, more than one wave of chunks.
fn large_cloud() -> Cloud {
    let mut state = 1_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 24) as f32
    };
    let point = |i: u32| match i % 1000 {
        0 => [f32::NAN, 0.0, 0.0],
        1 => [0.0, 1e7, 0.0],
        2..500 => [random() * 20.0, random() * 20.0, random()],
        _ => [
            (random() * 40.0).round() * 0.5,
            (random() * 40.0).round() * 0.25,
            0.25,
        ],
    };
    cloud((0..400_000).map(point).collect())
}

#[test]
fn the_number_of_threads_does_not_change_a_byte() {
    let points = large_cloud();
    for kind in LatticeKind::ALL {
        for max_voxels in [usize::MAX, 2000] {
            let outcome = |threads| {
                let pool = rayon::ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .build()
                    .unwrap();
                pool.install(|| {
                    let mut list = empty(kind, max_voxels);
                    let report = list.insert(&points);
                    list.validate().unwrap();
                    (report, bytes(&list), list.take_changes())
                })
            };
            let one = outcome(1);
            let InsertReport {
                points,
                inserted,
                not_finite,
                out_of_range,
                list_full,
                new_voxels,
                forgotten_voxels,
            } = one.0;
            assert_eq!(forgotten_voxels, 0);
            assert_eq!(points, inserted + not_finite + out_of_range + list_full);
            assert_eq!((not_finite, out_of_range), (400, 400));
            assert_eq!(list_full > 0, max_voxels == 2000);
            assert_eq!(new_voxels, one.2.changed.len() as u64);
            assert_eq!(one, outcome(2));
            assert_eq!(one, outcome(4));
        }
    }
}

#[test]
fn a_full_list_takes_the_cells_that_come_first() {
    let points = large_cloud();
    for kind in LatticeKind::ALL {
        let mut list = empty(kind, 500);
        list.insert(&points);
        let mut first = BTreeSet::new();
        for p in points.points_m() {
            let key = list
                .lattice()
                .quantize(&(p - list.datum_m()))
                .and_then(MortonKey::pack);
            if let (Some(key), true) = (key, first.len() < 500) {
                first.insert(key);
            }
        }
        let kept: BTreeSet<MortonKey> = list.sorted().into_iter().map(|(key, _)| key).collect();
        assert_eq!(kept, first, "{kind}");
    }
}

#[test]
fn statistics_are_those_of_the_points() {
    let points = large_cloud();
    for kind in LatticeKind::ALL {
        let mut list = empty(kind, usize::MAX);
        list.insert(&points);
        let (mut n, mut sum, mut squares, mut largest) = (0_u64, 0.0, 0.0, 0.0_f64);
        for p in points.points_m() {
            let Some(w) = list.lattice().quantize(&(p - list.datum_m())) else {
                continue;
            };
            let distance = (p - list.center_m(MortonKey::pack(w).unwrap())).norm();
            n += 1;
            sum += distance;
            squares += distance * distance;
            largest = largest.max(distance);
        }
        let d = list.distortion();
        assert_eq!(d.points, n);
        for (value, expected) in [
            (d.mean_distance_m, sum / n as f64),
            (d.rms_m, (squares / n as f64).sqrt()),
            (d.mse_per_dimension_m2, squares / n as f64 / 3.0),
            (d.max_distance_m, largest),
        ] {
            assert!(
                (value / expected - 1.0).abs() < 2e-6,
                "{kind}: {value} and {expected}"
            );
        }
    }
}

proptest! {
    #[test]
    fn the_order_and_grouping_of_points_do_not_change_a_byte(
        kind in any_kind(),
        (offsets, shuffled) in any_offsets().prop_flat_map(|o| (Just(o.clone()), Just(o).prop_shuffle())),
        cut in 0..150_usize,
    ) {
        let whole = filled(kind, &offsets);
        let (head, tail) = shuffled.split_at(cut.min(shuffled.len()));
        let mut parts = filled(kind, head);
        parts.insert(&cloud(tail.to_vec()));
        parts.validate().unwrap();
        prop_assert_eq!(bytes(&parts), bytes(&whole));
        let mut merged = MapContents::from_list(&filled(kind, tail));
        merged.merge(MapContents::from_list(&filled(kind, head))).unwrap();
        prop_assert_eq!(merged, MapContents::from_list(&whole));
    }

    #[test]
    fn a_follower_of_the_changes_has_the_keys_of_the_list(
        kind in any_kind(),
        max_voxels in 0..100_usize,
        steps in prop::collection::vec((any_offsets(), 0..4_u8), 1..8),
    ) {
        let mut list = empty(kind, max_voxels);
        let mut follower: BTreeSet<MortonKey> = BTreeSet::new();
        for (offsets, action) in steps {
            match action {
                0 => list.clear(),
                1 => list.sorted_keys().iter().step_by(3).for_each(|key| assert!(list.remove(*key))),
                _ => drop(list.insert(&cloud(offsets))),
            }
            list.validate().unwrap();
            if action % 2 == 1 {
                let changes = list.take_changes();
                prop_assert!(changes.changed.is_sorted() && changes.removed.is_sorted());
                for key in &changes.removed {
                    prop_assert!(follower.remove(key), "removed what was never there");
                }
                follower.extend(changes.changed);
                let keys: BTreeSet<MortonKey> = list.sorted().into_iter().map(|(key, _)| key).collect();
                prop_assert_eq!(&follower, &keys);
                list.validate().unwrap();
            }
        }
    }
}
