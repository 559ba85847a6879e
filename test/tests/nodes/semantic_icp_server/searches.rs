//! Occasions of searches: the first cloud, another map, another session, several headset scans, other axes.

use std::sync::atomic::Ordering::Relaxed;

use lattice_core::pose::Axes;
use lattice_core::registration::Verdict;
use lattice_msgs::lattice::CalibrateGoal;
use lattice_msgs::vision_msgs::{LabelInfo, VisionClass};
use lattice_nodes::convert::geometry::isometry_from_transform;
use lattice_nodes::semantic_icp_server::{End, LatticeSearch, SearchWhen, ServerOptions};
use lattice_test::clouds::SECOND_NS;
use lattice_test::flat::{Flat, headset_cloud, map_cloud};
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use super::bench::{Bench, Fake, NONE, OK, REJECTED, bench, found, good, map_point, mapper};

#[test]
fn the_first_cloud_is_searched_and_the_next_are_tracked() {
    // No looks more than one, which would confirm the pose.
    let mut bench = bench(ServerOptions {
        max_headset_scans: 1,
        ..ServerOptions::default()
    });
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
    let result = bench.results.last().unwrap().clone();
    let frames = (&*result.header.frame_id, &*result.child_frame_id);
    assert_eq!(frames, ("map", "headset_origin"));
    assert_eq!(result.header.stamp.to_ns(), 5);
    assert_eq!((result.gazes, result.points), (1, 2));
    assert_eq!(result.duration_s, 0.25);
    assert_eq!(bench.transforms.len(), 1);
    assert!(bench.search.map_labelled);

    for _ in 0..3 {
        bench.cloud(&good());
    }
    assert_eq!(bench.search.headset_scans, [1], "no more searches");
    assert_eq!(bench.search.maps, 1);
    let counts = bench.machine.counts();
    assert_eq!((counts.clouds_in, counts.clouds_searched), (4, 1));
    assert_eq!(counts.clouds_tracked, 3);
    // A millimetre is no news; but what is published on is the refined pose.
    assert_eq!(bench.results.len(), 2, "told again after five seconds");
    assert_eq!(bench.results[1].method, "tracking");
    let tick = bench.machine.tick(bench.now_ns).unwrap();
    bench.put([tick]);
    let last = bench.transforms.last().unwrap();
    let pose = isometry_from_transform(&last.transform).unwrap();
    assert!((pose.translation.x - 1.003).abs() < 1e-9, "{pose}");
    assert_eq!(last.header.stamp.to_ns(), bench.now_ns);
    let frames = (&*last.header.frame_id, &*last.child_frame_id);
    assert_eq!(frames, ("map", "headset_origin"));
}

#[test]
fn without_a_map_clouds_are_refused_and_kept() {
    let mut bench = Bench::new(ServerOptions::default(), Fake::default());
    bench.cloud(&good());
    assert_eq!(bench.verdict(), REJECTED);
    assert_eq!(bench.reason(), "there is no map yet");
    bench.ask(1, &CalibrateGoal::default());
    assert_eq!(bench.answered(0), (1, End::Failed));
    assert_eq!(bench.message(0), "there is no map yet");
    bench.map(&mut mapper(1));
    bench.ask(2, &CalibrateGoal::default());
    assert_eq!(bench.message(1), "there is no map yet", "it is empty");

    let mut mapper = mapper(2);
    map_point(&mut mapper, 0.0);
    bench.map(&mut mapper);
    bench.ask(3, &CalibrateGoal::default());
    bench.work();
    assert_eq!(bench.answered(2), (3, End::Found));
    assert!(bench.answers[2].2.success);

    bench.search.refuse_map = true;
    map_point(&mut mapper, 5.0);
    bench.map(&mut mapper);
    bench.ask(4, &CalibrateGoal::default());
    bench.work();
    assert_eq!(bench.message(3), "the map cannot be used: too small");
    assert_eq!(bench.search.maps, 2, "made ready once for each state");
}

#[test]
fn several_headset_scans_are_searched_together_and_bad_ones_dropped() {
    let mut bench = bench(ServerOptions::default());
    use Verdict::{Ambiguous, Degenerate, NoOverlap, RejectedInput};
    for verdict in [Ambiguous, Degenerate, Ambiguous, Ambiguous] {
        bench.searched(verdict);
        assert_ne!(bench.verdict(), OK);
    }
    assert_eq!(bench.search.headset_scans, [1, 2, 3, 3], "at most three");
    assert!(bench.transforms.is_empty(), "a pose that does not hold");
    for verdict in [NoOverlap, RejectedInput] {
        bench.searched(verdict);
    }
    let scans = &bench.search.headset_scans[4..];
    assert_eq!(scans, [3, 1], "those said nothing");
    bench.cloud(&good());
    assert_eq!((bench.verdict(), bench.search.headset_scans[6]), (OK, 1));
    let counts = bench.machine.counts();
    let not_found = [counts.searches_ambiguous, counts.searches_degenerate];
    assert_eq!((not_found, counts.searches_no_overlap), ([3, 1], 1));
    assert_eq!((counts.searches_rejected, counts.searches_ok), (1, 1));

    // Clouds of one second are one look.
    let mut bench = self::bench(ServerOptions {
        search: SearchWhen::Asked,
        ..ServerOptions::default()
    });
    for _ in 0..5 {
        bench.now_ns -= 2 * SECOND_NS - SECOND_NS / 10;
        bench.cloud(&good());
    }
    bench.ask(1, &CalibrateGoal::default());
    bench.work();
    assert_eq!(bench.search.headset_scans, [1]);
}

