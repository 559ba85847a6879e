//! The bytes of the format, and what is refused; properties over any map are in the test crate.

use super::head::{HEAD_BYTES, SECTION_HEAD_BYTES};
use super::*;
use crate::cloud::Cloud;
use crate::lattice::{Lattice, LatticeKind, MortonKey};
use crate::voxels::store::payload_columns::Columns;
use crate::voxels::{LabelCount, Payload, PointColumns, Stamps, Voxel};

mod refused;

fn map(kind: LatticeKind, offsets_m: &[[f32; 3]]) -> VoxelList {
    let datum_m = nalgebra::Vector3::new(-0.5, 0.0, 1.0);
    let mut list = VoxelList::new(Lattice::new(kind, 0.125).unwrap(), datum_m, 1000).unwrap();
    list.insert(&Cloud {
        stamp_ns: 0,
        datum_m,
        offsets_m: offsets_m.to_vec(),
    });
    list
}

fn bytes(contents: &MapContents, options: WriteOptions) -> Vec<u8> {
    let mut bytes = Vec::new();
    contents.write(&mut bytes, &options).unwrap();
    bytes
}

fn section(name: &[u8], kind: [u8; 4], raw_bytes: u64, stored: &[u8]) -> Vec<u8> {
    let mut bytes = b"SECT".to_vec();
    bytes.extend(name);
    bytes.resize(20, 0);
    bytes.extend(kind);
    bytes.extend(raw_bytes.to_le_bytes());
    bytes.extend((stored.len() as u64).to_le_bytes());
    bytes.extend(crc32fast::hash(stored).to_le_bytes());
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes.extend(stored);
    bytes
}

