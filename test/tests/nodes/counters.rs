//! Counters of nodes: each is driven, and stands exactly so in `/diagnostics` and in the report.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use lattice_core::lattice::LatticeKind;
use lattice_msgs::RosMessage;
use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use lattice_msgs::lattice::{ClearBoxRequest, LatticeMap, LatticeMapUpdate};
use lattice_msgs::sensor_msgs::{Imu, PointCloud2};
use lattice_msgs::visualization_msgs::MarkerArray;
use lattice_nodes::executables;
use lattice_nodes::lattice_mapper::{LatticeMapper, MapperOptions};
use lattice_nodes::start::Finish;
use lattice_nodes::voxel_marker_publisher::{MarkerOptions, VoxelMarkers};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Publisher, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::clouds::{cloud, labelled_cloud};
use lattice_test::domain::TestDomain;
use lattice_test::maps::{self, insert};
use serde_json::Value;

use super::map_follower::scatter;

mod projector;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

/// A node, and another one of its process that drives it.
struct Driven {
    task: &'static str,
    // In this order: what uses the runtime goes first.
    finish: Finish,
    world: Node,
    runtime: Runtime,
    _diagnostics: Subscription,
    stated: Receiver<DiagnosticStatus>,
    report: PathBuf,
    _folder: tempfile::TempDir,
    _domain: TestDomain,
}

impl Driven {
    /// Starts a node with parameters, of whose task on `/diagnostics` the counters are.
    fn start(node: &str, task: &'static str, params: &[&str]) -> Self {
        let domain = TestDomain::take();
        let folder = tempfile::tempdir().unwrap();
        let report = folder.path().join("report.json");
        let report_file = format!("report_file:={}", report.display());
        let params = params.iter().copied().chain([&*report_file]);
        let args = ["--ros-args"]
            .into_iter()
            .chain(params.flat_map(|p| ["-p", p]));
        let args = RosArgs::parse(args.map(str::to_owned)).unwrap();
        let runtime = Runtime::with_transport("world", args, &domain.transport()).unwrap();
        let world = runtime.node("world").unwrap();
        let (state, stated) = channel();
        let hear = move |all: Arc<DiagnosticArray>| {
            for status in &all.status {
                let _ = state.send(status.clone());
            }
        };
        let diagnostics = world.subscribe(
            "/diagnostics",
            Qos::DIAGNOSTICS,
            SubscriptionExecutor::Shared,
            hear,
        );
        Self {
            task,
            finish: executables::find(node).unwrap()(&runtime, node).unwrap(),
            world,
            runtime,
            _diagnostics: diagnostics.unwrap(),
            stated,
            report,
            _folder: folder,
            _domain: domain,
        }
    }

    fn publish<M: RosMessage>(&self, topic: &str, qos: Qos, messages: &[M]) {
        let publisher: Publisher<M> = self.world.publisher(topic, qos).unwrap();
        for message in messages {
            publisher.publish(message.clone()).unwrap();
        }
        self.runtime.work_off();
    }

    fn map(&self, topic: &str, chunks: &[LatticeMap]) {
        self.publish(topic, Qos::MAP, chunks);
    }

    fn update(&self, topic: &str, chunks: &[LatticeMapUpdate]) {
        self.publish(topic, Qos::DELTAS, chunks);
    }

    /// Waits until `/diagnostics` has all of these numbers.
    fn shows(&self, expected: &[(&str, u64)]) {
        let mut last = BTreeMap::new();
        loop {
            let Ok(status) = self.stated.recv_timeout(PATIENCE) else {
                panic!("{expected:?}, and not {last:?}");
            };
            if !status.name.ends_with(self.task) {
                continue;
            }
            let values = status.values.into_iter();
            last = values
                .map(|value| (value.key, value.value))
                .collect::<BTreeMap<_, _>>();
            let is_shown = |(key, count): &(&str, u64)| last.get(*key) == Some(&count.to_string());
            if expected.iter().all(is_shown) {
                return;
            }
        }
    }

    /// Ends the node; its report has the same numbers.
    fn ends_with(self, expected: &[(&str, u64)]) {
        drop((self.finish)());
        let text = std::fs::read_to_string(&self.report).unwrap();
        let report: Value = serde_json::from_str(&text).unwrap();
        let mut found = BTreeMap::new();
        numbers("", &report, &mut found);
        for (key, count) in expected {
            assert_eq!(found.get(*key), Some(count), "{key}: {text}");
        }
    }
}

/// All numbers of a report by their last name.
fn numbers(name: &str, value: &Value, found: &mut BTreeMap<String, u64>) {
    if let Value::Object(fields) = value {
        for (key, value) in fields {
            numbers(key, value, found);
        }
    } else if let Some(number) = value.as_u64() {
        found.insert(name.to_owned(), number);
    }
}

