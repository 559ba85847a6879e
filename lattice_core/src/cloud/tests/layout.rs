use super::{F32, F64, field};
use crate::cloud::{CloudError, CloudLayout, CloudLimits, PointField};

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

fn refused(change: impl FnOnce(&mut CloudLayout), bytes: usize) -> CloudError {
    let mut changed = layout();
    change(&mut changed);
    changed
        .view(&vec![0; bytes], &LIMITS)
        .map(|view| view.len())
        .unwrap_err()
}

#[test]
fn every_scalar_type_is_read_in_both_byte_orders() {
    for big in [false, true] {
        let order = |mut bytes: Vec<u8>| {
            if big {
                bytes.reverse();
            }
            bytes
        };
        let cases: [(u8, Vec<u8>, f64); 8] = [
            (1, (-5_i8).to_le_bytes().to_vec(), -5.0),
            (2, 250_u8.to_le_bytes().to_vec(), 250.0),
            (3, (-300_i16).to_le_bytes().to_vec(), -300.0),
            (4, 60_000_u16.to_le_bytes().to_vec(), 60_000.0),
            (5, (-70_000_i32).to_le_bytes().to_vec(), -70_000.0),
            (6, 4_000_000_000_u32.to_le_bytes().to_vec(), 4.0e9),
            (7, 0.5_f32.to_le_bytes().to_vec(), 0.5),
            (8, 0.1_f64.to_le_bytes().to_vec(), 0.1),
        ];
        for (datatype, bytes, expected) in cases {
            let mut one = layout();
            one.width = 1;
            one.height = 1;
            one.point_step = 24;
            one.row_step = 24;
            one.is_bigendian = big;
            one.fields.push(field("value", 13, datatype));
            let mut data = vec![0; 24];
            let bytes = order(bytes);
            data[13..13 + bytes.len()].copy_from_slice(&bytes);
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
        assert_eq!(view.point_times(0, &Default::default()), Ok(None));
    }
}

#[test]
fn lies_about_the_extent_are_refused() {
    assert_eq!(
        refused(|l| l.row_step = 31, 64),
        CloudError::RowStep {
            row_step: 31,
            width: 2,
            point_step: 16,
            needed: 32
        }
    );
    assert_eq!(
        refused(|_| (), 63),
        CloudError::ShortData {
            bytes: 63,
            height: 2,
            row_step: 32,
            needed: 64
        }
    );
    assert_eq!(
        refused(|l| l.point_step = 0, 64),
        CloudError::PointStep { points: 4 }
    );
    assert_eq!(
        refused(
            |l| {
                l.width = u32::MAX;
                l.height = u32::MAX;
            },
            64
        ),
        CloudError::TooManyPoints {
            points: u64::from(u32::MAX) * u64::from(u32::MAX),
            max_points: 1000
        }
    );
    // width * point_step and height * row_step overflow 32 bits.
    assert!(matches!(
        refused(
            |l| {
                l.width = 1000;
                l.height = 1;
                l.point_step = u32::MAX;
            },
            64
        ),
        CloudError::RowStep {
            needed: 4_294_967_295_000,
            ..
        }
    ));
    assert!(matches!(
        refused(|l| l.row_step = u32::MAX, 64),
        CloudError::ShortData {
            needed: 8_589_934_590,
            ..
        }
    ));
}

#[test]
fn lies_about_the_fields_are_refused() {
    let with = |field: PointField| move |l: &mut CloudLayout| l.fields.push(field);
    for datatype in [0, 9, 255] {
        assert!(matches!(
            refused(with(field("a", 0, datatype)), 64),
            CloudError::UnknownDatatype { datatype: d, .. } if d == datatype
        ));
    }
    assert!(matches!(
        refused(
            with(PointField {
                count: 0,
                ..field("a", 0, F32)
            }),
            64
        ),
        CloudError::CountZero { .. }
    ));
    assert!(matches!(
        refused(with(field("a", 13, F32)), 64),
        CloudError::BeyondPoint {
            end: 17,
            point_step: 16,
            ..
        }
    ));
    assert!(matches!(
        refused(
            with(PointField {
                count: u32::MAX,
                ..field("a", u32::MAX, F64)
            }),
            64
        ),
        CloudError::BeyondPoint { .. }
    ));
    assert!(matches!(
        refused(with(field("y", 12, F32)), 64),
        CloudError::Duplicate { .. }
    ));
    assert!(matches!(
        refused(
            |l| l.fields = (0..300).map(|i| field(&i.to_string(), 0, F32)).collect(),
            64
        ),
        CloudError::TooManyFields { fields: 300, .. }
    ));
}

#[test]
fn coordinates_must_be_alike_and_real() {
    let missing = refused(|l| drop(l.fields.remove(1)), 64);
    assert_eq!(
        missing.to_string(),
        "cloud has no field 'y'; its fields are x, z"
    );
    assert!(matches!(
        refused(
            |l| l.fields = vec![field("x", 0, F32), field("y", 4, F32), field("z", 8, F64)],
            64
        ),
        CloudError::CoordinateTypes {
            x: "FLOAT32",
            z: "FLOAT64",
            ..
        }
    ));
    assert!(matches!(
        refused(|l| l.fields.iter_mut().for_each(|f| f.datatype = 5), 64),
        CloudError::CoordinateTypes { x: "INT32", .. }
    ));
    assert!(matches!(
        refused(|l| l.fields[2].count = 2, 64),
        CloudError::CoordinateCount {
            field: "z",
            count: 2
        }
    ));
}

#[test]
fn foreign_names_are_cut_in_errors() {
    let long = "n".repeat(100_000);
    let error = refused(
        move |l| l.fields = vec![field(&long, 0, F32), field("y", 0, F32)],
        64,
    );
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

    let mut copied = vec![9];
    view.copy_field(&probabilities, 0, &mut copied);
    view.copy_field(&probabilities, 1, &mut copied);
    let little = [0x0102_u16, 0x0304, 0x0506].map(u16::to_le_bytes).concat();
    assert_eq!(copied, [&[9], &little[..], &[0; 6]].concat());
    probabilities.count = u32::MAX;
    view.copy_field(&probabilities, 0, &mut copied);
    assert_eq!(copied.len(), 13, "a field of another cloud");
}
