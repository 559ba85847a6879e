//! Files that are refused.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use super::*;

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
    let of = |name: &[u8], kind: [u8; 4], data: &[u8]| section(name, kind, data.len() as u64, data);
    let plain = [0, 1, 0, 0];
    let keys_of = |kind: [u8; 4], data: &[u8]| vec![of(b"keys", kind, data)];
    let keys = || of(b"keys", plain, &FIRST_KEY);
    let count = |n: u8| of(b"count", [1, 1, 0, 0], &[n]);
    let sums = || of(b"offset_sum", [2, 3, 0, 0], &[0; 3]);
    let good = forged(&map, 1, &[keys(), count(1), sums()]);
    assert_eq!(read_map(&good[..], 1).unwrap().len(), 1);
    let head = HEAD_BYTES as u64;
    let data = head + SECTION_HEAD_BYTES as u64;
    let named = vec![of(b"KEYS", plain, &FIRST_KEY)];
    let empty_cell = vec![keys(), count(0), sums()];
    let color = |values: &[u8]| {
        let color = of(b"color", [1, 4, 0, 0], values);
        vec![keys(), count(1), sums(), color]
    };
    let of_color = data + 9 + 49 + 51 + 48;
    let good = forged(&map, 1, &color(&[1, 0xff, 1, 7, 0]));
    let list = read_map(&good[..], 1).unwrap();
    let key = list.sorted_keys()[0];
    assert_eq!(list.color(key).unwrap().mean(), Some([255, 7, 0]));
    for (voxels, sections, position, words) in [
        (1, vec![], head, "section \"keys\" is missing"),
        (1, vec![count(1)], head, "is \"count\", out of order"),
        (1, vec![keys(), count(1)], data + 9 + 49, "offset_sum"),
        (
            1,
            vec![keys(), keys()],
            data + 9,
            "is \"keys\", out of order",
        ),
        (2, vec![keys()], data + 9, "1 keys instead of 2"),
        (20, vec![keys()], head, "9 bytes do not fit"),
        (u64::MAX, vec![keys()], head, "9 bytes do not fit"),
        (0, vec![keys()], head, "9 bytes do not fit"),
        (
            1,
            color(&[2, 0, 0, 0]),
            of_color + 4,
            "2 coloured points of 1",
        ),
        (1, color(&[1, 0x80, 2, 0, 0]), of_color + 5, "exceed 255"),
        (1, color(&[0, 1, 0, 0]), of_color + 4, "exceed 0"),
        (1, color(&[1, 0xff, 1, 7]), of_color + 4, "too few values"),
        (1, color(&[1, 0, 7, 0, 0]), of_color + 5, "too many values"),
        (1, empty_cell, data + 9 + 49 + 51, "without points"),
        (1, vec![keys(), count(2), sums()], 160, "statistics 1"),
        (1, keys_of([1, 1, 0, 0], &FIRST_KEY), head, "encoding"),
        (1, keys_of([0, 1, 2, 0], &FIRST_KEY), head, "codec 2"),
        (1, keys_of([0, 1, 0, 1], &FIRST_KEY), head + 23, "zero"),
        (1, named, head + 4, "not a section name"),
        (2, keys_of(plain, &[1, 0]), data + 2, "ascend"),
        (2, keys_of(plain, &[1, 0x81, 0]), data + 2, "shortest"),
        (2, keys_of(plain, &[1, 0x81]), data + 2, "within a number"),
    ] {
        let file = forged(&map, voxels, &sections);
        let Err(FileError::Corrupt {
            position: at,
            reason,
        }) = read_map(&file[..], usize::MAX)
        else {
            panic!("{words}");
        };
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
    assert!(reason(300, &[&some[..], &[0]].concat()).contains("exactly"));
    // The writer keeps to what readers take.
    let keys = (1..100_000).filter_map(MortonKey::from_raw);
    let lattice = map.lattice().clone();
    let cells = OccupancyList::from_keys(lattice, [0; 3], keys, usize::MAX);
    let contents = MapContents::from_store(&cells);
    let options = WriteOptions {
        zstd_level: Some(19),
        occupancy_only: true,
    };
    let written = bytes(&contents, options);
    assert_eq!(MapContents::read(&written[..], 100_000).unwrap(), contents);
    assert!(max_voxels_of(written.len() as u64) >= 100_000);
}

