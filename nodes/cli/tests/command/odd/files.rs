//! Point files that other programs write in their own way.

use std::fs;

use lattice_nodes::files::points::{PointFileOptions, read_points};
use serde_json::Value;

use super::driven;
use crate::lattice;

/// A point file, and the options of `quantize` for it.
struct File {
    name: &'static str,
    bytes: Vec<u8>,
    options: &'static [&'static str],
}

/// Result of a row.
enum Becomes {
    /// The reference map, with so many points left out as no returns.
    Map(u64),
    /// The same with 24 points more, at the origin.
    MapWithOrigin,
    /// The same, and the labels 1, 2 and 3 in turn.
    Labelled,
    /// The same, and so many points refused.
    Refused(u64),
    /// Exit status 1.
    Error,
}
use Becomes::{Error, Labelled, Map, MapWithOrigin, Refused};

/// Points whose coordinates are whole sixteenths of a metre, which all formats hold; none at the origin.
fn points() -> Vec<[f64; 3]> {
    let part = |i: u32, by: f64| (f64::from(i + 1) * by).fract();
    let coordinate = |i, by, length_m: f64| (16.0 * length_m * part(i, by)).round() / 16.0;
    let point = |i| {
        [
            coordinate(i, 0.618_034, 60.0) - 30.0,
            coordinate(i, 0.754_878, 40.0) - 20.0,
            0.0625 + coordinate(i, 0.569_840, 3.0),
        ]
    };
    (0..600).map(point).collect()
}

fn text(name: &'static str, head: &str, line: impl Fn([String; 3]) -> String) -> File {
    let words = |p: [f64; 3]| line(p.map(|c| c.to_string())) + "\n";
    let lines: String = points().into_iter().map(words).collect();
    File {
        name,
        bytes: format!("{head}{lines}").into_bytes(),
        options: &[],
    }
}

fn raw(name: &'static str, bytes: &[u8]) -> File {
    File {
        name,
        bytes: bytes.to_vec(),
        options: &[],
    }
}

/// Words with decimal commas.
fn commas(words: [String; 3]) -> [String; 3] {
    words.map(|word| word.replace('.', ","))
}

/// Records of x, y, z and further columns: an intensity and a ring.
fn bin(columns: usize, doubles: bool, options: &'static [&'static str]) -> File {
    let mut bytes = Vec::new();
    for (i, point) in points().into_iter().enumerate() {
        let more = [(i % 7) as f64 * 0.1, (i % 32) as f64, 0.5, 0.25, 1.0];
        for value in point.into_iter().chain(more).take(columns) {
            match doubles {
                true => bytes.extend(value.to_le_bytes()),
                false => bytes.extend((value as f32).to_le_bytes()),
            }
        }
    }
    File {
        name: "scan.bin",
        bytes,
        options,
    }
}

/// An organised PCD file of these points.
fn pcd(points: &[[f64; 3]], viewpoint: &str) -> File {
    let lines = points.iter().map(|[x, y, z]| format!("{x} {y} {z}\n"));
    let head = format!(
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {}\nHEIGHT 1\n\
         VIEWPOINT {viewpoint}\nPOINTS {}\nDATA ascii\n",
        points.len(),
        points.len()
    );
    File {
        name: "cloud.pcd",
        bytes: (head + &lines.collect::<String>()).into_bytes(),
        options: &[],
    }
}

/// The same points as five rows.
fn organized(mut file: File) -> File {
    let text = String::from_utf8(file.bytes).unwrap();
    let rows = text.replace("WIDTH 625\nHEIGHT 1", "WIDTH 125\nHEIGHT 5");
    assert_ne!(rows, text);
    file.bytes = rows.into_bytes();
    file
}

const ORIGIN: &str = "0 0 0 1 0 0 0";

/// The points with others between them.
fn with(other: [f64; 3], times: usize) -> Vec<[f64; 3]> {
    let mut all = points();
    for i in 0..times {
        all.insert(i * 3, other);
    }
    all
}