/// A chunk whose number is none of its keyframe.
fn malformed(chunk: &LatticeMap) -> LatticeMap {
    LatticeMap {
        chunk: chunk.chunks,
        ..chunk.clone()
    }
}

fn mapper(datum_near_m: [f64; 3], points: &[[f32; 3]]) -> LatticeMapper {
    let mut mapper = maps::mapper(MapperOptions {
        datum_near_m: datum_near_m.into(),
        ..maps::options(LatticeKind::Fcc, 0.125)
    });
    insert(&mut mapper, points);
    mapper
}

#[test]
fn a_merger_counts_what_it_refuses_and_has_no_room_for() {
    let mut near = mapper([0.0; 3], &scatter(1, 500, [0.0; 3], 9.0));
    let mut beside = mapper([0.0; 3], &scatter(2, 50, [100.0, 0.0, 0.0], 9.0));
    // Of the 2^20 cells that keys reach, 0.8 m each along this axis.
    let far_m = 900_000.0;
    let far = [0.0, 2.0, 4.0].map(|x| [far_m + x, 0.0, 0.0]);
    let mut far = mapper([f64::from(far_m), 0.0, 0.0], &far);
    let both = near.list().len() + beside.list().len();
    let max_voxels = format!("max_voxels:={}", both - 5);
    let params = [
        "robots:=[near, beside, far]",
        &max_voxels,
        "update_period_s:=0.1",
    ];
    let merger = Driven::start("map_merger", "merged map", &params);
    let mut sent = 1;
    for (robot, mapper) in [
        ("near", &mut near),
        ("beside", &mut beside),
        ("far", &mut far),
    ] {
        let chunks = mapper.keyframe();
        sent += chunks.len() as u64;
        merger.map(&format!("/{robot}/voxel_map"), &chunks);
        if robot == "far" {
            merger.map("/far/voxel_map", &[malformed(&chunks[0])]);
        }
    }
    let expected = [
        ("messages_in", sent),
        ("messages_refused", 1),
        ("shares_replaced", 3),
        ("voxels_list_full", 5),
        ("voxels_out_of_range", far.list().len() as u64),
        ("voxels", both as u64 - 5),
        ("near_inbox_full", 0),
        ("far_undecodable", 0),
    ];
    merger.shows(&expected);
    merger.ends_with(&expected);
}

#[test]
fn a_marker_publisher_counts_messages_gaps_and_markers() {
    let node = Driven::start("voxel_marker_publisher", "markers", &["rate_hz:=20.0"]);
    // Markers that nobody subscribes to are not drawn.
    let (shared, viewer) = (SubscriptionExecutor::Shared, |_: Arc<MarkerArray>| {});
    let viewer = node
        .world
        .subscribe("voxel_markers", Qos::MARKERS, shared, viewer);
    let _viewer = viewer.unwrap();
    let mut machine = VoxelMarkers::new(MarkerOptions::default());
    let mut mapper = mapper([0.0; 3], &scatter(1, 500, [0.0; 3], 9.0));
    mapper.take_update();
    // The node draws by its timer: what is drawn together here is drawn before the next message there.
    let drawn = |machine: &mut VoxelMarkers| {
        machine.take_arrays(usize::MAX);
        let counts = machine.counts();
        let counts = [
            ("messages_in", counts.messages_in),
            ("arrays_out", counts.arrays_out),
            ("markers_added", counts.markers_added),
            ("markers_deleted", counts.markers_deleted),
            ("voxels", machine.voxels() as u64),
        ];
        node.shows(&counts);
        counts
    };
    let keyframe = mapper.keyframe();
    assert_eq!(keyframe.len(), 1, "drawn in one step");
    node.map("voxel_map", &keyframe);
    machine.on_map(&keyframe[0]).unwrap();
    drawn(&mut machine);
    let point = |[x, y, z]: [f64; 3]| lattice_msgs::geometry_msgs::Point { x, y, z };
    mapper.clear_box(&ClearBoxRequest {
        min: point([-9.0; 3]),
        max: point([0.0, 9.0, 9.0]),
    });
    let update = mapper.take_update();
    assert_eq!(update.len(), 1);
    node.update("voxel_map_updates", &update);
    machine.on_update(&update[0]).unwrap();
    let counts = drawn(&mut machine);
    assert!(counts[3].1 > 0, "markers that go");
    // Refused, and behind a gap.
    node.map("voxel_map", &[malformed(&keyframe[0])]);
    insert(&mut mapper, &[[1.0; 3]]);
    mapper.take_update();
    insert(&mut mapper, &[[2.0; 3]]);
    node.update("voxel_map_updates", &mapper.take_update());
    let after = [
        ("messages_in", 4),
        ("messages_refused", 1),
        ("gaps", 1),
        ("inbox_full", 0),
        ("arrays_not_published", 0),
    ];
    let expected = [&after[..], &counts[1..4]].concat();
    node.shows(&expected);
    node.ends_with(&expected);
}

