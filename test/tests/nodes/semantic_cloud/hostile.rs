//! Images and cameras that are not what they say.

use std::sync::Arc;

use lattice_msgs::sensor_msgs::{CameraInfo, Image};
use lattice_nodes::semantic_cloud::{Camera, CloudOptions, SemanticCloud, Stream};
use proptest::prelude::*;
use serde_bytes::ByteBuf;

use super::scene::{Form, WIDTH, camera_info, depth, labels};
use super::{clouds, one_cloud};

type Spoil = fn(&mut Image);

const SPOILT: [(Stream, &str, &str, Spoil); 9] = [
    (
        Stream::Depth,
        "depth_malformed",
        "bytes, but 120 rows",
        |m| {
            m.data.truncate(1000);
        },
    ),
    (Stream::Depth, "depth_malformed", "step 639", |m| {
        m.step = 639
    }),
    (Stream::Depth, "depth_malformed", "it is empty", |m| {
        m.width = 0
    }),
    (
        Stream::Depth,
        "depth_too_large",
        "2147483648 x 2147483648",
        |m| {
            (m.width, m.height) = (1 << 31, 1 << 31);
        },
    ),
    (
        Stream::Depth,
        "depth_encoding",
        "'rgb8', expected 16UC1 or 32FC1",
        |m| {
            m.encoding = "rgb8".into();
        },
    ),
    (
        Stream::Depth,
        "depth_size",
        "camera_info is of 160 x 120",
        |m| m.height = 60,
    ),
    (
        Stream::Labels,
        "labels_encoding",
        "'32FC1', expected mono8",
        |m| {
            m.encoding = "32FC1".into();
        },
    ),
    (Stream::Labels, "labels_malformed", "step 0", |m| m.step = 0),
    (
        Stream::Labels,
        "labels_malformed",
        "bytes, but 4000000 rows",
        |m| {
            (m.width, m.height, m.step) = (1, 4_000_000, u32::MAX);
        },
    ),
];

type SpoilInfo = fn(&mut CameraInfo);

const SPOILT_INFO: [(&str, &str, SpoilInfo); 6] = [
    (
        "camera_info_not_calibrated",
        "k has no focal lengths",
        |m| m.k = [0.0; 9],
    ),
    ("camera_info_malformed", "not all finite", |m| {
        m.k[2] = f64::NAN
    }),
    ("camera_info_malformed", "3 parameters of plumb_bob", |m| {
        m.d = vec![0.0; 3]
    }),
    ("camera_info_malformed", "not all finite", |m| {
        m.d = vec![f64::INFINITY; 5]
    }),
    ("camera_info_distortion_model", "'omni', expected", |m| {
        m.distortion_model = "omni".into();
    }),
    ("camera_info_cut", "binned or cut", |m| m.roi.width = 7),
];

#[test]
fn bad_images_are_refused_by_name_and_the_next_are_used() {
    let info = camera_info("plumb_bob", &[]);
    let camera = Camera::new(&info, false).unwrap();
    let forms = [Form::plain("32FC1"), Form::plain("mono8")];
    let mut machine = SemanticCloud::new(CloudOptions::default());
    machine.on_camera_info(Arc::new(info.clone()));
    for (stamp_ns, (stream, count, problem, spoil)) in (1..).zip(SPOILT) {
        let before = machine.counts().dropped.get(count).copied().unwrap_or(0);
        let mut images = [
            (Stream::Depth, depth(&camera, stamp_ns, forms[0])),
            (Stream::Labels, labels(&camera, stamp_ns, 1, forms[1])),
        ];
        let spoilt = images.iter_mut().find(|(of, _)| *of == stream);
        spoil(&mut spoilt.unwrap().1);
        for (stream, image) in images {
            assert!(
                machine.on_image(stream, Arc::new(image)).is_empty(),
                "{count}"
            );
        }
        assert_eq!(machine.counts().dropped[count], before + 1, "{count}");
        let said = machine.problem().unwrap();
        assert!(said.contains(problem), "{said}");
        let mut fresh = SemanticCloud::new(CloudOptions::default());
        let expected = one_cloud(&mut fresh, &info, 1, forms);
        machine.finish();
        assert_eq!(one_cloud(&mut machine, &info, 1, forms), expected);
    }
}

#[test]
fn bad_cameras_are_refused_by_name_and_the_next_is_used() {
    let info = camera_info("plumb_bob", &[]);
    let mut machine = SemanticCloud::new(CloudOptions::default());
    for (count, problem, spoil) in SPOILT_INFO {
        let before = machine.counts().dropped.get(count).copied().unwrap_or(0);
        let mut bad = info.clone();
        spoil(&mut bad);
        machine.on_camera_info(Arc::new(bad));
        assert!(!machine.has_camera(), "{problem}");
        assert_eq!(machine.counts().dropped[count], before + 1, "{count}");
        let said = machine.problem().unwrap();
        assert!(said.contains(problem), "{said}");
        machine.on_camera_info(Arc::new(info.clone()));
        assert!(machine.has_camera(), "{problem}");
    }
}

#[test]
fn a_camera_of_another_size_costs_no_memory() {
    let mut info = camera_info("equidistant", &[0.0; 4]);
    let camera = Camera::new(&info, false).unwrap();
    (info.width, info.height) = (1 << 31, 1 << 31);
    let mut machine = SemanticCloud::new(CloudOptions::default());
    machine.on_camera_info(Arc::new(info));
    let labels = labels(&camera, 1, 1, Form::plain("mono8"));
    machine.on_image(Stream::Labels, Arc::new(labels));
    let depth = depth(&camera, 1, Form::plain("32FC1"));
    assert!(machine.on_image(Stream::Depth, Arc::new(depth)).is_empty());
    assert_eq!(machine.counts().dropped["depth_size"], 1);
}

fn numbers() -> impl Strategy<Value = u32> {
    prop_oneof![0..9_u32, 0..700_u32, any::<u32>()]
}

proptest! {
    #[test]
    fn any_header_over_any_bytes_is_a_cloud_or_a_count(
        encoding in prop::sample::select(vec!["32FC1", "16UC1", "mono8", "32SC1", "8UC3", ""]),
        size in [numbers(), numbers(), numbers()],
        is_bigendian in any::<u8>(),
        data in prop::collection::vec(any::<u8>(), 0..2000),
        d in prop::collection::vec(any::<f64>(), 0..9),
        model in prop::sample::select(vec!["plumb_bob", "equidistant", "rational_polynomial"]),
    ) {
        let [width, height, step] = size;
        let image = Arc::new(Image {
            width,
            height,
            step,
            encoding: encoding.to_owned(),
            is_bigendian,
            data: ByteBuf::from(data),
            ..Image::default()
        });
        let mut machine = SemanticCloud::new(CloudOptions::default());
        let mut info = camera_info(model, &d);
        (info.width, info.height) = (width, height);
        machine.on_camera_info(Arc::new(info));
        let labels = Form::plain("mono8").image(0, WIDTH, &[1.0; WIDTH as usize]);
        let mut made = Vec::new();
        for stream in [Stream::Depth, Stream::Labels] {
            made.extend(clouds(machine.on_image(stream, Arc::clone(&image))));
        }
        made.extend(clouds(machine.on_image(Stream::Labels, Arc::new(labels))));
        made.extend(clouds(machine.finish()));
        let counts = machine.counts();
        prop_assert_eq!(counts.clouds_out, made.len() as u64);
        let dropped: u64 = counts.dropped.values().sum();
        prop_assert!(dropped + 2 * counts.clouds_out >= 3);
    }
}
