//! The marker publisher as a node: all markers are out when it ends.

use std::sync::{Arc, Mutex};

use lattice_core::lattice::LatticeKind;
use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::visualization_msgs::{Marker, MarkerArray};
use lattice_nodes::lattice_mapper::LatticeMapper;
use lattice_nodes::voxel_marker_publisher::{MarkerOptions, VoxelMarkers, node};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Load, Publisher, Runtime};
use lattice_test::domain::TestDomain;
use lattice_test::maps;

/// A line of voxels in many blocks.
fn mapper() -> LatticeMapper {
    let mut mapper = maps::mapper(maps::options(LatticeKind::Fcc, 0.125));
    let points: Vec<_> = (0..400).map(|i| [i as f32 * 0.2, 0.1, 0.2]).collect();
    maps::insert(&mut mapper, &points);
    mapper
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
    // One block a budget, and none before the end.
    let args = "--ros-args -p rate_hz:=0.1 -p max_bytes_per_s:=1";
    let args = RosArgs::parse(args.split(' ').map(str::to_owned)).unwrap();
    let runtime = Runtime::with_transport("markers", args, &domain.transport()).unwrap();
    let viewer = runtime.node("viewer").unwrap();
    let shown = Arc::<Mutex<Vec<MarkerArray>>>::default();
    let seen = Arc::clone(&shown);
    let show = move |array: Arc<MarkerArray>| seen.lock().unwrap().push((*array).clone());
    let _subscription = viewer
        .subscribe("voxel_markers", Qos::MARKERS, Load::Small, show)
        .unwrap();
    let finish = node::start(&runtime, "voxel_marker_publisher").unwrap();
    let maps: Publisher<LatticeMap> = viewer.publisher("map", Qos::MAP).unwrap();
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