#[test]
fn a_new_session_is_searched_anew() {
    let mut bench = bench(ServerOptions::default());
    bench.session("a");
    bench.cloud(&good());
    assert_eq!(bench.results.last().unwrap().session, "a");
    bench.session("a");
    assert_eq!(bench.verdict(), OK, "the same once more");
    bench.session("b");
    assert_eq!(bench.verdict(), NONE);
    assert_eq!(bench.reason(), "the headset has begun a new session");
    let tick = bench.machine.tick(bench.now_ns);
    assert!(tick.is_none(), "no transform of the old origin");
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
    assert_eq!(bench.search.headset_scans.last(), Some(&1));

    // While a search is at work: what it finds is of the old origin.
    bench.session("c");
    bench.send(&good());
    bench.ask(7, &CalibrateGoal::default());
    let canceled = bench.jobs[0].canceled.clone();
    bench.session("d");
    assert!(canceled.load(Relaxed));
    assert_eq!(bench.answered(0), (7, End::Failed));
    assert!(bench.message(0).contains("new session"));
    bench.work();
    assert_eq!(bench.verdict(), NONE);
    assert_eq!(bench.machine.map_from_headset(), None);
    bench.cloud(&good());
    assert_eq!(bench.verdict(), OK);
    assert_eq!(bench.machine.counts().sessions, 4);
}

#[test]
fn a_new_map_is_searched_anew() {
    let mut bench = bench(ServerOptions::default());
    bench.cloud(&good());
    bench.other_map();
    assert_eq!(bench.verdict(), NONE);
    assert_eq!(bench.reason(), "the map is a new one");
    bench.cloud(&good());
    assert_eq!((bench.verdict(), bench.search.maps), (OK, 2));
}

#[test]
fn confusions_of_labels_are_unlearned_with_session_classes_and_map() {
    let mut bench = bench(ServerOptions::default());
    let classes = |names: [&str; 2]| {
        let class = |(class_id, name): (u16, &str)| VisionClass {
            class_id,
            class_name: name.to_owned(),
        };
        LabelInfo {
            class_map: (1..).zip(names).map(class).collect(),
            ..LabelInfo::default()
        }
    };
    bench.machine.on_label_info(&classes(["wall", "floor"]));
    bench.cloud(&good());
    let begun = bench.search.unlearned;
    bench.machine.on_label_info(&classes(["wall", "floor"]));
    bench.session("");
    bench.cloud(&good());
    assert_eq!(bench.search.unlearned, begun, "the same once more");
    bench.machine.on_label_info(&classes(["floor", "wall"]));
    bench.cloud(&good());
    assert_eq!(bench.search.unlearned, begun + 1, "another segmenter");
    bench.session("b");
    bench.cloud(&good());
    assert_eq!(bench.search.unlearned, begun + 2, "another session");
    bench.other_map();
    bench.cloud(&good());
    assert_eq!(bench.search.unlearned, begun + 3, "another map");
    bench.cloud(&good());
    assert_eq!(bench.search.unlearned, begun + 3);
}

#[test]
fn clouds_that_come_while_it_is_busy_are_not_lost_but_the_newest_counts() {
    let mut bench = bench(ServerOptions::default());
    let ambiguous = found(Verdict::Ambiguous, 0.0);
    bench.search.verdicts.push_back(ambiguous);
    for _ in 0..5 {
        bench.send(&good());
    }
    bench.work();
    assert_eq!(bench.search.headset_scans, [1, 3]);
    assert_eq!(bench.verdict(), OK);
    for _ in 0..5 {
        bench.send(&good());
    }
    assert_eq!(bench.jobs.len(), 1);
    bench.work();
    let counts = bench.machine.counts();
    assert_eq!((counts.clouds_in, counts.clouds_tracked), (10, 2));
}

fn truth() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.3);
    Isometry3::from_parts(Translation3::new(3.0, 2.0, 1.5), turn)
}

/// The whole way with the true search: a left-handed headset in a flat.
#[test]
fn a_left_handed_headset_is_found_and_a_mirrored_one_is_not() {
    let flat = Flat::default();
    let mut mapper = mapper(1);
    mapper.on_cloud(&map_cloud(&flat, 1)).unwrap();
    let mut options = ServerOptions::default();
    options.semantic.axes = Axes::UnityRuf;
    let search = LatticeSearch::new(options.calibration);
    let mut bench = Bench::new(options, search);
    bench.map(&mut mapper);
    let look = flat.look(Point3::new(3.5, 3.8, 1.6), -2.2, &truth());
    let unity = |v: Vector3<f64>| Axes::UnityRuf.from_ros(v);
    let mirrored = |v: Vector3<f64>| unity(Vector3::new(v.x, -v.y, v.z));

    bench.cloud(&headset_cloud(&look, 1, mirrored));
    assert_eq!(bench.verdict(), REJECTED, "{}", bench.reason());
    assert!(bench.reason().contains("mirrored"), "{}", bench.reason());
    for turn in 0..2 {
        bench.cloud(&headset_cloud(&look, 2, unity));
        assert_eq!(bench.verdict(), OK, "{turn}: {}", bench.reason());
        let found = isometry_from_transform(&bench.results.last().unwrap().transform).unwrap();
        let off = truth().inverse() * found;
        assert!(off.translation.vector.norm() < 0.02, "{off}");
        assert!(off.rotation.angle() < 0.005, "{off}");
        // Also where the headset is known already.
        bench.cloud(&headset_cloud(&look, 3, mirrored));
        assert_eq!(bench.verdict(), REJECTED, "{turn}: {}", bench.reason());
    }
    let counts = bench.machine.counts();
    assert_eq!(counts.tracking_misses + counts.tracking_doubts, 2);
}
