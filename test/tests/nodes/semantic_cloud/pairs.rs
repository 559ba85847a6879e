//! Images that belong together by their stamps.

use std::collections::BTreeSet;
use std::sync::Arc;

use lattice_nodes::semantic_cloud::{CloudOptions, SemanticCloud, Stream};
use lattice_test::clouds::SECOND_NS;
use proptest::prelude::*;

use super::scene::{Form, camera_info};
use super::{clouds, options};

const PERIOD_NS: i64 = SECOND_NS / 30;

/// A machine for a camera of 2 x 1 pixels.
fn machine(options: CloudOptions) -> SemanticCloud {
    let mut machine = SemanticCloud::new(options);
    let mut info = camera_info("plumb_bob", &[]);
    (info.width, info.height) = (2, 1);
    machine.on_camera_info(Arc::new(info));
    machine
}

/// Stamp and label of each cloud that an image brings. The label image of a stamp has its `label`.
fn give(machine: &mut SemanticCloud, stream: Stream, stamp_ns: i64, label: u8) -> Vec<(i64, u8)> {
    let form = Form::plain(if stream == Stream::Depth {
        "32FC1"
    } else {
        "mono8"
    });
    let image = form.image(stamp_ns, 2, &[f64::from(label); 2]);
    let made = clouds(machine.on_image(stream, Arc::new(image)));
    made.iter()
        .map(|cloud| (cloud.header.stamp.to_ns(), cloud.data[12]))
        .collect()
}

fn dropped(machine: &SemanticCloud, prefix: &str) -> u64 {
    let dropped = machine.counts().dropped.iter();
    dropped
        .filter(|(name, _)| name.starts_with(prefix))
        .map(|(_, n)| n)
        .sum()
}

#[test]
fn the_nearest_stamp_counts_not_the_first_that_will_do() {
    let mut machine = machine(CloudOptions::default());
    assert_eq!(give(&mut machine, Stream::Depth, 100, 1), []);
    // Nearer to the next depth, which is yet to come.
    assert_eq!(give(&mut machine, Stream::Labels, 120, 5), []);
    assert_eq!(give(&mut machine, Stream::Depth, 125, 1), []);
    assert_eq!(give(&mut machine, Stream::Labels, 150, 6), [(125, 5)]);
    // The first depth has the labels that are left.
    assert_eq!(give(&mut machine, Stream::Depth, 210, 1), [(100, 6)]);
}

#[test]
fn other_stamps_never_pair_where_they_must_be_equal_or_near() {
    for params in [
        &[("exact_sync", "true")][..],
        &[("max_stamp_difference_s", "0.001")],
    ] {
        let mut machine = machine(options(params));
        for i in 1..20 {
            assert_eq!(give(&mut machine, Stream::Depth, i * PERIOD_NS, 1), []);
            assert_eq!(
                give(&mut machine, Stream::Labels, i * PERIOD_NS + 2_000_000, 1),
                []
            );
        }
        assert_eq!(machine.counts().dropped["depth_no_partner"], 14);
        assert_eq!(machine.finish(), []);
        assert_eq!(machine.counts().dropped["depth_no_partner"], 19);
        assert_eq!(machine.counts().dropped["labels_no_partner"], 19);
    }
}

#[test]
fn a_log_that_loops_begins_anew() {
    let mut machine = machine(CloudOptions::default());
    assert_eq!(give(&mut machine, Stream::Depth, 100 * SECOND_NS, 1), []);
    assert_eq!(give(&mut machine, Stream::Depth, SECOND_NS, 1), []);
    assert_eq!(
        give(&mut machine, Stream::Labels, SECOND_NS, 9),
        [(SECOND_NS, 9)]
    );
    assert_eq!(machine.counts().dropped["depth_time_jump"], 1);
}

#[test]
fn images_wait_for_the_camera() {
    let mut machine = SemanticCloud::new(CloudOptions::default());
    for i in 0..6 {
        assert_eq!(give(&mut machine, Stream::Depth, i, 1), []);
        assert_eq!(give(&mut machine, Stream::Labels, i, 1), []);
    }
    assert_eq!(machine.counts().dropped["depth_no_camera_info"], 1);
    let mut info = camera_info("plumb_bob", &[]);
    (info.width, info.height) = (2, 1);
    assert_eq!(machine.on_camera_info(Arc::new(info)).len(), 5);
}

