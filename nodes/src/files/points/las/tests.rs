//! LAS files as other programs write them, and damaged ones.

use crate::files::points::{PointFile, PointFileOptions, PointFormat, read_points};

/// A record of a point of format 0 or 6.
fn record(format: u8, steps: [i32; 3], class: u8) -> Vec<u8> {
    let mut bytes: Vec<u8> = steps.into_iter().flat_map(i32::to_le_bytes).collect();
    bytes.resize(if format < 6 { 20 } else { 30 }, 0);
    // A flag of format 0, which is no part of the class.
    let (at, class) = if format < 6 {
        (15, class | 0x40)
    } else {
        (16, class)
    };
    bytes[at] = class;
    bytes
}

/// Points in steps of a centimetre from an origin, with their classes.
const POINTS: [([i32; 3], u8); 3] = [([0, 150, -20], 2), ([100, 0, 0], 1), ([-7, 8, 9], 6)];
const ORIGIN_M: [f64; 3] = [4e5, 5.6e6, 100.0];

/// A header of version 1.2 or 1.4, its records and what follows them.
fn file(format: u8, records: &[(&str, u16, Vec<u8>)], count: u64, points: &[u8]) -> Vec<u8> {
    let is_new = format & 0x3f >= 6;
    let (minor, length) = if is_new { (4, 375) } else { (2, 227) };
    let mut bytes = vec![0; length];
    bytes[..4].copy_from_slice(b"LASF");
    bytes[24..26].copy_from_slice(&[1, minor]);
    bytes[94..96].copy_from_slice(&(length as u16).to_le_bytes());
    let behind: usize = records.iter().map(|(_, _, data)| 54 + data.len()).sum();
    // Two bytes that nothing names precede the points.
    let points_at = (length + behind + 2) as u32;
    bytes[96..100].copy_from_slice(&points_at.to_le_bytes());
    bytes[100..104].copy_from_slice(&(records.len() as u32).to_le_bytes());
    bytes[104] = format;
    let size: u16 = if is_new { 30 } else { 20 };
    bytes[105..107].copy_from_slice(&size.to_le_bytes());
    match is_new {
        true => bytes[247..255].copy_from_slice(&count.to_le_bytes()),
        false => bytes[107..111].copy_from_slice(&(count as u32).to_le_bytes()),
    }
    for (axis, origin_m) in ORIGIN_M.into_iter().enumerate() {
        let (scale, offset) = (131 + 8 * axis, 155 + 8 * axis);
        bytes[scale..scale + 8].copy_from_slice(&0.01_f64.to_le_bytes());
        bytes[offset..offset + 8].copy_from_slice(&origin_m.to_le_bytes());
    }
    for (owner, id, data) in records {
        let mut head = [0; 54];
        head[2..2 + owner.len()].copy_from_slice(owner.as_bytes());
        head[18..20].copy_from_slice(&id.to_le_bytes());
        head[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
        bytes.extend([&head[..], data].concat());
    }
    bytes.extend([0xcc, 0xdd]);
    bytes.extend(points);
    bytes
}

fn records(format: u8) -> Vec<u8> {
    let points = POINTS.into_iter();
    points
        .flat_map(|(steps, class)| record(format, steps, class))
        .collect()
}

fn read(bytes: &[u8]) -> Result<PointFile, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.las");
    std::fs::write(&path, bytes).unwrap();
    let limits = PointFileOptions {
        max_points: 5000,
        ..PointFileOptions::default()
    };
    read_points(&path, &limits).map_err(|error| error.to_string())
}

fn expect(found: &PointFile, format: PointFormat) {
    assert_eq!(found.format, format);
    assert_eq!(found.labels, [2, u16::MAX, 6]);
    assert_eq!(found.points_m.len(), POINTS.len());
    for (found_m, (steps, _)) in found.points_m.iter().zip(POINTS) {
        let steps = steps.into_iter().zip(ORIGIN_M);
        for (coordinate_m, (steps, origin_m)) in found_m.iter().zip(steps) {
            let expected_m = origin_m + 0.01 * f64::from(steps);
            assert!((coordinate_m - expected_m).abs() < 1e-8, "{found_m:?}");
        }
    }
}

