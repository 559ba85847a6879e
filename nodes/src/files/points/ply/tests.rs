//! PLY files written by hand.

use super::*;

type Read = Result<(PointFormat, Vec<[f64; 3]>), String>;

fn ply(bytes: impl Into<Vec<u8>>) -> Read {
    let mut points = Collector::new(1000);
    let mut source = Source::new(Box::new(std::io::Cursor::new(bytes.into())));
    let format = read(&mut source, &mut points).map_err(|error| error.to_string())?;
    Ok((format, points.points_m))
}

const HEADER: &str = "comment by hand\nobj_info x\n\
    element camera 2\nproperty uchar id\nproperty list uchar short trail\n\
    element light 2\nproperty double watt\n\
    element empty 18446744073709551615\n\
    element vertex 2\nproperty ushort label\nproperty list uint double weights\n\
    property float z\nproperty double x\nproperty int y\nproperty float32 intensity\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n";

fn points() -> Vec<[f64; 3]> {
    vec![[0.1, -7.0, 1.5], [1e9, 8.0, -2.25]]
}

/// The data of `HEADER` with both lists of weights.
fn binary(number: impl Fn(&mut Vec<u8>, &[u8])) -> Vec<u8> {
    let mut data = vec![];
    for trail in [&[][..], &[3_i16, -4, 5]] {
        data.extend([9, trail.len() as u8]);
        for t in trail {
            number(&mut data, &t.to_le_bytes());
        }
    }
    number(&mut data, &60_f64.to_le_bytes());
    number(&mut data, &75_f64.to_le_bytes());
    for (point, weights) in points().iter().zip([&[0.5, 0.5][..], &[]]) {
        number(&mut data, &513_u16.to_le_bytes());
        number(&mut data, &(weights.len() as u32).to_le_bytes());
        for w in weights {
            number(&mut data, &f64::to_le_bytes(*w));
        }
        number(&mut data, &(point[2] as f32).to_le_bytes());
        number(&mut data, &point[0].to_le_bytes());
        number(&mut data, &(point[1] as i32).to_le_bytes());
        number(&mut data, &0.25_f32.to_le_bytes());
    }
    data
}

#[test]
fn binary_data_is_read_in_both_byte_orders_past_lists_and_other_elements() {
    let little = |data: &mut Vec<u8>, number: &[u8]| data.extend(number);
    let big = |data: &mut Vec<u8>, number: &[u8]| data.extend(number.iter().rev());
    let of = |name: &str, data: Vec<u8>| {
        let header = format!("ply\nformat {name} 1.0\n{HEADER}").into_bytes();
        ply([header, data].concat())
    };
    let (little, big) = (binary(little), binary(big));
    let format = PointFormat::PlyBinaryLittleEndian;
    assert_eq!(of("binary_little_endian", little), Ok((format, points())));
    let format = PointFormat::PlyBinaryBigEndian;
    assert_eq!(of("binary_big_endian", big), Ok((format, points())));
}

#[test]
fn text_data_is_read_past_lists_and_other_elements() {
    let data =
        "9 0\n9 3 3 -4 5\n60\n75\n513 2 .5 .5 1.5 0.1 -7 .25\n\n513 0 -2.25 1e9 8 .25\n3 0 1 0\n";
    let file = format!("ply\nformat ascii 1.0\n{HEADER}{data}");
    assert_eq!(ply(file.as_bytes()), Ok((PointFormat::PlyAscii, points())));
    let file = file.replace('\n', "\r\n");
    assert_eq!(ply(file), Ok((PointFormat::PlyAscii, points())));
}

/// Files of which every `;` is a new line, and what their error says.
const WRONG_HEADERS: &str = r#"
    plx;                             | line 1: not a PLY file, which starts with "ply"
    ply;format ascii 2.0;            | line 2: "format ascii 2.0" is not a line of a PLY 1.0 header
    ply;format base64 1.0;           | line 2: unknown format "base64"
    ply;end_header;                  | line 2: no line gives the format
    ply;property int x;              | line 2: a property before the first `element` line
    ply;element vertex -1;           | line 2: "-1" is not a number of elements
    ply;element v 1;property half x; | line 3: unknown type "half"
    ply;element v 1;property list float x y; | line 3: unknown type "x"
    ply;element v 1;property list float int x; | line 3: the length of list "x" is a float, not an integer type
    ply;format ascii 1.0;end_header; | line 3: the header has no element vertex"#;

