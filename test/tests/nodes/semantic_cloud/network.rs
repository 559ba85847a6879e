//! Labels of a network inside of the node, with colours and probabilities, from the image to map and calibration.

use std::sync::Arc;

use lattice_core::lattice::LatticeKind;
use lattice_core::registration::UNLABELED;
use lattice_msgs::builtin_interfaces::Time;
use lattice_msgs::sensor_msgs::{Image, PointCloud2};
use lattice_nodes::convert::semantic::{LabelOptions, SemanticOptions, semantic_from_message};
use lattice_nodes::enu_transformer::ins::{InsMessage, InsSource};
use lattice_nodes::enu_transformer::{EnuOutput, EnuTransformer, TransformerOptions};
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_nodes::segmenter::{
    Meaning, Network, Normalisation, Scores, Segmenter, SegmenterOptions, Size, Values,
};
use lattice_nodes::semantic_cloud::{
    Camera, CloudOptions, LabelSet, SHARES, SemanticCloud, Share, SoftLabels, Stream,
};
use lattice_test::clouds::{SECOND_NS, odometry};
use lattice_test::maps;
use nalgebra::Isometry3;

use super::scene::{Form, HEIGHT, WIDTH, camera_info, depth, labels};
use super::{clouds, options};

const CLASSES: usize = 5;
const SIZE: Size = Size {
    width: WIDTH as usize,
    height: HEIGHT as usize,
};

/// Gives three quarters to the class that is written in red, and a fifth to the one behind it.
struct Red;

impl Network for Red {
    fn input(&self) -> Size {
        SIZE
    }

    fn names(&self) -> &[String] {
        &[]
    }

    fn run(&self, planes: Vec<f32>) -> Result<Scores, String> {
        let pixels = SIZE.pixels();
        let mut values = vec![0.0125; CLASSES * pixels];
        for (i, red) in planes[..pixels].iter().enumerate() {
            let class = (red * 255.0 / 40.0).round() as usize;
            values[class * pixels + i] = 0.75;
            values[(class + 1) % CLASSES * pixels + i] = 0.2;
        }
        let values = Values::Scores {
            classes: CLASSES,
            values,
        };
        Ok(Scores { size: SIZE, values })
    }
}

/// An image whose red is 40 times the class, and whose green and blue are the pixel's place.
fn colors(camera: &Camera, stamp_ns: i64) -> Image {
    let labels = labels(camera, stamp_ns, 1, Form::plain("mono8"));
    let pixels = labels.data.iter().zip(0_u32..);
    let data = pixels.flat_map(|(class, i)| [40 * class, (i % WIDTH) as u8, (i / WIDTH) as u8]);
    let data: Vec<u8> = data.collect();
    Image {
        encoding: "rgb8".to_owned(),
        step: 3 * WIDTH,
        data: data.into(),
        ..labels
    }
}

fn labelled(camera: &Camera, stamp_ns: i64) -> LabelSet {
    let options = SegmenterOptions {
        normalisation: Normalisation {
            mean: [0.0; 3],
            deviation: [1.0; 3],
        },
        meaning: Meaning::Probabilities,
        with_soft: true,
        ..SegmenterOptions::default()
    };
    let image = Arc::new(colors(camera, stamp_ns));
    let found = Segmenter::new(options, Box::new(Red))
        .on_image(&image)
        .unwrap();
    LabelSet {
        labels: Arc::new(found.labels),
        confidence: found.confidence.map(Arc::new),
        colors: Some(image),
        soft: found.soft.map(Arc::new),
    }
}

fn camera() -> (Camera, SemanticCloud) {
    let info = camera_info("plumb_bob", &[-0.12, 0.03, 0.002, -0.001, 0.0]);
    let camera = Camera::new(&info, false).unwrap();
    let mut machine = SemanticCloud::new(options(&[("group_labels", "[4, 0]")]));
    machine.on_camera_info(Arc::new(info));
    (camera, machine)
}

/// The cloud of a depth image and the labels of its time.
fn one_cloud() -> (Camera, PointCloud2) {
    let (camera, mut machine) = camera();
    assert!(machine.on_labelled(labelled(&camera, 7)).is_empty());
    let depth = Arc::new(depth(&camera, 7, Form::plain("32FC1")));
    let mut found = clouds(machine.on_image(Stream::Depth, depth));
    assert_eq!(found.len(), 1, "{:?}", machine.problem());
    assert_eq!(machine.counts().clouds_without_probs, 0);
    (camera, found.remove(0))
}

