use nalgebra::Isometry3;
use std::convert::Infallible;

use super::{F32, F64, field};
use crate::cloud::{
    CloudLayout, CloudLimits, PointField, RangeLimits, RecordFormat, TimeSource, transform_records,
};

const LIMITS: CloudLimits = CloudLimits { max_points: 1000 };

/// Two rows of two f32 points, 16 bytes each.
fn layout() -> CloudLayout {
    CloudLayout {
        width: 2,
        height: 2,
        point_step: 16,
        row_step: 32,
        is_bigendian: false,
        fields: vec![field("x", 0, F32), field("y", 4, F32), field("z", 8, F32)],
    }
}

/// Change of a layout.
type Change = fn(&mut CloudLayout);

/// Checks that changes of the honest layout are refused with the words that follow.
fn check_refused(cases: &[(Change, &str)]) {
    for (change, words) in cases {
        let mut changed = layout();
        change(&mut changed);
        let view = changed.view(&[0; 64], &LIMITS);
        let error = view.map(|view| view.len()).unwrap_err().to_string();
        assert!(error.contains(words), "{error} instead of {words}");
    }
}

#[test]
fn every_scalar_type_is_read_in_both_byte_orders() {
    for big in [false, true] {
        let cases: [(u8, &[u8], f64); 11] = [
            (1, &(-5_i8).to_le_bytes(), -5.0),
            (2, &250_u8.to_le_bytes(), 250.0),
            (3, &(-300_i16).to_le_bytes(), -300.0),
            (4, &60_000_u16.to_le_bytes(), 60_000.0),
            (5, &(-70_000_i32).to_le_bytes(), -70_000.0),
            (6, &4_000_000_000_u32.to_le_bytes(), 4.0e9),
            (7, &0.5_f32.to_le_bytes(), 0.5),
            (8, &0.1_f64.to_le_bytes(), 0.1),
            (9, &(-1_i64 << 40).to_le_bytes(), -1_099_511_627_776.0),
            (
                10,
                &(1_u64 << 63).to_le_bytes(),
                9_223_372_036_854_775_808.0,
            ),
            (11, &[1], 1.0),
        ];
        for (datatype, bytes, expected) in cases {
            let mut one = layout();
            (one.width, one.height, one.point_step, one.row_step) = (1, 1, 24, 24);
            one.is_bigendian = big;
            one.fields.push(field("value", 13, datatype));
            let mut data = vec![0; 24];
            let value = &mut data[13..13 + bytes.len()];
            value.copy_from_slice(bytes);
            if big {
                value.reverse();
            }
            let view = one.view(&data, &LIMITS).unwrap();
            assert_eq!(view.scalar(&view.fields()[3], 0), expected);
        }
    }
}

#[test]
fn empty_clouds_are_taken_bare() {
    for (width, height) in [(0, 1), (1, 0), (0, 0), (u32::MAX, 0)] {
        let bare = CloudLayout {
            width,
            height,
            point_step: 0,
            row_step: 0,
            is_bigendian: false,
            fields: Vec::new(),
        };
        let view = bare.view(&[], &LIMITS).unwrap();
        assert!(view.is_empty());
        assert!(view.xyz(0).x.is_nan());
        let times = view.point_times(0, &Default::default()).unwrap();
        assert_eq!((times.times_ns, times.source), (None, TimeSource::Nothing));
    }
}