#[test]
fn points_of_old_and_new_files_are_read_with_their_classes() {
    let own = ("us", 7, vec![1; 9]);
    for format in [0, 6] {
        let bytes = file(format, std::slice::from_ref(&own), 3, &records(format));
        expect(&read(&bytes).unwrap(), PointFormat::Las);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length}");
        }
    }
    let unclassified: Vec<u8> = record(0, [1, 2, 3], 1);
    assert!(
        read(&file(0, &[], 1, &unclassified))
            .unwrap()
            .labels
            .is_empty()
    );
}

#[test]
fn what_a_header_has_wrong_is_named() {
    let sound = file(0, &[], 3, &records(0));
    let with = |at: usize, bytes: &[u8]| {
        let mut file = sound.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        read(&file).unwrap_err()
    };
    for (at, bytes, message) in [
        (0, &b"LASX"[..], "no `LASF`"),
        (94, &[9, 0], "a header of 9 bytes, expected 227 to 4096"),
        (94, &[0xff; 2], "a header of 65535 bytes"),
        (96, &[9, 0, 0, 0], "points at byte 9"),
        (96, &[0xff; 4], "cut short"),
        (104, &[11], "point format 11, expected 0 to 10"),
        (105, &[19, 0], "points of 19 bytes"),
        (107, &[0xff; 4], "but at most 5000 are allowed"),
        (131, &f64::NAN.to_le_bytes(), "scale [NaN"),
        (104, &[0x80], "LASzip"),
    ] {
        let error = with(at, bytes);
        assert!(error.contains(message), "{error}");
    }
    let degrees = ("LASF_Projection", 2112, b"GEOGCS[\"WGS 84\"]".to_vec());
    let error = read(&file(0, &[degrees], 3, &records(0))).unwrap_err();
    assert!(error.contains("in degrees, not metres"), "{error}");
}

#[cfg(feature = "survey")]
mod packed {
    use laz::laszip::LazItemRecordBuilder;
    use laz::{LasZipCompressor, LazVlrBuilder};

    use super::*;

    /// The points, and many between, packed by the crate that unpacks them.
    fn packed(format: u8) -> Vec<u8> {
        let items = LazItemRecordBuilder::default_for_point_format_id(format, 0).unwrap();
        let vlr = LazVlrBuilder::new(items).with_fixed_chunk_size(100).build();
        let mut record = Vec::new();
        vlr.write_to(&mut record).unwrap();
        let records = [("laszip encoded", 22204, record)];
        let all = all(format);
        let count = (all.len() / if format < 6 { 20 } else { 30 }) as u64;
        let head = file(format | 0x80, &records, count, &[]);
        // The table of chunks is at a byte of the whole file.
        let mut whole = std::io::Cursor::new(head.clone());
        whole.set_position(head.len() as u64);
        let mut packer = LasZipCompressor::new(whole, vlr).unwrap();
        packer.compress_many(&all).unwrap();
        packer.done().unwrap();
        packer.into_inner().into_inner()
    }

    fn all(format: u8) -> Vec<u8> {
        let more = (0..1000).map(|i| record(format, [i, -i, i % 7], 2));
        [records(format), more.collect::<Vec<_>>().concat()].concat()
    }

    #[test]
    fn packed_points_are_those_that_are_not() {
        for format in [0, 6] {
            let bytes = packed(format);
            let mut found = read(&bytes).unwrap();
            let plain = read(&file(format, &[], 1003, &all(format))).unwrap();
            assert_eq!(
                (&found.points_m, &found.labels),
                (&plain.points_m, &plain.labels)
            );
            found.points_m.truncate(3);
            found.labels.truncate(3);
            expect(&found, PointFormat::Laz);
        }
    }

    #[test]
    fn damage_to_packed_points_is_an_error_or_other_points() {
        for format in [0, 6] {
            let bytes = packed(format);
            let from = if format < 6 { 227 } else { 375 };
            for at in (from..bytes.len()).step_by(13) {
                assert!(
                    read(&bytes[..at]).is_err() || at + 200 > bytes.len(),
                    "{at}"
                );
                let mut bytes = bytes.clone();
                bytes[at] = 0xff;
                if let Ok(file) = read(&bytes) {
                    assert!(file.points_m.len() <= 5000);
                }
            }
        }
    }
}
