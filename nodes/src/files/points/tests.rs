//! Whole files, good ones and damaged ones.

use std::io::Write;

use bzip2::Compression;
use bzip2::write::BzEncoder;
use proptest::prelude::*;
use tempfile::TempDir;

use super::*;

const LIMITS: PointFileOptions = PointFileOptions {
    max_points: 50,
    columns: None,
};

fn points() -> Vec<[f64; 3]> {
    (0..20)
        .map(|i| [f64::from(i) * 0.5, -2.0, f64::from(i * i)])
        .collect()
}

fn rows(suffix: &str) -> String {
    let row = |[x, y, z]: &[f64; 3]| format!("{x} {y} {z}{suffix}\n");
    points().iter().map(row).collect()
}

fn floats(order: fn(f32) -> [u8; 4], more: &[f32]) -> Vec<u8> {
    let of = |p: [f64; 3]| p.map(|c| c as f32).into_iter().chain(more.iter().copied());
    points().into_iter().flat_map(of).flat_map(order).collect()
}

fn ply(format: &str, data: &[u8]) -> Vec<u8> {
    let header = format!(
        "ply\nformat {format} 1.0\nelement vertex 20\nproperty float x\nproperty float y\n\
         property float z\nend_header\n"
    );
    [header.as_bytes(), data].concat()
}

fn pcd(data: &str, bytes: &[u8]) -> Vec<u8> {
    let header = format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\n\
         TYPE F F F\nCOUNT 1 1 1\nWIDTH 20\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 20\nDATA {data}\n"
    );
    [header.as_bytes(), bytes].concat()
}

fn compressed() -> Vec<u8> {
    let axis = |axis: usize| points().into_iter().map(move |p| p[axis] as f32);
    let by_axis: Vec<u8> = (0..3).flat_map(axis).flat_map(f32::to_le_bytes).collect();
    let mut packed = Vec::new();
    for literal in by_axis.chunks(32) {
        packed.push(literal.len() as u8 - 1);
        packed.extend(literal);
    }
    let lengths = [packed.len() as u32, by_axis.len() as u32].map(u32::to_le_bytes);
    [lengths.concat(), packed].concat()
}

/// A file of each format with `points`; the length of the first six is fixed by their header, but for
/// those of text.
fn files() -> [(&'static str, Vec<u8>, PointFormat); 8] {
    use PointFormat::*;
    let little = floats(f32::to_le_bytes, &[]);
    let big = floats(f32::to_be_bytes, &[]);
    let ascii = rows("").into_bytes();
    let (ply_little, ply_big) = ("binary_little_endian", "binary_big_endian");
    let intensities = floats(f32::to_le_bytes, &[0.25]);
    [
        ("a.ply", ply("ascii", &ascii), PlyAscii),
        ("a.ply", ply(ply_little, &little), PlyBinaryLittleEndian),
        ("a.ply", ply(ply_big, &big), PlyBinaryBigEndian),
        ("a.pcd", pcd("ascii", &ascii), PcdAscii),
        ("a.pcd", pcd("binary", &little), PcdBinary),
        (
            "a.pcd",
            pcd("binary_compressed", &compressed()),
            PcdBinaryCompressed,
        ),
        ("a.xyz", rows(" 7 7 # c").into_bytes(), Text),
        ("a.bin", intensities, KittiBin),
    ]
}

fn read_bytes(name: &str, bytes: &[u8]) -> Result<PointFile, PointFileError> {
    read_bytes_within(name, bytes, LIMITS.max_points)
}

fn read_bytes_within(
    name: &str,
    bytes: &[u8],
    max_points: usize,
) -> Result<PointFile, PointFileError> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let options = PointFileOptions {
        max_points,
        ..LIMITS
    };
    read_points(&path, &options)
}

