use std::collections::{BTreeMap, BTreeSet};

use lattice_core::pose::Axes;
use lattice_core::registration::UNLABELED;
use lattice_msgs::sensor_msgs::PointField;
use nalgebra::Point3;

use super::*;
use crate::convert::geometry::header;

/// A cloud of `x y z` in f32 with further fields, one element each.
fn message(fields: &[(&str, u8)], rows: &[([f32; 3], Vec<u8>)]) -> PointCloud2 {
    let size = |datatype: u8| [0, 1, 1, 2, 2, 4, 4, 4, 8][datatype as usize];
    let mut all = cloud::xyz_fields(PointField::FLOAT32, 4);
    let mut offset = 12;
    for (name, datatype) in fields {
        all.push(cloud::field(name, offset, *datatype));
        offset += size(*datatype);
    }
    let mut data = Vec::new();
    for (p, rest) in rows {
        data.extend(p.iter().flat_map(|v| v.to_le_bytes()));
        data.extend(rest);
    }
    cloud::dense_cloud(header("headset_origin", 5), all, offset, rows.len(), data)
}

fn read(message: &PointCloud2, options: &SemanticOptions) -> Vec<Vec<(u16, f32)>> {
    let (cloud, _) = semantic_from_message(message, options).unwrap();
    let labels = (0..cloud.len()).map(|i| cloud.label(i).iter().collect());
    labels.collect()
}

fn with_palette() -> SemanticOptions {
    let palette = [([128, 0, 0], 3), ([0, 128, 0], 4), ([0, 128, 1], 4)];
    SemanticOptions {
        labels: LabelOptions {
            palette: BTreeMap::from(palette),
            ..LabelOptions::default()
        },
        ..SemanticOptions::default()
    }
}

/// As packed into a float by PCL.
fn packed([r, g, b]: Color) -> Vec<u8> {
    vec![b, g, r, 0xff]
}

#[test]
fn labels_of_every_width() {
    let at = [1.0, 2.0, 3.0];
    let options = SemanticOptions::default();
    let bytes = [(at, vec![7_u8]), (at, vec![255])];
    let found = read(&message(&[("label", PointField::UINT8)], &bytes), &options);
    assert_eq!(found, [vec![(7, 1.0)], vec![]]);

    let rows = [300, UNLABELED].map(|label| (at, label.to_le_bytes().to_vec()));
    let found = read(&message(&[("label", PointField::UINT16)], &rows), &options);
    assert_eq!(found, [vec![(300, 1.0)], vec![]]);

    // Instance 9 of class 40, as in SemanticKITTI; and the whole number, which is no class.
    let rows = [(at, 0x0009_0028_u32.to_le_bytes().to_vec())];
    let wide = message(&[("label", PointField::UINT32)], &rows);
    assert_eq!(read(&wide, &options), [vec![(40, 1.0)]]);
    let mut whole = options.clone();
    whole.labels.low_16_bits = false;
    assert_eq!(read(&wide, &whole), [vec![]]);

    let rows = [-1, 12].map(|label: i32| (at, label.to_le_bytes().to_vec()));
    let found = read(&message(&[("label", PointField::INT32)], &rows), &options);
    assert_eq!(found, [vec![], vec![(12, 1.0)]]);
}

#[test]
fn a_confidence_is_a_probability_and_ignored_classes_are_none() {
    let row = |label: u16, c: f32| {
        let rest = [&label.to_le_bytes()[..], &c.to_le_bytes()].concat();
        ([0.0; 3], rest)
    };
    let (label, confidence) = (PointField::UINT16, PointField::FLOAT32);
    let fields = [("label", label), ("confidence", confidence)];
    let rows = [row(5, 0.25), row(5, f32::NAN), row(0, 0.5), row(6, 1.0)];
    let mut options = SemanticOptions::default();
    options.labels.ignored = BTreeSet::from([0]);
    let found = read(&message(&fields, &rows), &options);
    assert_eq!(found, [vec![(5, 0.25)], vec![], vec![], vec![(6, 1.0)]]);
}

#[test]
fn probabilities_in_one_field_or_in_many() {
    let p = [0.1_f32, 0.05, 0.5, 0.0, 0.3, 0.05];
    let rest: Vec<u8> = p.iter().flat_map(|v| v.to_le_bytes()).collect();
    let expected = [vec![(2, 0.5), (4, 0.3), (0, 0.1), (1, 0.05)]];
    let names: Vec<String> = (0..p.len()).map(|k| format!("p_{k}")).collect();
    let fields: Vec<_> = names.iter().map(|n| (&**n, PointField::FLOAT32)).collect();
    let mut many = message(&fields, &[([0.0; 3], rest)]);
    assert_eq!(read(&many, &SemanticOptions::default()), expected);
    many.fields.truncate(4);
    many.fields[3].name = "label_probs".into();
    many.fields[3].count = p.len() as u32;
    assert_eq!(read(&many, &SemanticOptions::default()), expected);
}