#[test]
fn messages_that_find_an_inbox_full_are_counted_each() {
    let node = Driven::start("voxel_marker_publisher", "markers", &["inbox_events:=1"]);
    let mut mapper = mapper([0.0; 3], &scatter(1, 20_000, [0.0; 3], 90.0));
    let chunks = mapper.keyframe();
    let (mut sent, mut refused) = (0, 0);
    while refused == 0 {
        node.map("voxel_map", &vec![chunks[0].clone(); 200]);
        sent += 200;
        // The numbers of a moment when nothing is on the way.
        refused = loop {
            let status = node.stated.recv_timeout(PATIENCE).unwrap();
            if status.name.ends_with("markers") {
                let value = |key: &str| {
                    let found = status.values.iter().find(|value| value.key == key);
                    found.unwrap().value.parse::<u64>().unwrap()
                };
                let (taken, full) = (value("messages_in"), value("inbox_full"));
                assert!(taken + full <= sent);
                if taken + full == sent {
                    break full;
                }
            }
        };
    }
    node.ends_with(&[("messages_in", sent - refused), ("inbox_full", refused)]);
}

#[test]
fn motion_that_finds_an_inbox_full_is_counted() {
    let node = Driven::start("lidar_odometry", "odometry", &["inbox_events:=1"]);
    let mut imu = Imu::default();
    imu.angular_velocity.x = f64::NAN;
    let (mut sent, mut full) = (0, 0);
    while full == 0 {
        node.publish("imu", Qos::reliable(500), &vec![imu.clone(); 200]);
        sent += 200;
        full = loop {
            // Each cloud has the numbers published.
            node.publish("points", Qos::SENSOR, &[cloud("nowhere", 5, &[[1.0; 3]])]);
            let status = node.stated.recv_timeout(PATIENCE).unwrap();
            let value = |key: &str| {
                let found = status.values.iter().find(|value| value.key == key);
                found.map_or(0, |found| found.value.parse::<u64>().unwrap())
            };
            if value("imu_refused") + value("motion_inbox_full") == sent {
                break value("motion_inbox_full");
            }
        };
    }
    node.ends_with(&[("imu_refused", sent - full), ("motion_inbox_full", full)]);
}

#[test]
fn a_calibration_server_counts_what_it_refuses() {
    let mut mapper = mapper([0.0; 3], &scatter(1, 500, [0.0; 3], 9.0));
    let params = [
        "search:=asked",
        "max_cloud_points:=100",
        "require_labels:=true",
    ];
    let node = Driven::start("semantic_icp_server", "calibration", &params);
    let clouds = |clouds: &[PointCloud2]| node.publish("headset/points", Qos::SENSOR, clouds);
    let good = |points: &[([f32; 3], u16)]| labelled_cloud("headset_origin", 5, points);
    // Before the map.
    clouds(&[good(&[([1.0; 3], 7)])]);
    node.shows(&[("clouds_no_map", 1)]);
    let chunks = mapper.keyframe();
    node.map("voxel_map", &chunks);
    node.map("voxel_map", &[malformed(&chunks[0])]);
    node.shows(&[
        ("map_refused", 1),
        ("map_voxels", mapper.list().len() as u64),
    ]);
    let mut cut = good(&[([1.0; 3], 7)]);
    cut.data.truncate(3);
    let nan = ([f32::NAN; 3], 7);
    let far = ([1e9, 0.0, 0.0], 7);
    clouds(&[
        labelled_cloud("elsewhere", 5, &[([1.0; 3], 7)]),
        good(&[]),
        good(&[nan, nan]),
        cloud("headset_origin", 5, &[[1.0; 3]]),
        good(&[([1.0; 3], 7); 101]),
        cut,
        good(&[([1.0; 3], 7), nan, far, far]),
    ]);
    let expected = [
        ("clouds_in", 8),
        ("clouds_wrong_frame", 1),
        ("clouds_empty", 1),
        ("clouds_no_place", 1),
        ("clouds_unlabelled", 1),
        ("clouds_too_large", 1),
        ("clouds_malformed", 1),
        ("clouds_no_map", 1),
        ("clouds_kept", 1),
        ("points_not_finite", 1),
        ("points_too_far", 2),
        ("map_refused", 1),
        ("inbox_full", 0),
        ("undecodable", 0),
    ];
    node.shows(&expected);
    node.ends_with(&expected);
}
