//! The marker publisher as a node: at its end all markers are out to viewers, and none are drawn for nobody.

use std::sync::{Arc, Mutex};

use lattice_core::lattice::LatticeKind;
use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use lattice_nodes::lattice_mapper::LatticeMapper;
use lattice_nodes::voxel_marker_publisher::{MarkerOptions, MarkerReport, VoxelMarkers, node};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Publisher, Runtime, SubscriptionExecutor};
use lattice_test::domain::TestDomain;
use lattice_test::maps;

/// A line of voxels in many blocks.
fn mapper() -> LatticeMapper {
    let mut mapper = maps::mapper(maps::options(LatticeKind::Fcc, 0.125));
    let points: Vec<_> = (0..400).map(|i| [i as f32 * 0.2, 0.1, 0.2]).collect();
    maps::insert(&mut mapper, &points);
    mapper
}

/// A process with the node, which draws one block at a time, and none before its end.
fn runtime(domain: &TestDomain, more: &[&str]) -> Runtime {
    let args = [
        "--ros-args",
        "-p",
        "rate_hz:=0.1",
        "-p",
        "max_bytes_per_s:=1",
    ];
    let args = args.iter().chain(more).map(|arg| (*arg).to_owned());
    let args = RosArgs::parse(args).unwrap();
    Runtime::with_transport("markers", args, &domain.transport()).unwrap()
}

#[test]
fn nothing_is_drawn_that_nobody_sees() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report.json");
    let report_file = format!("report_file:={}", report.display());
    let domain = TestDomain::take();
    let runtime = runtime(&domain, &["-p", &report_file]);
    let finish = node::start(&runtime, "voxel_marker_publisher").unwrap();
    let mapper_node = runtime.node("mapper").unwrap();
    let maps: Publisher<LatticeMap> = mapper_node.publisher("voxel_map", Qos::MAP).unwrap();
    for chunk in mapper().keyframe() {
        maps.publish(chunk).unwrap();
    }
    runtime.work_off();
    drop(finish());
    let report: MarkerReport = lattice_nodes::report::read(&report).unwrap();
    assert_eq!(report.voxels, mapper().list().len());
    assert_eq!(report.counts.arrays_out, 0);
    assert_eq!(report.counts.markers_added, 0);
}

#[test]
fn all_budgets_of_markers_are_drawn_at_the_end() {
    let mut expected = VoxelMarkers::new(MarkerOptions::default());
    for chunk in mapper().keyframe() {
        expected.on_map(&chunk).unwrap();
    }
    let points = |arrays: &[MarkerArray]| {
        let markers = arrays.iter().flat_map(|array| &array.markers);
        markers.map(|marker| marker.points.len()).sum::<usize>()
    };
    let expected = points(&expected.take_arrays(usize::MAX));

    let domain = TestDomain::take();
    let runtime = runtime(&domain, &[]);
    let viewer = runtime.node("viewer").unwrap();
    let shown = Arc::<Mutex<Vec<MarkerArray>>>::default();
    let seen = Arc::clone(&shown);
    let show = move |array: Arc<MarkerArray>| seen.lock().unwrap().push((*array).clone());
    let _subscription = viewer
        .subscribe(
            "voxel_markers",
            Qos::MARKERS,
            SubscriptionExecutor::Shared,
            show,
        )
        .unwrap();
    let finish = node::start(&runtime, "voxel_marker_publisher").unwrap();
    let maps: Publisher<LatticeMap> = viewer.publisher("voxel_map", Qos::MAP).unwrap();
    for chunk in mapper().keyframe() {
        maps.publish(chunk).unwrap();
    }
    runtime.work_off();
    finish();
    runtime.work_off();
    let shown = shown.lock().unwrap();
    assert_eq!(points(&shown), expected);
    let all = shown.iter().flat_map(|array| &array.markers);
    let wiped = all.filter(|marker| marker.action == Marker::DELETEALL);
    assert_eq!(wiped.count(), 1);
}