#[test]
fn a_lattice_that_no_writer_writes_is_refused_with_its_place() {
    let place = |lattice: &Lattice, at: usize, value: f64| {
        let empty = VoxelList::at_datum(lattice.clone(), [0; 3], 1);
        let mut file = Vec::new();
        write_map(&empty, &mut file).unwrap();
        file[at..at + 8].copy_from_slice(&value.to_le_bytes());
        let crc = crc32fast::hash(&file[..220]);
        file[220..224].copy_from_slice(&crc.to_le_bytes());
        let end = file.len() - 4;
        let crc = crc32fast::hash(&file[..end]);
        file[end..].copy_from_slice(&crc.to_le_bytes());
        match read_map(&file[..], 1).map(|list| list.lattice().clone()) {
            Err(FileError::Corrupt { position, reason }) => (position, reason),
            other => panic!("{other:?}"),
        }
    };
    let turn = UnitQuaternion::from_euler_angles(0.3, -1.2, 2.5);
    let skewed = Matrix3::new(0.5, 0.1, -0.0, 0.0, 0.4, 0.2, 0.1, -0.1, 0.6);
    let custom = &Lattice::from_basis(skewed).unwrap();
    let turned = &custom.clone().oriented(turn);
    let cubic = &Lattice::new(LatticeKind::Cubic, 0.125).unwrap();
    for (lattice, at, value, position, words) in [
        (cubic, 32, f64::NAN, 32, "unit quaternion"),
        (cubic, 32, 1.001, 32, "unit quaternion"),
        (cubic, 40, f64::INFINITY, 32, "unit quaternion"),
        (turned, 32, 0.0, 32, "unit quaternion"),
        (cubic, 32, -1.0, 32, "canonical form"),
        (cubic, 40, -0.0, 32, "canonical form"),
        (cubic, 24, f64::NAN, 24, "volume"),
        (cubic, 64, 0.25, 64, "generator"),
        (cubic, 72, -0.0, 64, "generator"),
        (custom, 64, f64::NAN, 64, "finite"),
        (custom, 64, 1e300, 64, "volume"),
        (custom, 88, 1e7, 64, "in one plane"),
        (custom, 96, 1e4, 64, "too skewed"),
        (custom, 64, 50.0, 64, "long or flat"),
        (custom, 24, 0.2, 24, "that of the basis"),
    ] {
        let (found, reason) = place(lattice, at, value);
        assert!(reason.contains(words), "{reason} instead of {words}");
        assert_eq!(found, position, "{reason}");
    }
    let lost = UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    let lost = VoxelList::at_datum(cubic.clone().oriented(lost), [0; 3], 1);
    let error = write_map(&lost, Vec::new()).unwrap_err();
    assert!(matches!(error, FileError::Lattice(_)), "{error}");
}

#[test]
fn forged_further_columns_are_refused_where_they_are_wrong() {
    let map = map(LatticeKind::Fcc, &[[0.0; 3]]);
    let plain = || {
        vec![
            section(b"keys", [0, 1, 0, 0], 9, &FIRST_KEY),
            section(b"count", [1, 1, 0, 0], 1, &[1]),
            section(b"offset_sum", [2, 3, 0, 0], 3, &[0; 3]),
        ]
    };
    let read = |more: Vec<Vec<u8>>| {
        let sections = [plain(), more].concat();
        let file = forged(&map, 1, &sections);
        MapContents::read(&file[..], 1).map_err(|error| match error {
            FileError::Corrupt { reason, .. } => reason,
            other => panic!("{other}"),
        })
    };
    let of = |name: &[u8], kind: [u8; 2], data: &[u8]| {
        section(name, [kind[0], kind[1], 0, 0], data.len() as u64, data)
    };
    let stamps = |data: &[u8]| of(b"stamps", [3, 2], data);
    let labels = |data: &[u8]| of(b"labels", [4, 1], data);
    let all = vec![stamps(&[1, 2]), labels(&[1, 7, 1])];
    let good = read(all).unwrap();
    let payload = good.payload();
    assert!(payload.stamps && payload.labels);
    let list = good.into_list(1);
    let key = list.sorted()[0].0;
    let (first_ns, last_ns) = (-1, 1);
    assert_eq!(list.stamps(key), Some(Stamps { first_ns, last_ns }));
    let (label, count) = (7, 1);
    assert_eq!(list.label(key), Some(LabelCount { label, count }));
    for (more, words) in [
        (vec![stamps(&[2, 1])], "after the last"),
        (vec![stamps(&[0, 0, 0])], "too many"),
        (vec![labels(&[1, 7])], "too few"),
        (vec![labels(&[0, 7])], "too many"),
        (vec![labels(&[1, 7, 0])], "of 0 points"),
        (vec![labels(&[1, 0x80, 0x80, 4, 1])], "label 65536"),
        (vec![labels(&[2, 7, 1, 7, 1])], "ascend"),
        (vec![labels(&[0x80, 0x80, 0x80, 0x80, 0x10])], "too few"),
        (
            vec![labels(&[0]), stamps(&[1, 2])],
            "is \"stamps\", out of order",
        ),
        (vec![stamps(&[1])], "1 bytes do not fit"),
        (vec![stamps(&[0x80, 1])], "too few"),
        (
            vec![stamps(&[1, 2]), stamps(&[1, 2])],
            "is \"stamps\", out of order",
        ),
        (vec![of(b"stamps", [2, 2], &[1, 2])], "encoding"),
    ] {
        let reason = read(more).unwrap_err();
        assert!(reason.contains(words), "{reason} instead of {words}");
    }
    let bare = [plain()[0].clone(), stamps(&[1, 2])];
    let error = read_map(&forged(&map, 1, &bare)[..], 1).unwrap_err();
    assert!(
        error.to_string().contains("is \"stamps\", out of order"),
        "{error}"
    );
}
