//! The occupancy list against a set of keys.

use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;
use crate::lattice::LatticeKind;
use crate::voxels::{Payload, VoxelList};

const PLENTY: usize = 1 << 30;

fn lattice(kind: usize) -> Lattice {
    Lattice::new(LatticeKind::ALL[kind % LatticeKind::ALL.len()], 0.125).unwrap()
}

fn cloud(datum: [f64; 3], offsets_m: Vec<[f32; 3]>) -> Cloud {
    Cloud {
        stamp_ns: 0,
        datum_m: datum.into(),
        offsets_m,
    }
}

fn some_points(n: u32) -> Vec<[f32; 3]> {
    let at = |i: u32, m: u32| (i.wrapping_mul(2_654_435_761).wrapping_mul(m) >> 16) as f32 * 1e-3;
    (0..n)
        .map(|i| [at(i, 3), at(i, 7) * 0.2, at(i, 11) * 0.01])
        .collect()
}

fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(work)
}

#[test]
fn any_number_of_threads_gives_the_same_list() {
    for kind in 0..LatticeKind::ALL.len() {
        let points = cloud([1e5, -3.0, 7.0], some_points(100_000));
        let fill = |threads| {
            in_pool(threads, || {
                let near = Vector3::new(1e5, 0.0, 0.0);
                let mut list = OccupancyList::new(lattice(kind), near, PLENTY).unwrap();
                let report = list.insert(&points);
                list.validate().unwrap();
                (report, list.sorted_keys())
            })
        };
        let one = fill(1);
        assert_eq!(one, fill(2));
        assert_eq!(one, fill(5));
        assert_eq!(one.0.new_voxels, one.1.len() as u64);
    }
}

#[test]
fn a_full_list_refuses_new_blocks_and_counts_every_point() {
    let two_blocks = FIRST_BYTES + 2 * BLOCK_BYTES;
    let mut list = OccupancyList::new(lattice(0), Vector3::zeros(), two_blocks).unwrap();
    let report = list.insert(&cloud(
        [0.0; 3],
        vec![
            [0.0; 3], [10.0; 3], [20.0; 3], [20.0; 3], [0.5; 3], [20.0; 3], [10.0; 3],
        ],
    ));
    assert_eq!(
        (report.inserted, report.list_full, report.new_voxels),
        (4, 3, 3)
    );
    list.validate().unwrap();
    assert!(list.remove(MortonKey::pack([20; 3]).unwrap()));
    assert_eq!(list.insert(&cloud([0.0; 3], vec![[20.0; 3]])).inserted, 1);
    list.validate().unwrap();
}

#[test]
fn the_limit_in_bytes_is_kept() {
    // Each cell alone in its block: the most that a voxel takes.
    let lone: Vec<[f32; 3]> = (0..40_000)
        .map(|i| [(4 * (i % 200)) as f32, (4 * (i / 200)) as f32, 0.0])
        .collect();
    for max_bytes in [100_000, 300_000, 1_000_000, 3_000_000] {
        let mut list = OccupancyList::new(lattice(0), Vector3::zeros(), max_bytes).unwrap();
        let report = list.insert(&cloud([0.0; 3], lone.clone()));
        assert!(report.list_full > 0 && report.inserted > 0, "{max_bytes}");
        assert!(list.bytes() <= max_bytes, "{} > {max_bytes}", list.bytes());
        let max_voxels = VoxelList::voxels_within(max_bytes, Payload::default());
        let mut list = VoxelList::new(lattice(0), Vector3::zeros(), max_voxels).unwrap();
        list.insert(&cloud([0.0; 3], lone.clone()));
        list.take_changes();
        assert_eq!(list.len(), max_voxels.min(lone.len()));
        let keys: Vec<_> = list.sorted_keys();
        keys.iter()
            .step_by(2)
            .for_each(|key| assert!(list.remove(*key)));
        let bytes = VoxelStore::bytes(&list);
        assert!(
            max_voxels == 0 || bytes <= max_bytes,
            "{bytes} > {max_bytes}"
        );
    }
}

#[test]
fn points_without_a_cell_are_counted_by_reason() {
    let mut list = OccupancyList::new(lattice(2), Vector3::zeros(), PLENTY).unwrap();
    let points = vec![
        [f32::NAN; 3],
        [0.0; 3],
        [0.0, f32::INFINITY, 0.0],
        [1e9; 3],
        [0.1; 3],
    ];
    let report = list.insert(&cloud([0.0; 3], points.clone()));
    let reasons = (report.not_finite, report.out_of_range, report.inserted);
    assert_eq!(reasons, (2, 1, 2));
    let report = list.insert(&cloud([f64::NAN, 0.0, 0.0], points));
    assert_eq!((report.not_finite, report.inserted), (5, 0));
}

proptest! {
    #[test]
    fn it_is_a_set(kind in 0..5_usize, steps in prop::collection::vec((prop::array::uniform3(-2..2_i32), any::<bool>()), 1..200)) {
        let mut list = OccupancyList::new(lattice(kind), Vector3::zeros(), PLENTY).unwrap();
        let mut model = BTreeSet::new();
        for (w, insert) in steps {
            // Several blocks, some of them with one cell.
            let w = w.map(|i| 5 * i);
            let key = MortonKey::pack(w).unwrap();
            if insert {
                let center = list.center_m(key);
                let point = [center.x as f32, center.y as f32, center.z as f32];
                let report = list.insert(&cloud([0.0; 3], vec![point]));
                prop_assert_eq!(report.new_voxels == 1, model.insert(key));
            } else {
                prop_assert_eq!(list.remove(key), model.remove(&key));
            }
            prop_assert_eq!(list.validate(), Ok(()));
            prop_assert_eq!(list.contains(key), insert);
        }
        prop_assert_eq!(list.len(), model.len());
        prop_assert_eq!(list.sorted_keys(), model.iter().copied().collect::<Vec<_>>());
        let copy = OccupancyList::from_keys(lattice(kind), [0; 3], model.iter().copied(), PLENTY);
        prop_assert_eq!(copy.sorted_keys(), list.sorted_keys());
    }
}
