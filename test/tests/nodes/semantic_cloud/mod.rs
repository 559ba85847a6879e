//! Depth and label images to labelled clouds.

mod compressed;
mod hostile;
mod network;
mod pairs;
mod scene;

use std::collections::BTreeSet;
use std::sync::Arc;

use lattice_msgs::sensor_msgs::{CameraInfo, Image, PointCloud2};
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};
use lattice_nodes::semantic_cloud::{Camera, CloudOptions, CloudOutput, SemanticCloud, Stream};
use lattice_runtime::params::{ParamValue, Params};

use self::scene::{Form, HEIGHT, WIDTH, camera_info, depth, labels, points};

const PIXELS: u64 = WIDTH as u64 * HEIGHT as u64;
const CAMERAS: [(&str, &[f64]); 4] = [
    ("plumb_bob", &[0.0; 5]),
    ("plumb_bob", &[-0.12, 0.03, 0.002, -0.001, 0.0]),
    (
        "rational_polynomial",
        &[0.4, -2.6, 0.0004, 0.0001, 1.5, 0.3, -2.4, 1.4],
    ),
    ("equidistant", &[0.02, -0.01, 0.003, -0.001]),
];

fn options(params: &[(&str, &str)]) -> CloudOptions {
    let values = params.iter().map(|(name, text)| {
        let value = ParamValue::from_yaml_text(text).unwrap();
        (*name, value)
    });
    CloudOptions::from_params(&Params::from_values("/node", values)).unwrap()
}

fn clouds(outputs: Vec<CloudOutput>) -> Vec<PointCloud2> {
    let cloud = |output| match output {
        CloudOutput::Points(points) => Some(points),
        CloudOutput::LabelInfo(_) => None,
    };
    outputs.into_iter().filter_map(cloud).collect()
}

/// The cloud of one depth image with labels `shrink` times smaller.
fn one_cloud(
    machine: &mut SemanticCloud,
    info: &CameraInfo,
    shrink: u32,
    [of_depth, of_labels]: [Form; 2],
) -> PointCloud2 {
    let camera = Camera::new(info, false).unwrap();
    assert!(machine.on_camera_info(Arc::new(info.clone())).is_empty());
    let labels = labels(&camera, 7, shrink, of_labels);
    assert!(
        machine
            .on_image(Stream::Labels, Arc::new(labels))
            .is_empty()
    );
    let depth = depth(&camera, 7, of_depth);
    let mut clouds = clouds(machine.on_image(Stream::Depth, Arc::new(depth)));
    assert_eq!(clouds.len(), 1, "{:?}", machine.problem());
    clouds.remove(0)
}

#[test]
fn points_lie_on_what_was_rendered_and_have_its_labels() {
    for (model, d) in CAMERAS {
        let info = camera_info(model, d);
        let camera = Camera::new(&info, false).unwrap();
        for (of_depth, of_labels, is_bigendian, padding, shrink) in [
            ("32FC1", "mono8", false, 0, 1),
            ("16UC1", "mono16", true, 6, 1),
            ("32FC1", "32SC1", true, 8, 2),
            ("16UC1", "16UC1", false, 3, 2),
            ("32FC1", "8UC1", false, 5, 2),
        ] {
            let form = |encoding| Form {
                encoding,
                is_bigendian,
                padding,
            };
            let mut machine = SemanticCloud::new(CloudOptions::default());
            let forms = [form(of_depth), form(of_labels)];
            let cloud = one_cloud(&mut machine, &info, shrink, forms);
            assert_eq!(cloud.header.frame_id, "camera");
            assert_eq!(cloud.header.stamp.to_ns(), 7);
            let points = points(&cloud);
            for point in &points {
                let range_m = point.place_m.norm();
                let (off_m, label) = point.truth(&camera, shrink);
                assert!(off_m < 1e-3 + 1e-3 * range_m, "{model} {of_depth}: {off_m}");
                assert_eq!((point.label, point.confidence), (label, 1.0));
            }
            let counts = &machine.counts().points;
            assert_eq!(counts.pixels, PIXELS);
            assert_eq!(counts.points + counts.pixels_at_edges, PIXELS, "{counts:?}");
            assert_eq!(points.len() as u64, counts.points);
            assert!((100..2000).contains(&counts.pixels_at_edges), "{counts:?}");
            for class in 1..=3 {
                assert!(points.iter().filter(|p| p.label == class).count() > 500);
            }
        }
    }
}