/// A PLY file with a class of each point under a name.
fn ply(name: &str, kind: &str) -> File {
    let head = format!(
        "ply\nformat ascii 1.0\nelement vertex 600\nproperty double x\nproperty double y\nproperty double z\n\
         property {kind} {name}\nend_header\n"
    );
    let lines = points().into_iter().enumerate();
    let lines = lines.map(|(i, [x, y, z])| format!("{x} {y} {z} {}\n", i % 3 + 1));
    File {
        name: "cloud.ply",
        bytes: (head + &lines.collect::<String>()).into_bytes(),
        options: &[],
    }
}

fn drivers() -> Vec<(&'static str, (Vec<File>, Becomes))> {
    let semicolons = |words: [String; 3]| commas(words).join(";");
    let cut = |mut file: File, by: usize| {
        file.bytes.truncate(file.bytes.len() - by);
        file
    };
    let utf16 = text("a.txt", "\u{feff}", |words| words.join(" "));
    let utf16 = String::from_utf8(utf16.bytes).unwrap();
    let utf16: Vec<u8> = utf16.encode_utf16().flat_map(u16::to_le_bytes).collect();
    vec![
        (
            "decimal commas between semicolons, blanks or quotes",
            (
                vec![
                    text("a.xyz", "", semicolons),
                    text("a.csv", "X;Y;Z;Text\r\n", |words| {
                        semicolons(words) + ";a b\r"
                    }),
                    text("a.txt", "", |words| commas(words).join("\t")),
                    text("a.asc", "", |words| commas(words).join("  ")),
                    text("a.csv", "\"x\",\"y\",\"z\"\n", |words| {
                        format!("\"{}\"", commas(words).join("\",\""))
                    }),
                ],
                Map(0),
            ),
        ),
        (
            "decimal commas between commas, where a decimal begins with 0",
            (
                vec![
                    text("a.csv", "", |words| commas(words).join(",")),
                    raw("a.txt", b"1,05,2,05,3,05\n"),
                ],
                Error,
            ),
        ),
        (
            "thousands separators",
            (
                vec![
                    raw("a.csv", b"1.234,5;2;3\n"),
                    raw("a.csv", b"1;2;3,456.7\n"),
                    raw("a.txt", b"\"1,234.5\",2,3\n"),
                ],
                Error,
            ),
        ),
        (
            "a byte order mark, ends of line of Windows",
            (
                vec![
                    text("a.xyz", "\u{feff}", |words| words.join(" ") + "\r"),
                    text("a.csv", "\u{feff}x,y,z\r\n", |words| words.join(",") + "\r"),
                ],
                Map(0),
            ),
        ),
        ("text in UTF-16", (vec![raw("a.txt", &utf16)], Error)),
        (
            "`.bin` of other columns than x, y, z and intensity",
            (
                vec![
                    bin(3, false, &[]),
                    bin(5, false, &[]),
                    bin(6, false, &[]),
                    bin(8, false, &[]),
                    bin(3, true, &[]),
                    bin(4, true, &[]),
                ],
                Error,
            ),
        ),
        (
            "the same with `--columns 5`, or of doubles with `--columns 3d`",
            (
                vec![
                    bin(4, false, &[]),
                    bin(4, false, &["--columns", "4"]),
                    bin(3, false, &["--columns", "3"]),
                    bin(5, false, &["--columns", "5"]),
                    bin(8, false, &["--columns", "8"]),
                    bin(3, true, &["--columns", "3d"]),
                    bin(5, true, &["--columns", "5d"]),
                ],
                Map(0),
            ),
        ),
        (
            "`.bin` that ends within a point",
            (
                vec![cut(bin(4, false, &[]), 1), cut(bin(4, false, &[]), 8)],
                Error,
            ),
        ),
        (
            "points at 0 0 0: any of an organised PCD file, more than 24 of others",
            (
                vec![
                    pcd(&with([0.0; 3], 25), ORIGIN),
                    pcd(&with([-0.0, 0.0, 0.0], 25), ORIGIN),
                    organized(pcd(&with([0.0; 3], 25), ORIGIN)),
                ],
                Map(25),
            ),
        ),
        (
            "up to 24 points at 0 0 0 of a file that is not organised",
            (vec![pcd(&with([0.0; 3], 24), ORIGIN)], MapWithOrigin),
        ),
        (
            "coordinates that are NaN or infinite",
            (
                vec![
                    pcd(&with([f64::NAN; 3], 9), ORIGIN),
                    pcd(&with([1.0, f64::INFINITY, 0.0], 9), ORIGIN),
                ],
                Refused(9),
            ),
        ),
        (
            "`VIEWPOINT` of a PCD file away from the origin",
            (
                vec![
                    pcd(&points(), "100 0 0 1 0 0 0"),
                    pcd(&points(), "0 0 0 0.7071068 0 0 0.7071068"),
                    pcd(&points(), "0 0 2 0 0 0 0"),
                ],
                Map(0),
            ),
        ),
        (
            "`VIEWPOINT` at the origin, its quaternion of any length",
            (
                vec![
                    pcd(&points(), "0 0 0 2 0 0 0"),
                    pcd(&points(), "0 0 0 -1 0 0 0"),
                    pcd(&points(), "0 0 0 0 0 0 0"),
                ],
                Map(0),
            ),
        ),
        (
            "a field `label`, `labels`, `class` or `classification`, also behind `scalar_`, in any case",
            (
                vec![
                    ply("label", "ushort"),
                    ply("scalar_Label", "float"),
                    ply("scalar_Classification", "float"),
                    ply("CLASS", "uchar"),
                ],
                Labelled,
            ),
        ),
    ]
}