#[test]
fn points_have_the_colours_and_probabilities_of_their_pixels() {
    let (camera, cloud) = one_cloud();
    let fields = cloud.fields.iter();
    let fields: Vec<_> = fields
        .map(|f| (f.name.as_str(), f.offset, f.count))
        .collect();
    let expected = [
        ("x", 0, 1),
        ("y", 4, 1),
        ("z", 8, 1),
        ("rgb", 12, 1),
        ("label", 16, 1),
        ("confidence", 18, 1),
        ("label_probs", 22, 4),
    ];
    assert_eq!(fields, expected);
    assert!(cloud.width > 15_000);
    let labels = labels(&camera, 7, 1, Form::plain("mono8"));
    let (read, _) = semantic_from_message(&cloud, &SemanticOptions::default()).unwrap();
    for (i, point) in cloud.data.chunks(cloud.point_step as usize).enumerate() {
        let place = read.points_m[i].coords.into();
        let [column, row] = camera.project(place).map(|v| v.round() as u32);
        let class = labels.data[(row * WIDTH + column) as usize];
        // Blue, green, red, as PCL has it.
        assert_eq!(point[12..16], [row as u8, column as u8, 40 * class, 0]);
        assert_eq!(point[16..18], u16::from(class).to_le_bytes());
        let next = (u16::from(class) + 1) % 4;
        let found: Vec<_> = read.label(i).iter().take(2).collect();
        assert_eq!([found[0].0, found[1].0], [class.into(), next]);
        // Class 4 counts as 0, also in the sum.
        assert!((found[0].1 - 0.75).abs() < 0.02, "{found:?}");
        assert!((found[1].1 - 0.2).abs() < 0.02, "{found:?}");
    }
}

#[test]
fn probabilities_reach_the_map_and_the_calibration() {
    let (_, mut cloud) = one_cloud();
    cloud.header.frame_id = "base_link".to_owned();
    let start_ns = 1_700_000_000 * SECOND_NS;
    cloud.header.stamp = Time::from_ns(start_ns + SECOND_NS / 100);
    let mut transformer = EnuTransformer::new(TransformerOptions::new(InsSource::Odometry));
    for step in 0..10 {
        let stamp_ns = start_ns + step * SECOND_NS / 100;
        let pose = odometry(stamp_ns, &Isometry3::identity());
        transformer.on_ins("ins", InsMessage::Odometry(&pose), stamp_ns);
    }
    let outputs = transformer.on_cloud("points", Arc::new(cloud), start_ns);
    let Some(EnuOutput::Points(enu)) = outputs.last() else {
        panic!("{outputs:?}");
    };
    let probs = enu.fields.iter().find(|field| field.name == "label_probs");
    assert_eq!(probs.map(|field| field.count), Some(4));

    let mut mapper = maps::mapper(MapperOptions {
        labels: Some(LabelOptions::default()),
        ..maps::options(LatticeKind::Cubic, 1e-3)
    });
    mapper.on_cloud(enu).unwrap();
    let map = lattice_core::registration::SemanticCloud::from_voxels(mapper.list());
    let mut seen = [0; CLASSES];
    for i in 0..map.len() {
        let top = map.label(i).top().unwrap_or(UNLABELED);
        seen[usize::from(top)] += 1;
    }
    assert!(seen[1..4].iter().all(|n| *n > 20), "{seen:?}");
    assert_eq!((seen[0], seen[4]), (0, 0));
}

#[test]
fn the_depth_image_that_a_network_is_at_work_on_waits_for_it() {
    let (camera, mut machine) = camera();
    let depth = |stamp_ns| Arc::new(depth(&camera, stamp_ns, Form::plain("32FC1")));
    let period_ns = SECOND_NS / 30;
    assert!(machine.on_begun(3 * period_ns).is_empty());
    for i in 0..20 {
        assert!(
            machine
                .on_image(Stream::Depth, depth(i * period_ns))
                .is_empty()
        );
    }
    assert_eq!(machine.waiting(), 5);
    assert_eq!(machine.counts().dropped["depth_no_partner"], 15);
    let found = clouds(machine.on_labelled(labelled(&camera, 3 * period_ns)));
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].header.stamp.to_ns(), 3 * period_ns);

    // Of stamps that differ a pair is known once the network begins with another image.
    let near_ns = 21 * period_ns;
    assert!(machine.on_begun(near_ns - 3_000_000).is_empty());
    assert!(machine.on_image(Stream::Depth, depth(near_ns)).is_empty());
    for i in 22..40 {
        machine.on_image(Stream::Depth, depth(i * period_ns));
    }
    let labels = labelled(&camera, near_ns - 3_000_000);
    assert!(machine.on_labelled(labels).is_empty());
    let found = clouds(machine.on_begun(40 * period_ns));
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].header.stamp.to_ns(), near_ns);
}

