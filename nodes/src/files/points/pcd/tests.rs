//! PCD files written by hand.

use super::*;

type Read = Result<(PointFormat, Vec<[f64; 3]>), String>;

fn pcd(bytes: impl Into<Vec<u8>>) -> Read {
    let mut points = Collector::new(1000);
    let mut source = Source::new(Box::new(std::io::Cursor::new(bytes.into())));
    let format = read(&mut source, &mut points).map_err(|error| error.to_string())?;
    Ok((format, points.points_m))
}

/// Bytes of a point: 3 + 4 + 8 + 2 x 2 + 4.
const HEADER: &str = "# .PCD v.7 - Point Cloud Data file format\nVERSION .7\n\
    FIELDS _ z x normal y\nSIZE 1 4 8 2 4\nTYPE U F F I F\nCOUNT 3 1 1 2 1\n\
    WIDTH 1\nHEIGHT 2\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\n";

fn points() -> Vec<[f64; 3]> {
    vec![[0.1, -7.0, 1.5], [1e9, 8.0, -2.25]]
}

/// The five fields of a point.
fn fields([x, y, z]: [f64; 3]) -> [Vec<u8>; 5] {
    [
        vec![1, 2, 3],
        (z as f32).to_le_bytes().into(),
        x.to_le_bytes().into(),
        vec![4, 5, 6, 7],
        (y as f32).to_le_bytes().into(),
    ]
}

fn compressed() -> Vec<u8> {
    let [a, b] = [points()[0], points()[1]].map(fields);
    let both = a.iter().zip(&b).flat_map(|(a, b)| [a, b]);
    let by_field: Vec<u8> = both.flatten().copied().collect();
    assert_eq!(by_field.len(), 46);
    let mut packed = vec![2, 1, 2, 3, 1 << 5, 2];
    for literal in by_field[6..].chunks(32) {
        packed.push(literal.len() as u8 - 1);
        packed.extend(literal);
    }
    let lengths = [packed.len() as u32, 46].map(u32::to_le_bytes).concat();
    [lengths, packed].concat()
}

fn with(header: &str, data: &str, bytes: &[u8]) -> Read {
    pcd([format!("{header}DATA {data}\n").as_bytes(), bytes].concat())
}

#[test]
fn all_three_kinds_of_data_are_read_past_other_fields() {
    let text = "1 2 3 1.5 0.1 4 5 -7\n\n1 2 3 -2.25 1e9 4 5 8\r\n";
    let binary = points().into_iter().flat_map(fields).flatten();
    for (data, bytes, format) in [
        ("ascii", text.into(), PointFormat::PcdAscii),
        ("binary", binary.collect(), PointFormat::PcdBinary),
        (
            "binary_compressed",
            compressed(),
            PointFormat::PcdBinaryCompressed,
        ),
    ] {
        assert_eq!(with(HEADER, data, &bytes), Ok((format, points())));
    }
}

#[test]
fn count_and_points_may_be_missing() {
    let header = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\n";
    let read = with(header, "ascii", b"nan 2 3");
    assert_eq!(read, Ok((PointFormat::PcdAscii, vec![])));
}

/// Changes of the header, and what the error says.
const WRONG_HEADERS: &str = r#"
    VERSION .7 | VERSION 0.5 | 1: "VERSION 0.5" is not a line of a PCD 0.7 header
    SIZE 1     | SIZE -1 | 3: "-1" is not a number without sign
    COUNT 3 1  | COUNT 3 | 10: FIELDS, SIZE, TYPE and COUNT have 5, 5, 5 and 4 entries, which must agree
    z x        | z X | 10: FIELDS are ["_", "z", "X", "normal", "y"], without all of x, y and z
    TYPE U F   | TYPE U I | 10: z is TYPE I, SIZE 4, COUNT 1, but must be one F of 4 or 8 bytes
    HEIGHT 2   | HEIGHT 3 | 10: POINTS is 2, but WIDTH times HEIGHT is 3
    COUNT 3    | COUNT 18446744073709551615 | 10: a point has 18446744073709551615 bytes, more than 1048576
    WIDTH 1    | | 9: neither POINTS nor WIDTH and HEIGHT are given"#;

#[test]
fn the_truth_about_a_wrong_header_is_told() {
    let header = HEADER.replace("# .PCD v.7 - Point Cloud Data file format\n", "");
    for row in WRONG_HEADERS.trim().lines() {
        let [old, new, message] = row.split('|').map(str::trim).collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let mut header = header.replace(old, new);
        if message.contains("neither") {
            header = header.replace("POINTS 2\n", "");
        }
        let found = with(&header, "ascii", b"").unwrap_err();
        assert_eq!(found, format!("PCD (ascii) file, line {message}"));
    }
    let zip = with(HEADER, "zip", b"").unwrap_err();
    assert!(zip.contains("\"DATA zip\" is not a line"), "{zip}");
    let empty = pcd("\n".repeat(2000)).unwrap_err();
    assert!(empty.contains("no DATA in its first 1000 lines"), "{empty}");
}

#[test]
fn the_truth_about_wrong_data_is_told() {
    let text = |data: &str| with(HEADER, "ascii", data.as_bytes()).unwrap_err();
    let line = "PCD (ascii) file, line 12:";
    assert_eq!(text("1 2"), format!("{line} 2 columns instead of 8"));
    let word = text("1 2 3 q 5 6 7 8");
    assert_eq!(word, format!("{line} column 4 is \"q\", not a number"));
    assert!(text("1 2 3 4 5 6 7 8\n").ends_with("in point 2 of 2"));

    let binary = |data: &[u8]| with(HEADER, "binary", data).unwrap_err();
    assert!(binary(&[0; 45]).ends_with("in point 2 of 2"));

    let good = compressed();
    let packed = |data: &[u8]| with(HEADER, "binary_compressed", data).unwrap_err();
    assert!(packed(&good[..7]).ends_with("in the lengths of the compressed data"));
    let cut = &good[..good.len() - 1];
    assert!(packed(cut).ends_with("in the 48 bytes of compressed data"));
    let mut lie = good.clone();
    lie[4] += 1;
    assert!(packed(&lie).ends_with("47 bytes of data, but 2 points of 23 bytes are 46"));
    let mut back = good.clone();
    back[13] = 3;
    assert!(packed(&back).ends_with("a copy from 4 bytes back, of 3"));
}

#[test]
fn counts_are_not_believed() {
    let header = HEADER.replace("WIDTH 1\n", "WIDTH 9223372036854775808\n");
    let header = header.replace("POINTS 2\n", "");
    let message = with(&header, "binary", b"").unwrap_err();
    assert!(message.contains("18446744073709551615 points or more, but at most 1000"));
}
