//! Labels of a network inside of the node, with colours and probabilities.

use std::sync::Arc;

use lattice_lab::simulate::house::HouseScan;
use lattice_msgs::sensor_msgs::Image;
use lattice_nodes::convert::semantic::{SemanticOptions, semantic_from_message};
use lattice_nodes::headset_cloud::HeadsetOutput;
use lattice_nodes::semantic_cloud::{LabelSet, Share, SoftLabels};

use super::scene::{image, machine, square};

/// Labels of the left and the right half of a view, of which the network knows half the columns.
fn halves(stamp_ns: i64) -> LabelSet {
    let [width, height] = HouseScan::PIXELS;
    let is_left = |i: usize| i % width < width / 2;
    let labels: Vec<u16> = (0..width * height).map(|i| u16::from(is_left(i))).collect();
    let labels = image(stamp_ns, width, &labels);
    let colors = Image {
        encoding: "bgr8".to_owned(),
        step: 3 * width as u32,
        data: [9, 100, 200].repeat(width * height).into(),
        ..Image::clone(&labels)
    };
    let pixel = |best: u16| {
        let rest = [Share::new(1 - best, 0.25), Share::NONE, Share::NONE];
        let [a, b, c] = rest;
        [Share::new(best, 0.75), a, b, c]
    };
    LabelSet {
        colors: Some(Arc::new(colors)),
        soft: SoftLabels::new([2, 1], 2, vec![pixel(1), pixel(0)]).map(Arc::new),
        ..LabelSet::new(labels)
    }
}

#[test]
fn points_of_the_mesh_have_the_colours_and_probabilities_of_their_pixels() {
    let mut machine = machine(&[]);
    machine.on_mesh(&Arc::new(square()));
    let found = machine.on_labelled(halves(2_000_000_000));
    let [HeadsetOutput::Points(cloud)] = &found[..] else {
        panic!("{found:?}, {:?}", machine.problem());
    };
    let names: Vec<_> = cloud
        .fields
        .iter()
        .map(|field| field.name.as_str())
        .collect();
    let expected = "x y z rgb label confidence vp_x vp_y vp_z label_probs";
    assert_eq!(names.join(" "), expected);
    let (read, _) = semantic_from_message(cloud, &SemanticOptions::default()).unwrap();
    assert!(read.len() > 1000);
    for (i, record) in cloud.data.chunks(cloud.point_step as usize).enumerate() {
        // Left is +y.
        let best = u16::from(read.points_m[i].y > 0.0);
        let shares: Vec<_> = read.label(i).iter().collect();
        assert_eq!([shares[0].0, shares[1].0], [best, 1 - best]);
        assert!((shares[0].1 - 0.75).abs() < 1e-4);
        assert_eq!(record[12..16], [9, 100, 200, 0]);
    }
    assert_eq!(machine.counts().labels_in, 1);
    assert_eq!(machine.counts().clouds_without_probs, 0);
}

#[test]
fn labels_of_a_network_wait_for_pose_and_mesh_as_those_of_a_topic() {
    let mut machine = machine(&[("queue_size", "1")]);
    assert!(machine.on_labelled(halves(1_500_000_000)).is_empty());
    assert!(machine.on_labelled(halves(2_500_000_000)).is_empty());
    assert_eq!(machine.counts().dropped["labels_no_mesh"], 1);
    assert_eq!(machine.counts().clouds_out, 0);
    machine.on_mesh(&Arc::new(square()));
    assert_eq!(machine.counts().clouds_out, 1);
    // After all poses: the next ones may tell.
    assert!(machine.on_labelled(halves(3_500_000_000)).is_empty());
    assert_eq!(machine.waiting()[0], 1);
}