#[test]
fn a_stamp_that_lies_holds_up_one_image_and_no_more() {
    let (camera, mut machine) = camera();
    let depth = |stamp_ns| Arc::new(depth(&camera, stamp_ns, Form::plain("32FC1")));
    assert!(machine.on_image(Stream::Depth, depth(SECOND_NS)).is_empty());
    assert!(machine.on_begun(i64::MAX).is_empty());
    // All stamps before are in the past of that one: what waits leaves, and is counted.
    assert!(machine.on_begun(2 * SECOND_NS).is_empty());
    assert_eq!(machine.counts().dropped["depth_time_jump"], 1);
    for i in 2..40 {
        machine.on_image(Stream::Depth, depth(i * SECOND_NS));
    }
    let found = clouds(machine.on_labelled(labelled(&camera, 2 * SECOND_NS)));
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].header.stamp.to_ns(), 2 * SECOND_NS);
}

#[test]
fn clouds_that_are_too_large_go_without_probabilities() {
    let (camera, mut machine) = camera();
    let pixel = [
        Share::new(1, 0.75),
        Share::new(299, 0.25),
        Share::NONE,
        Share::NONE,
    ];
    assert_eq!(pixel.len(), SHARES);
    let mut set = labelled(&camera, 7);
    // Three hundred classes of a network that sees two pixels.
    set.soft = SoftLabels::new([2, 1], 300, vec![pixel; 2]).map(Arc::new);
    machine.on_labelled(set);
    let depth = Arc::new(depth(&camera, 7, Form::plain("32FC1")));
    let found = clouds(machine.on_image(Stream::Depth, depth));
    assert!(
        found[0]
            .fields
            .iter()
            .all(|field| field.name != "label_probs")
    );
    assert_eq!(machine.counts().clouds_without_probs, 1);
}

#[test]
fn labels_of_a_topic_wait_for_the_colours_of_their_stamp() {
    let info = camera_info("plumb_bob", &[]);
    let camera = Camera::new(&info, false).unwrap();
    let mut machine = SemanticCloud::new(options(&[("use_color", "true")]));
    machine.on_camera_info(Arc::new(info));
    let labels = Arc::new(labels(&camera, 7, 1, Form::plain("mono8")));
    assert!(machine.on_image(Stream::Labels, labels).is_empty());
    let depth = Arc::new(depth(&camera, 7, Form::plain("32FC1")));
    assert!(machine.on_image(Stream::Depth, depth).is_empty());
    let other = Arc::new(colors(&camera, 8));
    assert!(machine.on_image(Stream::Color, other).is_empty());
    let good = colors(&camera, 7);
    for (reason, problem, spoil) in [
        (
            "color_malformed",
            "color: step 479",
            (|m| m.step = 479) as fn(&mut Image),
        ),
        ("color_malformed", "bytes, but 120 rows", |m| {
            m.data.truncate(99)
        }),
        ("color_too_large", "2147483648 x 2147483648", |m| {
            (m.width, m.height) = (1 << 31, 1 << 31);
        }),
        ("color_encoding", "'yuv422'", |m| {
            m.encoding = "yuv422".to_owned()
        }),
    ] {
        let mut bad = good.clone();
        spoil(&mut bad);
        assert!(machine.on_image(Stream::Color, Arc::new(bad)).is_empty());
        assert!(machine.counts().dropped[reason] > 0);
        assert!(machine.problem().unwrap().contains(problem), "{problem}");
    }
    let found = clouds(machine.on_image(Stream::Color, Arc::new(good)));
    let point = &found[0].data[..18];
    assert_eq!(found[0].point_step, 22);
    assert_eq!(point[12..16], [0, 0, 80, 0], "the wall at the first pixel");
    assert_eq!(machine.counts().color_in, 6);
}

#[test]
fn outputs_beyond_the_largest_image_are_refused() {
    let (camera, _) = camera();
    let mut machine = SemanticCloud::new(CloudOptions {
        max_image_pixels: 1000,
        ..CloudOptions::default()
    });
    assert!(machine.on_labelled(labelled(&camera, 7)).is_empty());
    assert_eq!(machine.counts().dropped["labels_too_large"], 1);
}