#[test]
fn the_truth_about_a_wrong_header_is_told() {
    for row in WRONG_HEADERS.trim().lines() {
        let (header, message) = row.split_once('|').unwrap();
        let found = ply(header.trim().replace(';', "\n"));
        assert_eq!(found, Err(format!("PLY (ascii) file, {}", message.trim())));
    }
    let list = "property int x\nproperty int y\nproperty list int int z\n";
    let vertex = format!("ply\nformat ascii 1.0\nelement vertex 1\n{list}end_header\n");
    let error = ply(vertex).unwrap_err();
    assert!(
        error.ends_with("line 7: element vertex has no number named z"),
        "{error}"
    );
    let cut = ply("ply\nformat ascii 1.0\n").unwrap_err();
    assert!(
        cut.ends_with("it ends at byte 21, in the header, before end_header"),
        "{cut}"
    );
    assert!(ply(format!("ply\n{}", "comment\n".repeat(10_000))).is_err());
}

const XYZ: &str = "property float x\nproperty float y\nproperty float z\n";

#[test]
fn the_truth_about_wrong_data_is_told() {
    let header = format!("ply\nformat ascii 1.0\nelement vertex 2\n{XYZ}end_header\n");
    for (data, message) in [
        ("1 2", "line 8: the line ends early, in vertex 1 of 2"),
        (
            "1 2 3 4",
            "8: the line has more than the properties of vertex 1 of 2",
        ),
        (
            "1 2 3\n\n1 b 3",
            "10: \"b\" is not a number, in vertex 2 of 2",
        ),
        (
            "1 2 3\n",
            "cut short: it ends at byte 106, in vertex 2 of 2",
        ),
    ] {
        let error = ply(format!("{header}{data}")).unwrap_err();
        assert!(error.ends_with(message), "{error}");
    }
}

#[test]
fn counts_are_not_believed() {
    let binary = |head: &str, data: &[u8]| {
        let header = format!("ply\nformat binary_little_endian 1.0\n{head}end_header\n");
        ply([header.as_bytes(), data].concat()).unwrap_err()
    };
    let vertices = format!("element vertex 18446744073709551615\n{XYZ}");
    assert!(binary(&vertices, &[0; 24]).contains("18446744073709551615 points or more"));
    let vertices = format!("element vertex 1000\n{XYZ}");
    assert!(binary(&vertices, &[0; 30]).ends_with("in vertex 3 of 1000"));
    let rows = format!("element row 18446744073709551615\nproperty double a\n{vertices}");
    assert!(binary(&rows, &[0; 99]).ends_with("in the 18446744073709551615 of row"));
    let lists = format!("element row 9\nproperty list uint double a\n{vertices}");
    assert!(binary(&lists, &[255; 99]).ends_with("in row 1 of 9"));
    let lists = format!("element row 9\nproperty list int double a\n{vertices}");
    assert!(binary(&lists, &[255; 99]).ends_with("a list of length -1 in row 1 of 9"));
}

#[test]
fn labels_come_back_and_wrong_ones_are_refused() {
    let read = |kind: &str, rows: &str| {
        let file = format!(
            "ply\nformat ascii 1.0\nelement vertex 3\n{XYZ}property {kind} label\nend_header\n{rows}"
        );
        let mut points = Collector::new(1000);
        let mut source = Source::new(Box::new(std::io::Cursor::new(file.into_bytes())));
        let read = read(&mut source, &mut points).map_err(|error| error.to_string());
        read.map(|_| (points.points_m, points.labels))
    };
    let (points, labels) = read("ushort", "0 0 1 7\nnan 0 0 8\n0 0 2 65535\n").unwrap();
    assert_eq!(points, [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]);
    assert_eq!(labels, [7, UNLABELED]);
    let (_, labels) = read("int", "0 0 1 -1\n0 0 0 300\n0 0 2 0\n").unwrap();
    assert_eq!(labels, [UNLABELED, 300, 0]);
    for wrong in ["-2", "65536", "0.5", "nan"] {
        let fault = read("float", &format!("0 0 1 1\n0 0 1 {wrong}\n0 0 1 1\n")).unwrap_err();
        let place = fault.contains("vertex 2 of 3");
        assert!(place && fault.contains("not an integer"), "{fault}");
    }
}