/// The row of `quantize` in JSON, or its errors.
fn quantized(path: &str, options: &[&str]) -> (Option<Value>, String) {
    let output = lattice(&[&["quantize", path, "--lattice", "fcc", "--json"], options].concat());
    let errors = String::from_utf8(output.stderr).unwrap();
    let rows: Option<Value> = match output.status.success() {
        true => Some(serde_json::from_slice(&output.stdout).unwrap()),
        false => None,
    };
    (rows.map(|rows| rows[0].clone()), errors)
}

#[test]
fn odd_point_files_become_what_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    let write = |file: &File| {
        let path = folder.path().join(file.name);
        fs::write(&path, &file.bytes).unwrap();
        path.display().to_string()
    };
    let plain = write(&text("plain.xyz", "", |words| words.join(" ")));
    let reference = quantized(&plain, &[]).0.unwrap();
    assert_eq!(reference["points"], 600);
    for (row, (files, becomes)) in driven("| of a point file |", drivers()) {
        for file in files {
            let path = write(&file);
            let (found, errors) = quantized(&path, file.options);
            let name = format!("{}: {} {:?}: {errors}", row.name, file.name, file.options);
            row.check(&errors);
            if matches!(becomes, Error) {
                assert!(found.is_none(), "{name}");
                continue;
            }
            let found = found.unwrap_or_else(|| panic!("{name}"));
            let number = |key: &str| found[key].as_u64().unwrap();
            let (origin, no_returns, refused) = match becomes {
                Map(no_returns) => (0, no_returns, 0),
                MapWithOrigin => (24, 0, 0),
                Refused(refused) => (0, 0, refused),
                Labelled | Error => (0, 0, 0),
            };
            assert_eq!(number("points"), 600 + origin, "{name}");
            assert_eq!(number("no_returns"), no_returns, "{name}");
            assert_eq!(number("refused_not_finite"), refused, "{name}");
            if origin == 0 {
                assert_eq!(found["voxels"], reference["voxels"], "{name}");
                let mse = "mse_per_dimension_m2";
                assert_eq!(found[mse], reference[mse], "{name}");
            }
            if matches!(becomes, Labelled) {
                let read = read_points(path.as_ref(), &PointFileOptions::default()).unwrap();
                assert_eq!(read.labels[..4], [1, 2, 3, 1], "{name}");
            }
        }
    }
}

#[test]
fn columns_are_for_bin_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plain.xyz").display().to_string();
    fs::write(&path, "1 2 3\n").unwrap();
    let (found, errors) = quantized(&path, &["--columns", "5"]);
    assert!(
        found.is_none() && errors.contains("--columns is for .bin files"),
        "{errors}"
    );
    let (_, errors) = quantized(&path, &["--columns", "2"]);
    assert!(errors.contains("3 to 64"), "{errors}");
}