#[test]
fn points_are_seen_at_the_pixels_that_they_come_from() {
    for (model, d) in CAMERAS {
        let info = camera_info(model, d);
        let camera = Camera::new(&info, false).unwrap();
        let mut machine = SemanticCloud::new(options(&[("edge_jump", "0.0")]));
        let forms = [Form::plain("32FC1"), Form::plain("mono8")];
        let cloud = one_cloud(&mut machine, &info, 1, forms);
        let points = points(&cloud);
        assert_eq!(points.len() as u64, PIXELS);
        for (point, i) in points.iter().zip(0_u32..) {
            let [column, row] = camera.project(point.place_m.into());
            let off = (column - f64::from(i % WIDTH)).hypot(row - f64::from(i / WIDTH));
            assert!(off < 1e-3, "{model}: {off} pixels");
        }
    }
}

#[test]
fn rectified_images_go_by_the_projection_alone() {
    let mut info = camera_info("thin_prism", &[9.0; 12]);
    info.k = [0.0; 9];
    let mut machine = SemanticCloud::new(options(&[("rectified", "true")]));
    machine.on_camera_info(Arc::new(info));
    assert!(machine.has_camera());
    let straight = camera_info("plumb_bob", &[]);
    let forms = [Form::plain("32FC1"), Form::plain("mono8")];
    let by_k = one_cloud(
        &mut SemanticCloud::new(CloudOptions::default()),
        &straight,
        1,
        forms,
    );
    let camera = Camera::new(&straight, false).unwrap();
    machine.on_image(Stream::Depth, Arc::new(depth(&camera, 7, forms[0])));
    let out = machine.on_image(Stream::Labels, Arc::new(labels(&camera, 7, 1, forms[1])));
    assert_eq!(clouds(out), [by_k]);
}

#[test]
fn ranges_strides_and_holes_leave_pixels_out() {
    let params = [
        ("stride", "4"),
        ("min_range_m", "1.5"),
        ("max_range_m", "3.0"),
    ];
    let mut machine = SemanticCloud::new(options(&params));
    let info = camera_info("plumb_bob", &[]);
    let camera = Camera::new(&info, false).unwrap();
    machine.on_camera_info(Arc::new(info));
    let labels = labels(&camera, 0, 1, Form::plain("mono8"));
    machine.on_image(Stream::Labels, Arc::new(labels));
    let mut image = depth(&camera, 0, Form::plain("32FC1"));
    for (i, bad) in [f32::NAN, f32::INFINITY, 0.0, -1.0].into_iter().enumerate() {
        image.data[16 * i..16 * i + 4].copy_from_slice(&bad.to_le_bytes());
    }
    let clouds = clouds(machine.on_image(Stream::Depth, Arc::new(image)));
    let points = points(&clouds[0]);
    assert!(points.len() > 50);
    assert!(
        points
            .iter()
            .all(|p| (1.5..=3.0).contains(&p.place_m.norm()))
    );
    let counts = &machine.counts().points;
    assert_eq!((counts.pixels, counts.pixels_no_depth), (PIXELS / 16, 4));
    let left_out = counts.pixels_at_edges + counts.pixels_out_of_range + 4;
    assert_eq!(left_out + counts.points, counts.pixels);
}

#[test]
fn pixels_that_the_distortion_does_not_reach_are_counted() {
    let mut machine = SemanticCloud::new(options(&[]));
    let straight = Camera::new(&camera_info("plumb_bob", &[]), false).unwrap();
    // The image ends before its corners.
    machine.on_camera_info(Arc::new(camera_info(
        "plumb_bob",
        &[-0.9, 0.0, 0.0, 0.0, 0.0],
    )));
    let labels = labels(&straight, 0, 1, Form::plain("mono8"));
    machine.on_image(Stream::Labels, Arc::new(labels));
    let depth = depth(&straight, 0, Form::plain("32FC1"));
    let clouds = clouds(machine.on_image(Stream::Depth, Arc::new(depth)));
    let counts = &machine.counts().points;
    assert!(counts.pixels_no_ray > 0, "{counts:?}");
    let left_out = counts.pixels_no_depth + counts.pixels_at_edges + counts.pixels_out_of_range;
    assert_eq!(
        left_out + counts.pixels_no_ray + counts.points,
        counts.pixels
    );
    assert_eq!(points(&clouds[0]).len() as u64, counts.points);
}