proptest! {
    #[test]
    fn late_lost_and_reordered_images_pair_with_their_own(
        lost in prop::collection::vec((0.0..1.0, 0.0..1.0, -8_000_000_i64..8_000_000), 40),
        late in prop::collection::vec((0_i64..3, 0_i64..6), 40),
    ) {
        let mut machine = machine(options(&[("queue_size", "20"), ("max_stamp_difference_s", "0.01")]));
        let (mut events, mut whole) = (Vec::new(), BTreeSet::new());
        for (i, ((depth, labels, apart_ns), (depth_late, labels_late))) in (1..).zip(lost.iter().zip(&late)) {
            let stamp_ns = i * PERIOD_NS;
            if *depth > 0.2 {
                events.push((2 * (i + depth_late), Stream::Depth, stamp_ns, 1));
            }
            if *labels > 0.2 {
                events.push((2 * (i + labels_late) + 1, Stream::Labels, stamp_ns + apart_ns, i as u8));
            }
            if *depth > 0.2 && *labels > 0.2 {
                whole.insert((stamp_ns, i as u8));
            }
        }
        events.sort_by_key(|event| event.0);
        let mut found = Vec::new();
        for (_, stream, stamp_ns, label) in events {
            found.extend(give(&mut machine, stream, stamp_ns, label));
        }
        let last = clouds(machine.finish());
        found.extend(last.iter().map(|cloud| (cloud.header.stamp.to_ns(), cloud.data[12])));
        let paired: BTreeSet<_> = found.iter().copied().collect();
        prop_assert_eq!(paired.len(), found.len());
        prop_assert_eq!(paired, whole);
        let counts = machine.counts();
        prop_assert_eq!(machine.waiting(), 0);
        prop_assert_eq!(counts.depth_in, counts.clouds_out + dropped(&machine, "depth_"));
        prop_assert_eq!(counts.labels_in, counts.clouds_out + dropped(&machine, "labels_"));
    }

    #[test]
    fn any_stamps_end_in_a_cloud_or_a_count(
        events in prop::collection::vec((0..3_usize, prop_oneof![any::<i32>(), 0..50_i32]), 0..60),
        confidence in any::<bool>(),
    ) {
        let mut machine = machine(options(&[("use_confidence", if confidence { "true" } else { "false" })]));
        for (stream, ms) in events {
            give(&mut machine, Stream::ALL[stream], i64::from(ms) * 1_000_000, 1);
        }
        machine.finish();
        let counts = machine.counts();
        prop_assert_eq!(counts.depth_in, counts.clouds_out + dropped(&machine, "depth_"));
        prop_assert_eq!(counts.labels_in, counts.clouds_out + dropped(&machine, "labels_"));
    }
}

#[test]
fn depth_without_a_source_of_labels_becomes_clouds_without_labels() {
    let unlabelled = 255;
    let mut machine = machine(CloudOptions::default());
    machine.set_label_source(false);
    for i in 1..4 {
        let stamp_ns = i * PERIOD_NS;
        assert_eq!(
            give(&mut machine, Stream::Depth, stamp_ns, 1),
            [(stamp_ns, unlabelled)]
        );
    }
    let counts = machine.counts();
    assert_eq!((counts.labels_in, counts.points.points_unlabelled), (0, 6));
    // A source that comes later is waited for.
    machine.set_label_source(true);
    assert_eq!(give(&mut machine, Stream::Depth, 4 * PERIOD_NS, 1), []);
    assert_eq!(
        give(&mut machine, Stream::Labels, 4 * PERIOD_NS, 5),
        [(4 * PERIOD_NS, 5)]
    );
    machine.set_label_source(false);
    assert_eq!(
        give(&mut machine, Stream::Depth, 5 * PERIOD_NS, 1),
        [],
        "it has labelled"
    );
    assert_eq!(dropped(&machine, ""), 0);
}

#[test]
fn labels_by_parameter_are_waited_for_or_not() {
    let mut none = machine(options(&[("labels", "none")]));
    assert_eq!(give(&mut none, Stream::Depth, PERIOD_NS, 1).len(), 1);
    let mut image = machine(options(&[("labels", "image")]));
    image.set_label_source(false);
    for i in 1..=6 {
        assert_eq!(give(&mut image, Stream::Depth, i * PERIOD_NS, 1), []);
    }
    assert_eq!(dropped(&image, "depth_no_partner"), 1);
    assert!(image.problem().unwrap().contains("`labels: none`"));
}
