//! Colours of voxels against sums of the standard library.

use std::collections::BTreeMap;

use lattice_core::lattice::{Lattice, LatticeKind, MortonKey};
use lattice_core::voxels::file::{MapContents, WriteOptions, read_map};
use lattice_core::voxels::{Payload, PointColumns, VoxelList, VoxelStore};
use nalgebra::Vector3;
use proptest::prelude::*;

type Point = ([f64; 3], Option<[u8; 3]>);

const COLOR: Payload = Payload {
    stamps: false,
    labels: false,
    color: true,
};

fn list_of(kind: LatticeKind, points: &[Point], threads: usize) -> VoxelList {
    let lattice = Lattice::new(kind, 0.125).unwrap();
    let list = VoxelList::new(lattice, Vector3::zeros(), usize::MAX).unwrap();
    let mut list = list.with_payload(COLOR);
    let (points_m, colors): (Vec<_>, Vec<_>) = points.iter().copied().unzip();
    let columns = PointColumns {
        colors: &colors,
        ..PointColumns::default()
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.unwrap()
        .install(|| list.insert_points(Vector3::zeros(), &points_m, columns));
    list.validate().unwrap();
    list
}

fn file_of(list: &VoxelList) -> Vec<u8> {
    bytes_of(&MapContents::from_list(list))
}

fn bytes_of(map: &MapContents) -> Vec<u8> {
    let mut bytes = Vec::new();
    map.write(&mut bytes, &WriteOptions::default()).unwrap();
    bytes
}

fn any_points() -> impl Strategy<Value = Vec<Point>> {
    let color = prop::option::weighted(0.8, any::<[u8; 3]>());
    prop::collection::vec((prop::array::uniform3(-1.0..1.0_f64), color), 0..200)
}

fn any_kind() -> impl Strategy<Value = LatticeKind> {
    prop::sample::select(LatticeKind::ALL.to_vec())
}

/// Sums of the colours of each cell, and their number.
fn expected(list: &VoxelList, points: &[Point]) -> BTreeMap<MortonKey, (u32, [u64; 3])> {
    let mut sums = BTreeMap::<_, (u32, [u64; 3])>::new();
    for (point_m, color) in points {
        let key = list.key_of(&Vector3::from(*point_m)).unwrap();
        let (count, sum) = sums.entry(key).or_default();
        if let Some(rgb) = color {
            *count += 1;
            (sum.iter_mut().zip(rgb)).for_each(|(sum, value)| *sum += u64::from(*value));
        }
    }
    sums
}

proptest! {
    #[test]
    fn sums_are_those_of_the_points_and_means_within_half_a_step(kind in any_kind(), points in any_points()) {
        let list = list_of(kind, &points, 1);
        let wanted = expected(&list, &points);
        prop_assert_eq!(list.len(), wanted.len());
        for (key, (count, sum)) in wanted {
            let color = list.color(key).unwrap();
            prop_assert_eq!((color.count, color.sum), (count, sum));
            let exact = sum.map(|sum| sum as f64 / f64::from(count));
            match color.mean() {
                Some(mean) => prop_assert!(
                    mean.iter().zip(exact).all(|(mean, exact)| (f64::from(*mean) - exact).abs() <= 0.5)
                ),
                None => prop_assert_eq!(count, 0),
            }
        }
    }

    #[test]
    fn order_threads_and_parts_do_not_change_a_byte(
        kind in any_kind(), points in any_points(), place in 0.0..=1.0_f64,
    ) {
        let file = file_of(&list_of(kind, &points, 1));
        let reversed: Vec<_> = points.iter().rev().copied().collect();
        prop_assert_eq!(&file, &file_of(&list_of(kind, &reversed, 4)));
        let (a, b) = points.split_at((place * points.len() as f64) as usize);
        let [a, b] = [a, b].map(|part| MapContents::from_list(&list_of(kind, part, 2)));
        let merged = |a: &MapContents, b: &MapContents| {
            let mut sum = a.clone();
            sum.merge(b.clone()).unwrap();
            bytes_of(&sum)
        };
        prop_assert_eq!(&file, &merged(&a, &b));
        prop_assert_eq!(&file, &merged(&b, &a));
        let read = read_map(&file[..], usize::MAX).unwrap();
        prop_assert_eq!(&file, &file_of(&read));
    }

    #[test]
    fn a_map_without_colours_has_the_bytes_that_it_had(kind in any_kind(), points in any_points()) {
        let colored = list_of(kind, &points, 1);
        let mut plain = VoxelList::new(colored.lattice().clone(), Vector3::zeros(), usize::MAX).unwrap();
        let (points_m, colors): (Vec<_>, Vec<_>) = points.iter().copied().unzip();
        let columns = PointColumns { colors: &colors, ..PointColumns::default() };
        plain.insert_points(Vector3::zeros(), &points_m, columns);
        prop_assert_eq!(plain.checksum(), colored.checksum());
        let file = file_of(&plain);
        prop_assert!(file.windows(5).all(|name| name != b"color"));
        let without = MapContents::read(&file_of(&colored)[..], usize::MAX).unwrap();
        prop_assert_eq!(without.keys(), &plain.sorted_keys()[..]);
        // Colours are never counted where they are not kept.
        let keys = plain.sorted_keys();
        prop_assert!(keys.into_iter().all(|key| plain.color(key).is_none()));
        prop_assert!(plain.bytes() <= colored.bytes());
    }
}
