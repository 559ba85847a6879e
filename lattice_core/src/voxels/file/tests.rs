//! The bytes of the format, and what is refused; properties over any map are in the test crate.

use super::head::{HEAD_BYTES, SECTION_HEAD_BYTES};
use super::*;
use crate::cloud::Cloud;
use crate::lattice::{Key, Lattice, LatticeKind};
use crate::voxels::Voxel;

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
fn damaged_files_are_refused_with_place_and_reason() {
    let map = map(LatticeKind::Mcc, &[[0.1; 3], [1.0; 3]]);
    for zstd_level in [None, Some(3)] {
        let contents = MapContents::from_list(&map);
        let options = WriteOptions {
            zstd_level,
            occupancy_only: false,
        };
        let good = bytes(&contents, options);
        assert_eq!(MapContents::read(&good[..], 2).unwrap(), contents);
        let read = |bytes: &[u8]| read_map(bytes, 2).unwrap_err();
        for end in 0..good.len() {
            let FileError::Truncated { position, .. } = read(&good[..end]) else {
                panic!("cut at {end}")
            };
            assert_eq!(position, end as u64);
        }
        for at in 0..good.len() {
            let mut bytes = good.clone();
            bytes[at] ^= 0x10;
            match read(&bytes) {
                FileError::Magic { .. } => assert!(at < 8),
                FileError::Checksum { start, end, .. } => {
                    let (at, last) = (at as u64, end + 4);
                    assert!((start..last).contains(&at) || at >= 4, "{at} {start} {end}");
                }
                FileError::Corrupt { position, .. } => {
                    assert!((position..position + 4).contains(&(at as u64)), "{at}");
                }
                other => panic!("{at}: {other}"),
            }
        }
        assert!(matches!(
            read_map(&good[..], 1),
            Err(FileError::TooManyVoxels { voxels: 2, .. })
        ));
        let longer = [&good[..], &[0]].concat();
        assert!(
            matches!(read(&longer), FileError::TrailingBytes { position } if position == good.len() as u64)
        );
    }
    let old = read_map(&b"LATTICE1fcc"[..], 9).unwrap_err();
    assert!(matches!(old, FileError::OldVersion));
}

#[test]
fn forged_sections_are_refused_where_they_are_wrong() {
    let map = map(LatticeKind::Fcc, &[[0.0; 3]]);
    let keys = || section(b"keys", [0, 1, 0, 0], 9, &FIRST_KEY);
    let count = |n: u8| section(b"count", [1, 1, 0, 0], 1, &[n]);
    let sums = || section(b"offset_sum", [2, 3, 0, 0], 3, &[0; 3]);
    let data = (HEAD_BYTES + SECTION_HEAD_BYTES) as u64;
    let refusal = |voxels: u64, sections: &[Vec<u8>]| match read_map(
        &forged(&map, voxels, sections)[..],
        usize::MAX,
    )
    .unwrap_err()
    {
        FileError::Corrupt { position, reason } => (position, reason),
        other => panic!("{other}"),
    };
    let good = forged(&map, 1, &[keys(), count(1), sums()]);
    assert_eq!(read_map(&good[..], 1).unwrap().len(), 1);
    let head = HEAD_BYTES as u64;
    for (voxels, sections, position, words) in [
        (1, vec![], head, "no section \"keys\""),
        (1, vec![count(1)], head, "cannot be \"count\""),
        (1, vec![keys(), count(1)], data + 9 + 49, "offset_sum"),
        (1, vec![keys(), keys()], data + 9, "cannot be \"keys\""),
        (2, vec![keys()], data + 9, "1 keys instead of 2"),
        (20, vec![keys()], head, "do not take 9 bytes"),
        (u64::MAX, vec![keys()], head, "do not take 9 bytes"),
        (0, vec![keys()], head, "do not take 9 bytes"),
        (
            1,
            vec![keys(), count(0), sums()],
            data + 9 + 49 + 51,
            "without points",
        ),
        (1, vec![keys(), count(2), sums()], 160, "statistics 1"),
        (
            1,
            vec![section(b"keys", [1, 1, 0, 0], 9, &FIRST_KEY)],
            head,
            "encoding",
        ),
        (
            1,
            vec![section(b"keys", [0, 1, 2, 0], 9, &FIRST_KEY)],
            head,
            "codec 2",
        ),
        (
            1,
            vec![section(b"keys", [0, 1, 0, 1], 9, &FIRST_KEY)],
            head + 23,
            "zero",
        ),
        (
            1,
            vec![section(b"KEYS", [0, 1, 0, 0], 9, &FIRST_KEY)],
            head + 4,
            "no name",
        ),
        (
            2,
            vec![section(b"keys", [0, 1, 0, 0], 2, &[1, 0])],
            data + 2,
            "ascend",
        ),
        (
            2,
            vec![section(b"keys", [0, 1, 0, 0], 3, &[1, 0x81, 0])],
            data + 2,
            "shortest",
        ),
        (
            2,
            vec![section(b"keys", [0, 1, 0, 0], 2, &[1, 0x81])],
            data + 2,
            "within a number",
        ),
    ] {
        let (at, reason) = refusal(voxels, &sections);
        assert!(reason.contains(words), "{reason} instead of {words}");
        assert_eq!(at, position, "{reason}");
    }
}

#[test]
fn a_section_that_unpacks_to_too_much_is_refused() {
    let map = map(LatticeKind::Fcc, &[[0.0; 3]]);
    let steps = vec![1; 100_000];
    let packed = zstd::bulk::compress(&steps, 3).unwrap();
    assert!(packed.len() < 100);
    let reason = |raw_bytes: u64, stored: &[u8]| {
        let section = section(b"keys", [0, 1, 1, 0], raw_bytes, stored);
        let bytes = forged(&map, raw_bytes, &[section]);
        read_map(&bytes[..], usize::MAX).unwrap_err().to_string()
    };
    assert!(reason(100_000, &packed).contains("not stored in"));
    let small = 64 * packed.len() as u64;
    assert!(reason(small, &packed).contains("does not unpack to"));
    let some = zstd::bulk::compress(&[1; 300], 3).unwrap();
    assert!(reason(301, &some).contains("does not unpack to"));
    assert!(reason(300, &some[..some.len() - 1]).contains("zstd"));
    assert!(reason(300, &[&some[..], &[0]].concat()).contains("nothing else"));
    // The writer keeps to what readers take.
    let keys = (1..100_000).filter_map(Key::from_raw).collect();
    let lattice = map.lattice().clone();
    let contents = MapContents::occupancy(lattice, [0; 3], keys).unwrap();
    let options = WriteOptions {
        zstd_level: Some(19),
        occupancy_only: true,
    };
    let written = bytes(&contents, options);
    assert_eq!(MapContents::read(&written[..], 100_000).unwrap(), contents);
    assert!(max_voxels_of(written.len() as u64) >= 100_000);
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
    let mut occupancy = Vec::new();
    write_occupancy(&map, &mut occupancy, &WriteOptions::default()).unwrap();
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
    let hex = MapContents::from_list(&map(LatticeKind::Hex, b));
    assert!(matches!(
        merged.merge(hex),
        Err(OperationError::Lattice { .. })
    ));
    let mut bare = other.clone();
    bare.drop_payload();
    assert_eq!(merged.merge(bare.clone()), Err(OperationError::Payload));
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
    assert_eq!(contents.distortion(), list.distortion());
    contents.into_list(9).validate().unwrap();
}