#[test]
fn lies_about_the_extent_are_refused() {
    check_refused(&[
        (|l| l.row_step = 31, "row_step 31 is shorter"),
        (|l| l.height = 3, "64 bytes, 3 rows of row_step 32 need 96"),
        (|l| l.point_step = 0, "point_step is 0"),
        (|l| l.height = 501, "has 1002 points, above"),
        (|l| (l.width, l.height) = (u32::MAX, u32::MAX), "above"),
        // width * point_step and height * row_step overflow 32 bits.
        (|l| l.point_step = u32::MAX, "= 8589934590"),
        (|l| l.row_step = u32::MAX, "need 4294967327"),
        (
            |l| (l.width, l.height) = (5, 1),
            "row_step 32 is shorter than width 5 * point_step 16",
        ),
    ]);
    // The last row need not be padded.
    for (height, row_step) in [(1, 65), (2, 32), (2, 30)] {
        let mut padded = layout();
        (padded.width, padded.height, padded.row_step) = (1, height, row_step);
        assert!(padded.view(&[0; 48], &LIMITS).is_ok(), "{row_step}");
    }
}

#[test]
fn lies_about_the_fields_are_refused() {
    check_refused(&[
        (|l| l.fields[0].datatype = 0, "'x' has datatype 0"),
        (|l| l.fields[0].datatype = 12, "'x' has datatype 12"),
        (|l| l.fields[0].datatype = 255, "'x' has datatype 255"),
        (|l| l.fields[0].count = 0, "'x' has count 0"),
        (|l| l.fields[0].count = u32::MAX, "'x' ends"),
        (|l| l.fields[0].offset = u32::MAX, "'x' ends"),
        (|l| l.fields[0].offset = 13, "byte 17 of a point of 16"),
        (
            |l| l.fields.push(field("y", 12, F32)),
            "'y' is declared twice",
        ),
        (|l| l.fields = vec![field("x", 0, F32); 300], "300 fields"),
        // Of fields that nobody asks for, too.
        (|l| l.fields.push(field("a", 0, 12)), "'a' has datatype 12"),
        (
            |l| l.fields.push(field("a", 13, F32)),
            "'a' ends at byte 17",
        ),
        (
            |l| {
                let far = field("a", u32::MAX, F64);
                let count = u32::MAX;
                l.fields.push(PointField { count, ..far });
            },
            "'a' ends",
        ),
    ]);
}

#[test]
fn coordinates_must_be_alike_and_real() {
    check_refused(&[
        (
            |l| drop(l.fields.remove(1)),
            "no field 'y'; its fields are x, z",
        ),
        (
            |l| l.fields[2] = field("z", 8, F64),
            "FLOAT32, FLOAT32, FLOAT64",
        ),
        (|l| l.fields[0].datatype = 5, "x, y, z are INT32"),
        (|l| l.fields[1].datatype = 10, "UINT64"),
        (|l| l.fields[1].count = 2, "'y' has count 2"),
    ]);
}

#[test]
fn foreign_names_are_cut_in_errors() {
    let mut long = layout();
    long.fields = vec![field(&"n".repeat(100_000), 0, F32), field("y", 0, F32)];
    let error = long
        .view(&[0; 64], &LIMITS)
        .map(|view| view.len())
        .unwrap_err();
    assert!(error.to_string().len() < 200, "{error}");
}

#[test]
fn fields_of_several_elements_come_in_either_byte_order() {
    let mut row = vec![0_u8; 12];
    let big = [0x0102_u16, 0x0304, 0x0506].map(u16::to_be_bytes).concat();
    row.extend_from_slice(&big);
    row.extend_from_slice(&0x7f80_1020_u32.to_be_bytes());
    let mut probabilities = field("p", 12, 4);
    probabilities.count = 3;
    let color = field("rgb", 18, F32);
    let layout = CloudLayout {
        width: 1,
        height: 1,
        point_step: 22,
        row_step: 22,
        is_bigendian: true,
        fields: vec![
            field("x", 0, F32),
            field("y", 4, F32),
            field("z", 8, F32),
            probabilities.clone(),
            color.clone(),
        ],
    };
    let view = layout.view(&row, &CloudLimits::default()).unwrap();
    let elements = [0, 1, 2].map(|n| view.element(&probabilities, 0, n));
    assert_eq!(elements, [258.0, 772.0, 1286.0]);
    assert!(view.element(&probabilities, 0, 3).is_nan());
    assert!(view.element(&probabilities, 1, 0).is_nan());
    // A packed colour is no number: as a float this one is not even finite.
    assert_eq!(view.packed(&color, 0), Some(0x7f80_1020));
    assert_eq!(view.packed(&color, 1), None);
    assert_eq!(view.packed(&probabilities, 0), None);

    let name = probabilities.name.clone();
    let format = RecordFormat::new(
        &view,
        &[name.clone(), name, "of another".into()],
        None,
        false,
    );
    let range = RangeLimits {
        min_range_m: -1.0,
        ..RangeLimits::default()
    };
    let still = |_| Ok::<_, Infallible>(Isometry3::identity());
    let records = transform_records(&view, 0, None, &range, &format, still).unwrap();
    let little = [0x0102_u16, 0x0304, 0x0506].map(u16::to_le_bytes).concat();
    assert_eq!(records.data.get(12..), Some(&little[..]));
}

