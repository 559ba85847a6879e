//! Operations on stores of voxels against sets and maps of the standard library.

use std::collections::{BTreeMap, BTreeSet};

use lattice_core::cloud::Cloud;
use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::file::MapContents;
use lattice_core::voxels::{
    ColorSum, LabelCount, OccupancyList, Payload, PointColumns, Region, Stamps, Voxel, VoxelList,
    VoxelStore, WhenFull,
};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use proptest::prelude::*;

type Offsets = Vec<[f32; 3]>;

const DATUM_M: [f64; 3] = [9.0, 20.0, 31.0];
const ALL_COLUMNS: Payload = Payload {
    stamps: true,
    labels: true,
    color: true,
};

/// All named lattices, one turned, one of a basis of its own.
fn any_lattice() -> impl Strategy<Value = Lattice> {
    (0..LatticeKind::ALL.len() + 2).prop_map(|number| match LatticeKind::ALL.get(number) {
        Some(&kind) => Lattice::new(kind, 0.125).unwrap(),
        None if number == LatticeKind::ALL.len() => Lattice::new(LatticeKind::Fcc, 0.125)
            .unwrap()
            .oriented(UnitQuaternion::from_euler_angles(0.3, -0.2, 1.1)),
        None => {
            Lattice::from_basis(Matrix3::new(0.5, 0.1, 0.0, 0.0, 0.6, 0.2, 0.1, 0.0, 0.45)).unwrap()
        }
    })
}

/// Points in some dozens of cells of several blocks.
fn any_offsets() -> impl Strategy<Value = Offsets> {
    let coordinate = prop_oneof![3 => -2.0..2.0_f32, 1 => -9.0..9.0_f32];
    prop::collection::vec(prop::array::uniform3(coordinate), 0..120)
}

fn cloud(stamp_ns: i64, offsets_m: &[[f32; 3]]) -> Cloud {
    Cloud {
        stamp_ns,
        datum_m: Vector3::new(10.0, 20.0, 30.0),
        offsets_m: offsets_m.to_vec(),
    }
}

fn empty(lattice: &Lattice, max_voxels: usize) -> VoxelList {
    VoxelList::new(lattice.clone(), DATUM_M.into(), max_voxels).unwrap()
}

fn filled(lattice: &Lattice, offsets: &[[f32; 3]]) -> VoxelList {
    let mut list = empty(lattice, usize::MAX);
    list.insert(&cloud(0, offsets));
    list
}

/// With all columns; the points of three stamps and labels.
fn rich(lattice: &Lattice, offsets: &[[f32; 3]]) -> VoxelList {
    let mut list = empty(lattice, usize::MAX).with_payload(ALL_COLUMNS);
    for (stamp_ns, part) in offsets.chunks(offsets.len().div_ceil(3).max(1)).enumerate() {
        let labels: Vec<u16> = (0..part.len() as u16).map(|i| i % 3).collect();
        let colors: Vec<_> = (0..part.len() as u8)
            .map(|i| (i % 4 > 0).then_some([i, 255 - i, 9]))
            .collect();
        let columns = PointColumns {
            stamp_ns: stamp_ns as i64,
            labels: &labels,
            colors: &colors,
            ..PointColumns::default()
        };
        let part = cloud(stamp_ns as i64, part);
        list.insert_points(part.datum_m, &part.offsets_m, columns);
    }
    list
}

fn occupancy(lattice: &Lattice, offsets: &[[f32; 3]]) -> OccupancyList {
    let mut list = OccupancyList::new(lattice.clone(), DATUM_M.into(), 1 << 20).unwrap();
    list.insert(&cloud(0, offsets));
    list
}

fn keys(store: &dyn VoxelStore) -> BTreeSet<MortonKey> {
    store.sorted_keys().into_iter().collect()
}

type Row = (Voxel, Option<Stamps>, Vec<LabelCount>, Option<ColorSum>);

/// All that is kept of each voxel.
fn rows(list: &VoxelList) -> BTreeMap<MortonKey, Row> {
    let row = |(key, voxel)| {
        let (stamps, labels) = (list.stamps(key), list.labels(key));
        (key, (voxel, stamps, labels, list.color(key)))
    };
    list.sorted().into_iter().map(row).collect()
}

/// Keys as a consumer of the changes knows them.
#[derive(Default)]
struct Follower(BTreeSet<MortonKey>);