/// A head with so many voxels and sections, some sections and the end.
fn forged(map: &VoxelList, voxels: u64, sections: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_map(map, &mut bytes).unwrap();
    bytes.truncate(208);
    bytes.extend(voxels.to_le_bytes());
    bytes.extend((sections.len() as u32).to_le_bytes());
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes.extend(sections.concat());
    bytes.extend(b"LEND");
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

/// Key of (0, 0, 0): the three top bits, 7 << 60, nine groups of seven bits.
const FIRST_KEY: [u8; 9] = [0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x70];

#[test]
fn the_file_has_the_bytes_of_its_description() {
    let map = map(LatticeKind::Cubic, &[[0.125, 0.0, -0.125], [0.0, 0.5, 0.0]]);
    let mut expected = b"LATTICE2cubic".to_vec();
    expected.resize(24, 0);
    for value in [0.125_f64, 1.0, 0.0, 0.0, 0.0] {
        expected.extend(value.to_le_bytes());
    }
    for value in [0.5_f64, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.5] {
        expected.extend(value.to_le_bytes());
    }
    [-1_i64, 0, 2]
        .iter()
        .for_each(|i| expected.extend(i.to_le_bytes()));
    expected.extend(2_u64.to_le_bytes());
    expected.extend((1_u128 << 17).to_le_bytes());
    let distance = (0.125_f64.sqrt() * 2.0_f64.powi(20)).round();
    expected.extend((distance as u128).to_le_bytes());
    expected.extend((1_u64 << 17).to_le_bytes());
    expected.extend(2_u64.to_le_bytes());
    expected.extend(3_u32.to_le_bytes());
    expected.extend(crc32fast::hash(&expected).to_le_bytes());
    assert_eq!(expected.len(), HEAD_BYTES);
    let keys = [&FIRST_KEY[..], &[2]].concat();
    let sums = [0x80, 0x80, 0x10, 0, 0xff, 0xff, 0x0f, 0, 0, 0];
    expected.extend(section(b"keys", [0, 1, 0, 0], 10, &keys));
    expected.extend(section(b"count", [1, 1, 0, 0], 2, &[1, 1]));
    expected.extend(section(b"offset_sum", [2, 3, 0, 0], 10, &sums));
    expected.extend(b"LEND");
    expected.extend(crc32fast::hash(&expected).to_le_bytes());
    let mut written = Vec::new();
    write_map(&map, &mut written).unwrap();
    assert_eq!(written, expected);
}

#[test]
fn unknown_columns_are_skipped_but_checked() {
    let map = map(LatticeKind::Hex, &[[0.0; 3], [3.0; 3]]);
    let contents = MapContents::from_list(&map);
    let plain = bytes(&contents, WriteOptions::default());
    let sections = plain.get(HEAD_BYTES..plain.len() - 8).unwrap().to_vec();
    let label = section(b"label_histogram", [7, 4, 9, 0], 1 << 60, &[1, 2, 3]);
    let head = forged(&map, 2, &[vec![], vec![], vec![], vec![]]);
    let mut bytes = [&head[..HEAD_BYTES], &sections, &label, b"LEND"].concat();
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    assert_eq!(MapContents::read(&bytes[..], 2).unwrap(), contents);
    let at = bytes.len() - 9;
    bytes[at] ^= 1;
    let error = MapContents::read(&bytes[..], 2).unwrap_err().to_string();
    assert!(error.contains("section label_histogram"), "{error}");
}

#[test]
fn occupancy_alone_becomes_a_point_at_each_centre() {
    let map = map(LatticeKind::Bcc, &[[0.1; 3], [0.1; 3], [2.0; 3]]);
    let occupancy = bytes(&MapContents::from_store(&map), WriteOptions::default());
    let options = WriteOptions {
        occupancy_only: true,
        ..WriteOptions::default()
    };
    let with_statistics = bytes(&MapContents::from_list(&map), options);
    assert_eq!(occupancy.len(), with_statistics.len());
    let read = read_map(&with_statistics[..], 2).unwrap();
    read.validate().unwrap();
    let voxel = Voxel {
        count: 1,
        sum: [0; 3],
    };
    assert!(
        map.sorted()
            .iter()
            .all(|(key, _)| read.get(*key) == Some(voxel))
    );
    assert_eq!((read.len(), read.distortion().points), (2, 2));
    let contents = MapContents::read(&with_statistics[..], 2).unwrap();
    assert_eq!(contents.distortion(), map.distortion());
    let level = WriteOptions {
        zstd_level: Some(20),
        ..WriteOptions::default()
    };
    let error = contents.write(Vec::new(), &level).unwrap_err();
    assert!(matches!(error, FileError::Level(20)));
}

#[test]
fn maps_with_other_datums_merge_to_the_same_cells() {
    let points: Vec<[f32; 3]> = (0..200)
        .map(|i| {
            [
                0.37 * (i % 20) as f32,
                0.21 * (i / 7) as f32,
                0.1 * i as f32,
            ]
        })
        .collect();
    let (a, b) = points.split_at(120);
    let whole = MapContents::from_list(&map(LatticeKind::Fcc, &points));
    let mut merged = MapContents::from_list(&map(LatticeKind::Fcc, a));
    let other = MapContents::from_list(&map(LatticeKind::Fcc, b));
    let moved = other.clone().with_datum([-7, 1000, 3]).unwrap();
    assert_ne!(moved.keys(), other.keys());
    let far = (moved.center_m(moved.keys()[0]) - moved.datum_m()).norm();
    assert!(far > 100.0);
    assert_eq!(
        moved.clone().with_datum(other.datum_index()).unwrap(),
        other
    );
    merged.merge(moved.clone()).unwrap();
    assert_eq!(merged, whole);
    let before = merged.clone();
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.3, -1.2, 2.5);
    let turned = Lattice::new(LatticeKind::Fcc, 0.125)
        .unwrap()
        .oriented(turn);
    let turned = VoxelList::at_datum(turned, [0; 3], 1);
    for other in [map(LatticeKind::Hex, b), turned] {
        let refused = merged.merge(MapContents::from_list(&other));
        assert!(matches!(refused, Err(OperationError::Lattice { .. })));
    }
    let mut bare = other.clone();
    bare.drop_payload();
    let refused = merged.merge(bare.clone());
    assert_eq!(refused, Err(OperationError::Payload("point counts")));
    assert_eq!(merged, before);
    let far = other.clone().with_datum([i64::MIN, 0, i64::MAX]);
    assert!(matches!(far, Err(OperationError::OutOfRange { .. })));
    merged.drop_payload();
    merged.merge(bare).unwrap();
    assert_eq!(merged.keys(), whole.keys());
}

#[test]
fn retaining_keeps_payload_with_its_cell() {
    let list = map(LatticeKind::Bcc, &[[0.1; 3], [2.0; 3], [2.0; 3], [4.0; 3]]);
    let mut contents = MapContents::from_list(&list);
    contents.retain(|key, center_m| {
        assert_eq!(center_m, list.center_m(key));
        center_m.x > 0.0
    });
    assert_eq!(contents.keys().len(), 2);
    for (key, voxel) in contents.keys().iter().zip(contents.voxels().unwrap()) {
        assert_eq!(list.get(*key), Some(*voxel));
    }
    // The statistics are of the points that stay, and are those of a file that can be read.
    assert_eq!(contents.distortion().points, 3);
    assert_eq!(contents.check(), Ok(()));
    contents.into_list(9).validate().unwrap();
}