#[test]
fn colours_are_classes_by_the_palette() {
    let c = |v: f32| v.to_le_bytes().to_vec();
    let red = packed([128, 0, 0]);
    let rows = [([0.0; 3], [red.clone(), c(0.75)].concat())];
    let names = ["semantic_color", "confidence"];
    let one = message(&names.map(|name| (name, PointField::FLOAT32)), &rows);
    assert_eq!(read(&one, &with_palette()), [vec![(3, 0.75)]]);

    let greens = [packed([0, 128, 0]), packed([0, 128, 1])];
    let rest = [&greens[0], &red, &greens[1], &c(0.25), &c(0.375), &c(0.25)];
    let names =
        "semantic_color1 semantic_color2 semantic_color3 confidence1 confidence2 confidence3";
    let names: Vec<_> = names
        .split(' ')
        .map(|name| (name, PointField::FLOAT32))
        .collect();
    let three = message(&names, &[([0.0; 3], rest.map(Clone::clone).concat())]);
    // Two colours of one class are one label.
    assert_eq!(read(&three, &with_palette()), [vec![(4, 0.5), (3, 0.375)]]);

    let rows = [([0.0; 3], red), ([0.0; 3], packed([1, 2, 3]))];
    let rgb = message(&[("rgb", PointField::FLOAT32)], &rows);
    assert_eq!(read(&rgb, &with_palette()), [vec![(3, 1.0)], vec![]]);
    let (plain, _) = semantic_from_message(&rgb, &SemanticOptions::default()).unwrap();
    assert!(
        plain.labels.is_empty(),
        "a colour means nothing without a palette"
    );
}

#[test]
fn points_that_are_no_places_are_counted_and_axes_are_those_of_ros() {
    let label = |label: u16| label.to_le_bytes().to_vec();
    let rows = [
        ([f32::NAN, 0.0, 0.0], label(1)),
        ([1.0, 2.0, 3.0], label(2)),
        ([1e30, 0.0, 0.0], label(3)),
        ([4.0, 5.0, 6.0], label(UNLABELED)),
    ];
    let options = SemanticOptions {
        axes: Axes::UnityRuf,
        ..SemanticOptions::default()
    };
    let message = message(&[("label", PointField::UINT16)], &rows);
    let (cloud, report) = semantic_from_message(&message, &options).unwrap();
    let expected = [Point3::new(3.0, -1.0, 2.0), Point3::new(6.0, -4.0, 5.0)];
    assert_eq!(cloud.points_m, expected);
    assert_eq!(cloud.label(0).top(), Some(2));
    let expected = SemanticReport {
        points: 4,
        not_finite: 1,
        too_far: 1,
        unlabelled: 1,
    };
    assert_eq!(report, expected);
    let labels = labels_from_message(&message, 10, &options.labels).unwrap();
    assert_eq!(labels, Some(vec![1, 2, 3, UNLABELED]));
}

#[test]
fn what_cannot_be_used_says_why() {
    let required = SemanticOptions {
        require_labels: true,
        max_points: 3,
        ..SemanticOptions::default()
    };
    let refused = |message: &PointCloud2, part: &str| {
        let error = semantic_from_message(message, &required).unwrap_err();
        assert!(error.to_string().contains(part), "{error}");
    };
    let label = [("label", PointField::UINT8)];
    refused(&message(&label, &[]), "no points");
    refused(&message(&[], &[([0.0; 3], vec![])]), "no labels");
    refused(&message(&label, &[([0.0; 3], vec![255])]), "known class");
    let nan = ([f32::NAN; 3], vec![1]);
    refused(&message(&label, &[nan.clone(), nan]), "none of the 2");
    let point = ([0.0; 3], vec![1]);
    refused(&message(&label, &vec![point; 4]), "4");
    let mut short = message(&label, &[([0.0; 3], vec![1])]);
    short.data.truncate(5);
    refused(&short, "5");

    let plain = message(&[], &[([0.0; 3], vec![])]);
    let (cloud, report) = semantic_from_message(&plain, &SemanticOptions::default()).unwrap();
    assert!(cloud.labels.is_empty() && report.unlabelled == 1);
    assert_eq!(
        labels_from_message(&plain, 9, &required.labels).unwrap(),
        None
    );
}

#[test]
fn what_is_written_is_read() {
    let cloud = SemanticCloud {
        points_m: vec![Point3::new(1.5, -2.0, 0.25), Point3::new(0.0, 7.0, 8.0)],
        labels: vec![
            LabelDistribution::from_weights([(9, 0.75), (2, 0.25)]),
            LabelDistribution::UNKNOWN,
        ],
    };
    let message = message_from_semantic(header("map", 3), &cloud);
    let (back, _) = semantic_from_message(&message, &SemanticOptions::default()).unwrap();
    assert_eq!(back.points_m, cloud.points_m);
    assert_eq!(back.label(0).iter().collect::<Vec<_>>(), [(9, 0.75)]);
    assert_eq!(back.label(1), LabelDistribution::UNKNOWN);

    let colors: BTreeSet<Color> = (0..256).map(color_of).collect();
    assert_eq!(colors.len(), 256, "classes have colours of their own");
}