fn pack(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = BzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn every_format_gives_the_same_points_packed_or_not() {
    for (name, bytes, format) in files() {
        let expected = PointFile {
            points_m: points(),
            labels: Vec::new(),
            format,
            skipped_not_finite: 0,
            no_returns: 0,
            voxel_m: None,
        };
        assert_eq!(read_bytes(name, &bytes).unwrap(), expected, "{format}");
        let unpacked = read_bytes(&format!("{name}.bz2"), &pack(&bytes));
        assert_eq!(unpacked.unwrap(), expected, "{format}");
    }
}

#[test]
fn labels_are_classes_in_every_format_that_names_them() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 4\nproperty int label\nproperty float x\n\
        property float y\nproperty float z\nend_header\n7 1 2 3\n9 nan 2 3\n-1 1 2 3\n65534 1 2 3\n";
    let pcd = "VERSION 0.7\nFIELDS x y z label\nSIZE 4 4 4 4\nTYPE F F F I\nWIDTH 4\nHEIGHT 1\n\
        DATA ascii\n1 2 3 7\nnan 2 3 9\n1 2 3 -1\n1 2 3 65534\n";
    let mut binary = pcd.replace("ascii", "binary").into_bytes();
    binary.truncate(binary.len() - "1 2 3 7\nnan 2 3 9\n1 2 3 -1\n1 2 3 65534\n".len());
    for (x, label) in [(1.0_f32, 7_i32), (f32::NAN, 9), (1.0, -1), (1.0, 65534)] {
        for coordinate in [x, 2.0, 3.0] {
            binary.extend(coordinate.to_le_bytes());
        }
        binary.extend(label.to_le_bytes());
    }
    let text = "x,label,y,z\n1,7,2,3\nnan,9,2,3\n1,wall,2,3\n1,65534,2,3\n";
    for (name, bytes) in [
        ("a.ply", ply.as_bytes()),
        ("a.pcd", pcd.as_bytes()),
        ("a.pcd", &binary),
        ("a.csv", text.as_bytes()),
    ] {
        let file = read_bytes(name, bytes).unwrap();
        assert_eq!(file.points_m, [[1.0, 2.0, 3.0]; 3], "{name}");
        assert_eq!(file.labels, [7, u16::MAX, 65534], "{name}");
    }
}

#[test]
fn points_that_are_not_finite_are_counted() {
    let file = read_bytes("a.xyz", b"1 2 3\nnan 2 3\n1 2 inf\n").unwrap();
    assert_eq!(file.points_m, [[1.0, 2.0, 3.0]]);
    assert_eq!(file.skipped_not_finite, 2);
}

#[test]
fn the_limit_holds_with_and_without_a_header() {
    let text = "1 2 nan\n".repeat(51);
    let kitti = [0; 16 * 51];
    let limited = |name, bytes: &[u8], limit| {
        let error = read_bytes_within(name, bytes, limit).unwrap_err();
        error.to_string()
    };
    for (name, bytes) in [("a.xyz", text.as_bytes()), ("a.bin", &kitti)] {
        let error = limited(name, bytes, 50);
        assert!(
            error.contains("has 51 points or more, but at most 50"),
            "{error}"
        );
    }
    for (name, bytes, _) in files().into_iter().take(6) {
        let error = limited(name, &bytes, 19);
        assert!(
            error.contains("has 20 points or more, but at most 19"),
            "{error}"
        );
    }
}

#[test]
fn files_that_are_not_there_or_of_no_known_kind_are_told() {
    let missing = read_points(Path::new("/no/such/file.ply"), &LIMITS);
    assert!(matches!(missing, Err(PointFileError::Io { byte: 0, .. })));
    let step = read_bytes("a.step", b"ISO").unwrap_err().to_string();
    assert!(step.contains("extension \"step\""), "{step}");
}

#[test]
fn a_cut_file_with_a_header_is_an_error_at_every_length() {
    use PointFormat::{PcdAscii, PlyAscii};
    let binary = |format| format != PlyAscii && format != PcdAscii;
    for (name, bytes, format) in files().into_iter().take(6) {
        for length in (0..bytes.len()).filter(|_| binary(format)) {
            let cut = read_bytes(name, &bytes[..length]);
            assert!(cut.is_err(), "{format}, {length} bytes");
        }
    }
}