/// Further columns of every kind, in a list that was also edited and merged.
fn detailed(lattice: Lattice) -> VoxelList {
    let datum_m = nalgebra::Vector3::new(-0.5, 0.0, 1.0);
    let payload = Payload {
        stamps: true,
        labels: true,
        color: true,
    };
    let empty = VoxelList::new(lattice, datum_m, 10_000).unwrap();
    let mut list = empty.with_payload(payload);
    for scan in 0..3_i32 {
        let offsets_m = (0..300).map(|i| {
            let i = i as f32;
            [0.1 * (i % 20.0), 0.07 * i, 0.3 * scan as f32 - 0.01 * i]
        });
        let cloud = Cloud {
            stamp_ns: i64::from(scan - 1) * 1_700_000_000_000_000_000,
            datum_m,
            offsets_m: offsets_m.collect(),
        };
        let labels: Vec<u16> = (0..250).map(|i| (i % 7) * 9362).collect();
        let colors: Vec<_> = (0..200_u8)
            .map(|i| (i % 5 > 0).then_some([i, 255 - i, 7]))
            .collect();
        let columns = PointColumns {
            stamp_ns: cloud.stamp_ns,
            labels: &labels,
            colors: &colors,
            ..PointColumns::default()
        };
        list.insert_points(cloud.datum_m, &cloud.offsets_m, columns);
    }
    let gone = list.sorted().first().unwrap().0;
    assert!(VoxelStore::remove(&mut list, gone));
    list
}

#[test]
fn further_columns_go_with_their_voxels() {
    let list = detailed(Lattice::new(LatticeKind::Bcc, 0.125).unwrap());
    let whole = MapContents::from_list(&list);
    let (mut low, mut high) = (whole.clone(), whole.clone());
    low.retain(|_, center_m| center_m.y < 8.0);
    high.retain(|_, center_m| center_m.y >= 8.0);
    assert!(!low.keys().is_empty() && !high.keys().is_empty());
    let far = high.with_datum([-700, 20, 9]).unwrap();
    let mut merged = low.clone();
    merged.merge(far).unwrap();
    assert_eq!(merged.columns, whole.columns);
    assert_eq!(merged.voxels, whole.voxels);
    let mut both = whole.clone();
    both.merge(whole.clone()).unwrap();
    let (both, list) = (both.into_list(10_000), &list);
    for key in list.sorted_keys() {
        assert_eq!(both.stamps(key), list.stamps(key));
        let twice = |l: LabelCount| (l.label, 2 * l.count);
        let label = both.label(key).map(|l| (l.label, l.count));
        assert_eq!(label, list.label(key).map(twice));
        let once = list.color(key).unwrap();
        let mut color = once;
        color.add(&once);
        assert_eq!(both.color(key), Some(color));
    }
    let mut plain = whole.clone();
    plain.columns = Columns::new(Payload::default());
    assert_eq!(plain.merge(whole), Err(OperationError::Payload("stamps")));
}

#[test]
fn occupancy_is_read_in_one_go_and_bounded() {
    let list = detailed(Lattice::new(LatticeKind::HexOptimal, 0.125).unwrap());
    let file = bytes(&MapContents::from_list(&list), WriteOptions::default());
    let occupancy = read_occupancy(&file[..], 1 << 20).unwrap();
    occupancy.validate().unwrap();
    assert_eq!(occupancy.sorted_keys(), list.sorted_keys());
    assert_eq!(occupancy.datum_index(), list.datum_index());
    let store = MapContents::from_store(&occupancy);
    assert_eq!(store, MapContents::from_store(&list));
    for max_bytes in [0, 200, 1000] {
        let error = read_occupancy(&file[..], max_bytes).unwrap_err();
        assert!(matches!(error, FileError::TooLarge { .. }), "{error}");
    }
    // Skipped sections are checked too.
    for at in [HEAD_BYTES + 60, file.len() / 2, file.len() - 20] {
        let mut damaged = file.clone();
        damaged[at] ^= 4;
        assert!(read_occupancy(&damaged[..], 1 << 20).is_err());
    }
}