/// Mends a change of the honest layout and gives the notes, after checking that 4 points are read.
fn mended(change: Change, bytes: usize) -> Vec<String> {
    let mut changed = layout();
    change(&mut changed);
    let notes = changed.mend(bytes);
    let data = vec![0; bytes];
    assert_eq!(changed.view(&data, &LIMITS).unwrap().len(), 4);
    assert_eq!(changed.mend(bytes), [], "mended twice");
    notes.iter().map(ToString::to_string).collect()
}

#[test]
fn fields_that_cannot_be_read_are_left_out_with_a_note() {
    assert!(mended(|_| {}, 64).is_empty());
    let cases: [(Change, &str); 5] = [
        (|l| l.fields.push(field("a", 12, 77)), "'a' has datatype 77"),
        (
            |l| l.fields.push(field("a", 13, F32)),
            "'a' ends at byte 17",
        ),
        (
            |l| l.fields.push(field("x", 4, F32)),
            "'x' is declared twice",
        ),
        (
            |l| l.fields.insert(0, field("", 20, 1)),
            "'' ends at byte 21",
        ),
        (|l| l.fields[2].count = 0, "'z' has count 0, read as 1"),
    ];
    for (change, words) in cases {
        let notes = mended(change, 64);
        assert!(notes.len() == 1 && notes[0].contains(words), "{notes:?}");
    }
    let mut fields = layout();
    fields.fields[1].offset = 13;
    assert_eq!(fields.mend(64), []);
    assert!(fields.view(&[0; 64], &LIMITS).is_err(), "a coordinate");
}

#[test]
fn extents_are_mended_where_the_data_leave_no_doubt() {
    let cases: [(Change, &str); 5] = [
        (
            |l| l.row_step = 0,
            "row_step is 0, read as width * point_step = 32",
        ),
        (|l| l.row_step = 16, "row_step is 16"),
        (|l| l.row_step = u32::MAX, "row_step is 4294967295"),
        (
            |l| (l.width, l.height, l.row_step) = (4, 1, 16),
            "read as width * point_step = 64",
        ),
        (
            |l| (l.width, l.height, l.row_step) = (4, 0, 64),
            "height is 0, read as 1: data has 4 points",
        ),
    ];
    for (change, words) in cases {
        let notes = mended(change, 64);
        assert!(notes.len() == 1 && notes[0].contains(words), "{notes:?}");
    }
    // Neither short data nor data behind rows of an unknown step leave no doubt.
    for (row_step, bytes) in [(0, 63), (16, 80), (0, 65)] {
        let mut doubtful = layout();
        doubtful.row_step = row_step;
        assert_eq!(doubtful.mend(bytes), [], "{row_step}");
        assert!(doubtful.view(&vec![0; bytes], &LIMITS).is_err());
    }
    let mut none = layout();
    (none.width, none.height) = (0, 2);
    let notes = none.mend(64);
    assert!(
        notes[0].to_string().contains("0 points, but data has 64"),
        "{notes:?}"
    );
}