impl Follower {
    fn follow(&mut self, list: &mut VoxelList) {
        let changes = list.take_changes();
        for key in &changes.removed {
            assert!(self.0.remove(key), "removed what was never there");
        }
        self.0.extend(changes.changed);
        assert_eq!(self.0, keys(list));
        list.validate().unwrap();
    }
}

fn merged(a: &MapContents, b: &MapContents) -> MapContents {
    let mut sum = a.clone();
    sum.merge(b.clone()).unwrap();
    sum
}

proptest! {
    #[test]
    fn merging_is_commutative_and_associative_with_all_columns(
        lattice in any_lattice(), a in any_offsets(), b in any_offsets(), c in any_offsets(),
    ) {
        let maps = [&a, &b, &c].map(|offsets| MapContents::from_list(&rich(&lattice, offsets)));
        let [x, y, z] = &maps;
        let left = merged(&merged(x, y), z);
        prop_assert_eq!(&left, &merged(x, &merged(z, y)));
        prop_assert_eq!(&left, &merged(z, &merged(y, x)));
        left.into_list(usize::MAX).validate().unwrap();
    }

    #[test]
    fn decay_is_that_of_a_map(
        lattice in any_lattice(), offsets in any_offsets(), stamp_ns in -1..4_i64,
    ) {
        let mut list = rich(&lattice, &offsets);
        let all = rows(&list);
        list.take_changes();
        let mut expected = all.clone();
        expected.retain(|_, (_, stamps, ..)| stamps.unwrap().last_ns >= stamp_ns);
        prop_assert_eq!(list.forget_before(stamp_ns).unwrap(), all.len() - expected.len());
        prop_assert_eq!(rows(&list), expected);
        Follower(all.keys().copied().collect()).follow(&mut list);
    }

    #[test]
    fn regions_are_those_of_the_centres(
        lattice in any_lattice(),
        offsets in any_offsets(),
        from in prop::array::uniform3(-6.0..4.0_f64),
        size in prop::array::uniform3(0.0..8.0_f64),
    ) {
        let from = Vector3::new(10.0, 20.0, 30.0) + Vector3::from(from);
        let region = Region::cuboid(from, from + Vector3::from(size)).unwrap();
        let mut list = filled(&lattice, &offsets);
        let mut set = occupancy(&lattice, &offsets);
        let mut follower = Follower::default();
        follower.follow(&mut list);
        let all = keys(&list);
        let inside: BTreeSet<MortonKey> = all.iter().copied().filter(|&key| {
            let center_m = VoxelList::center_m(&list, key);
            (0..3).all(|i| (from[i]..=from[i] + size[i]).contains(&center_m[i]))
        }).collect();
        for store in [&mut list as &mut dyn VoxelStore, &mut set] {
            prop_assert_eq!(BTreeSet::from_iter(store.keys_in(&region)), inside.clone());
            prop_assert_eq!(store.remove_region(&region), inside.len());
            prop_assert_eq!(keys(store), &all - &inside);
        }
        follower.follow(&mut list);
        prop_assert_eq!(list.validate().and(set.validate()), Ok(()));
    }

    #[test]
    fn the_oldest_voxels_make_room(
        lattice in any_lattice(),
        max_voxels in 0..60_usize,
        clouds in prop::collection::vec(any_offsets(), 1..6),
    ) {
        let mut list = empty(&lattice, max_voxels).with_when_full(WhenFull::ForgetOldest);
        let mut follower = Follower::default();
        let mut model: BTreeMap<MortonKey, usize> = BTreeMap::new();
        let portion = max_voxels.div_ceil(8).max(1);
        for (state, offsets) in clouds.iter().enumerate() {
            let (mut new, mut forgotten) = (0, 0);
            for part in offsets.chunks(portion) {
                if model.len() + part.len() > max_voxels && max_voxels > 0 {
                    let mut by_age: Vec<_> = model.iter().map(|(k, s)| (*s, *k)).collect();
                    by_age.sort();
                    by_age.truncate(model.len().saturating_sub(max_voxels - portion));
                    forgotten += by_age.len() as u64;
                    by_age.iter().for_each(|(_, key)| assert!(model.remove(key).is_some()));
                }
                for p in cloud(0, part).points_m().filter(|_| max_voxels > 0) {
                    let key = list.key_of(&p).unwrap();
                    new += u64::from(model.insert(key, state).is_none());
                }
            }
            let report = list.insert(&cloud(0, offsets));
            prop_assert_eq!(report.list_full, if max_voxels == 0 { report.points } else { 0 });
            prop_assert_eq!((report.new_voxels, report.forgotten_voxels), (new, forgotten));
            prop_assert_eq!(keys(&list), model.keys().copied().collect::<BTreeSet<_>>());
            follower.follow(&mut list);
        }
    }
}