#[test]
fn classes_are_ignored_grouped_and_named() {
    let params = [
        ("ignored_labels", "[1]"),
        ("group_labels", "[2, 40, 3, 40]"),
    ];
    let mut machine = SemanticCloud::new(options(&params));
    let named = |class_id, class_name: &str| VisionClass {
        class_id,
        class_name: class_name.to_owned(),
    };
    let class_map = vec![
        named(1, "floor"),
        named(2, "wall"),
        named(3, "panel"),
        named(40, "upright"),
        named(41, "sky"),
    ];
    let info = LabelInfo {
        class_map,
        ..LabelInfo::default()
    };
    let told = machine.on_label_info(Arc::new(info.clone()));
    let expected = LabelInfo {
        class_map: vec![named(40, "upright"), named(41, "sky")],
        ..info
    };
    assert_eq!(told, [CloudOutput::LabelInfo(expected)]);
    let forms = [Form::plain("32FC1"), Form::plain("mono8")];
    let cloud = one_cloud(&mut machine, &camera_info("plumb_bob", &[]), 1, forms);
    let points = points(&cloud);
    let of = |label| points.iter().filter(|p| p.label == label).count() as u64;
    assert!(of(40) > 1000 && of(u16::MAX) > 1000);
    assert_eq!(of(40) + of(u16::MAX), points.len() as u64);
    assert_eq!(machine.counts().points.points_unlabelled, of(u16::MAX));
}

#[test]
fn confidences_come_along_and_weak_labels_are_none() {
    let mut machine = SemanticCloud::new(options(&[("use_confidence", "true")]));
    machine.on_label_info(Arc::new(LabelInfo {
        threshold: 0.5,
        ..LabelInfo::default()
    }));
    let info = camera_info("plumb_bob", &[]);
    let camera = Camera::new(&info, false).unwrap();
    machine.on_camera_info(Arc::new(info));
    let labels = Arc::new(labels(&camera, 0, 1, Form::plain("mono8")));
    assert!(machine.on_image(Stream::Labels, labels).is_empty());
    let depth = Arc::new(depth(&camera, 3, Form::plain("32FC1")));
    assert!(machine.on_image(Stream::Depth, depth).is_empty());
    // Left half 0.2, right half 0.8, of half the size.
    let half = WIDTH / 2;
    let confident = |i: u32| if i % half < half / 2 { 51.0 } else { 204.0 };
    let numbers: Vec<f64> = (0..half * HEIGHT / 2).map(confident).collect();
    let confidence = Form::plain("mono8").image(0, half, &numbers);
    machine.on_image(Stream::Confidence, Arc::new(confidence));
    let clouds = clouds(machine.finish());
    let counts = machine.counts();
    assert_eq!(
        (counts.depth_in, counts.labels_in, counts.confidence_in),
        (1, 1, 1)
    );
    for point in points(&clouds[0]) {
        let is_left = camera.project(point.place_m.into())[0] < f64::from(half) - 0.5;
        assert_eq!(point.label == u16::MAX, is_left);
        let expected = if is_left { 0.0 } else { 0.8 };
        assert!((point.confidence - expected).abs() < 1e-6);
    }
}

#[test]
fn masks_of_colours_give_the_cloud_of_their_numbers() {
    let info = camera_info("plumb_bob", &[]);
    let camera = Camera::new(&info, false).unwrap();
    let numbers = labels(&camera, 7, 1, Form::plain("mono8"));
    let known: BTreeSet<u8> = numbers.data.iter().copied().collect();
    assert!(known.len() > 2);
    // Class 0 has no colour.
    let palette = known.iter().filter(|class| **class > 0);
    let palette: Vec<String> = palette
        .map(|class| format!("{class}, 0, 200, {class}"))
        .collect();
    let palette = format!("[{}]", palette.join(", "));
    let colors = numbers.data.iter().flat_map(|class| [*class, 0, 200]);
    let mask = Image {
        encoding: "rgb8".to_owned(),
        step: 3 * numbers.width,
        data: colors.collect::<Vec<_>>().into(),
        ..numbers.clone()
    };
    let cloud = |params: &[(&str, &str)], image: Image| {
        let mut machine = SemanticCloud::new(options(params));
        machine.on_camera_info(Arc::new(info.clone()));
        machine.on_image(Stream::Labels, Arc::new(image));
        let depth = depth(&camera, 7, Form::plain("32FC1"));
        let clouds = clouds(machine.on_image(Stream::Depth, Arc::new(depth)));
        (clouds, machine.problem().map(str::to_owned))
    };
    let (expected, _) = cloud(&[("ignored_labels", "[0]")], numbers);
    let (found, _) = cloud(&[("palette_rgb_class", &palette)], mask.clone());
    assert_eq!(found, expected);
    assert_eq!(found.len(), 1);
    let (found, problem) = cloud(&[], mask);
    assert!(found.is_empty());
    assert!(
        problem
            .unwrap()
            .contains("colours need `palette_rgb_class`")
    );
}