proptest! {
    /// Nothing panics, and what is read is within the limit and finite.
    #[test]
    fn damaged_files_are_errors_or_points(
        file in 0..files().len(),
        cut in any::<prop::sample::Index>(),
        keep_all in any::<bool>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
        extra in prop::collection::vec(any::<u8>(), 0..40),
    ) {
        let (name, mut bytes, _) = files()[file].clone();
        for (at, value) in damage {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if !keep_all {
            bytes.truncate(cut.index(bytes.len()));
        }
        bytes.extend(extra);
        if let Ok(file) = read_bytes(name, &bytes) {
            prop_assert!(file.points_m.len() + file.skipped_not_finite <= LIMITS.max_points);
            prop_assert!(file.points_m.iter().flatten().all(|c| c.is_finite()));
        }
    }

    /// Damage to the numbers of a header, where the lies are.
    #[test]
    fn lies_in_a_header_are_errors_or_points(
        file in 0..6_usize,
        which in any::<prop::sample::Index>(),
        lie in prop::sample::select(&[
            "0", "1", "3", "21", "-1", "255", "65536", "4294967295", "4294967296",
            "9223372036854775807", "18446744073709551615", "99999999999999999999", "1e9", "x", "",
        ][..]),
    ) {
        let (name, bytes, _) = files()[file].clone();
        let end = bytes.windows(5).position(|w| w == b"DATA " || w == b"end_h").unwrap();
        let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
        let words: Vec<&str> = header.split_inclusive([' ', '\n']).collect();
        let numbers: Vec<usize> = (0..words.len())
            .filter(|&i| words[i].trim().parse::<u32>().is_ok())
            .collect();
        let number = numbers[which.index(numbers.len())];
        let lied: String = (0..words.len())
            .map(|i| match i == number {
                true => words[i].replace(words[i].trim(), lie),
                false => words[i].to_owned(),
            })
            .collect();
        if let Ok(file) = read_bytes(name, &[lied.as_bytes(), &bytes[end..]].concat()) {
            prop_assert!(file.points_m.len() <= LIMITS.max_points);
        }
    }
}

#[test]
fn labels_of_semantic_kitti_are_found_and_must_be_as_many() {
    let folder = TempDir::new().unwrap();
    let scans = folder.path().join("velodyne");
    std::fs::create_dir_all(&scans).unwrap();
    std::fs::create_dir_all(folder.path().join("labels")).unwrap();
    let scan = scans.join("000007.bin");
    std::fs::write(&scan, floats(f32::to_le_bytes, &[0.5])).unwrap();
    assert!(read_points(&scan, &LIMITS).unwrap().labels.is_empty());
    // The upper half is the instance.
    let labels = |n: u32| (0..n).flat_map(|i| ((i << 16) | (40 * (i % 3))).to_le_bytes());
    let beside = scans.join("000007.label");
    for path in [folder.path().join("labels/000007.label"), beside.clone()] {
        std::fs::write(&path, labels(20).collect::<Vec<u8>>()).unwrap();
        let read = read_points(&scan, &LIMITS).unwrap();
        assert_eq!(read.points_m.len(), 20);
        let unlabelled = lattice_core::registration::UNLABELED;
        assert_eq!(read.labels[..4], [unlabelled, 40, 80, unlabelled]);
    }
    for (n, message) in [(19, "label 20 of "), (21, "labels for more than 20 points")] {
        std::fs::write(&beside, labels(n).collect::<Vec<u8>>()).unwrap();
        let error = read_points(&scan, &LIMITS).unwrap_err().to_string();
        assert!(
            error.contains(message) && error.contains("000007.label"),
            "{error}"
        );
    }
}

#[test]
fn a_packed_file_that_is_cut_says_so_wherever_it_is_cut() {
    let folder = TempDir::new().unwrap();
    let mut encoder = BzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(rows("").as_bytes()).unwrap();
    let packed = encoder.finish().unwrap();
    let path = folder.path().join("points.xyz.bz2");
    for length in [4, 7, 10, 60, packed.len() - 1] {
        std::fs::write(&path, &packed[..length]).unwrap();
        let error = read_points(&path, &LIMITS).unwrap_err().to_string();
        assert!(error.contains("the file is cut short"), "{length}: {error}");
    }
}

#[test]
fn no_returns_go_with_their_labels() {
    let head = |rows: u32| {
        format!(
            "VERSION 0.7\nFIELDS x y z label\nSIZE 4 4 4 4\nTYPE F F F I\nWIDTH {}\nHEIGHT {rows}\nDATA ascii\n",
            32 / rows
        )
    };
    let row = |i: u32| match i % 4 {
        0 => format!("0 0 0 {i}\n"),
        _ => format!("{i} 0 0 {i}\n"),
    };
    let lines: String = (0..32).map(row).collect();
    let read = |rows| read_bytes("a.pcd", format!("{}{lines}", head(rows)).as_bytes()).unwrap();
    let (plain, organized) = (read(1), read(4));
    assert_eq!((plain.no_returns, plain.points_m.len()), (0, 32));
    assert_eq!((organized.no_returns, organized.points_m.len()), (8, 24));
    let pairs = organized.points_m.iter().zip(&organized.labels);
    assert!(
        pairs
            .clone()
            .all(|([x, _, _], label)| *x == f64::from(*label))
    );
    assert_eq!(pairs.len(), 24);
}