#[test]
fn the_label_of_a_cell_is_the_most_frequent_one() {
    let lattice = Lattice::new(LatticeKind::Fcc, 1.0).unwrap();
    let mut list = empty(&lattice, 10).with_payload(ALL_COLUMNS);
    list.insert_labelled(&cloud(0, &[[0.0, 0.1, 0.0]; 5]), &[9, 4, 9, 4, 70]);
    let (label, count) = (4, 2);
    let key = list.sorted()[0].0;
    assert_eq!(list.label(key), Some(LabelCount { label, count }));
}

#[test]
fn threads_do_not_change_what_is_forgotten() {
    let offsets: Offsets = (0..600_000_u32)
        .map(|i| {
            let j = i.wrapping_mul(2_654_435_761) >> 12;
            [
                (j & 255) as f32 * 0.3,
                (j >> 8 & 255) as f32 * 0.3,
                (i >> 16) as f32,
            ]
        })
        .collect();
    let lattice = Lattice::new(LatticeKind::Bcc, 0.03).unwrap();
    let outcome = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let mut list = empty(&lattice, 100_000).with_when_full(WhenFull::ForgetOldest);
            let reports = offsets
                .chunks(90_000)
                .map(|part| list.insert(&cloud(0, part)));
            let reports: Vec<_> = reports.collect();
            list.validate().unwrap();
            (reports, list.sorted())
        })
    };
    let one = outcome(1);
    let forgotten = one.0.iter().map(|report| report.forgotten_voxels);
    assert!(
        forgotten.clone().sum::<u64>() > 50_000,
        "{:?}",
        forgotten.collect::<Vec<_>>()
    );
    assert!(one.0.iter().all(|report| report.list_full == 0));
    assert!(one.1.len() > 80_000);
    assert_eq!(one, outcome(3));
}

#[test]
fn a_list_without_stamps_cannot_forget_by_them() {
    let lattice = Lattice::new(LatticeKind::HexOptimal, 0.125).unwrap();
    let mut list = filled(&lattice, &[[0.0; 3]]);
    let error = list.forget_before(0).unwrap_err().to_string();
    assert!(error.contains("stamps: true"), "{error}");
}

/// Up to a thousand changed voxels a step and ten thousand, which are listed and not.
#[test]
fn changes_of_a_large_list_are_what_differs() {
    let lattice = Lattice::new(LatticeKind::Fcc, 0.125).unwrap();
    let grid = |side: i16, shift: f32| -> Offsets {
        let places = (0..side * side).map(|i| [i / side, i % side].map(|i| 0.6 * f32::from(i)));
        places.map(|[x, y]| [x - 30.0, y - 30.0, shift]).collect()
    };
    let mut list = empty(&lattice, usize::MAX);
    let mut before = BTreeMap::new();
    for (step, (side, shift)) in [
        (100, 0.0),
        (3, 0.0),
        (30, 2.0),
        (100, 0.0),
        (0, 0.0),
        (1, 0.0),
    ]
    .into_iter()
    .enumerate()
    {
        list.insert(&cloud(0, &grid(side, shift)));
        let all = list.sorted_keys();
        let removed = all.iter().skip(step).step_by(7 * step.max(1));
        removed.for_each(|key| assert!(VoxelStore::remove(&mut list, *key)));
        list.validate().unwrap();
        let now = rows(&list);
        let changes = list.take_changes();
        let differs = |key: &&MortonKey| before.get(*key) != now.get(*key);
        let changed: Vec<_> = now.keys().filter(differs).copied().collect();
        let gone = before.keys().filter(|key| !now.contains_key(key));
        assert_eq!(changes.changed, changed, "step {step}");
        assert_eq!(changes.removed, gone.copied().collect::<Vec<_>>());
        let voxels = list.get_all(&all);
        let one_by_one = all.iter().map(|key| list.get(*key).unwrap_or_default());
        assert!(voxels.into_iter().eq(one_by_one));
        before = now;
    }
}
