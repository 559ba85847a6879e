//! Nodes of two versions on one graph.

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use lattice_msgs::RosMessage;
use lattice_msgs::lattice::LatticeMap;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};

use crate::PATIENCE;
use crate::health::cloud;
use crate::record::{expect, start};

#[test]
fn another_version_of_the_map_is_named_and_both_continue() {
    let domain = LoopbackDomain::take().unwrap();
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let runtime = Runtime::with_transport("other", RosArgs::default(), &network).unwrap();
    let node = runtime.node("other").unwrap();
    let hash = format!("RIHS01_{}", "a".repeat(64));
    let (name, topic) = (LatticeMap::TYPE, "/other_map");
    let other = node.raw_publisher(topic, name, Some(&hash), Qos::MAP);
    let mut mapper = start(&domain, &["node", "lattice_mapper"]);
    let line =
        "/other_map: another process has lattice_msgs/msg/LatticeMap of another version of Lattice";
    expect(&mut mapper, &[line]);

    let (sender, maps) = channel();
    let on_map = move |map: Arc<LatticeMap>| {
        let _ = sender.send(map.voxels_total);
    };
    let shared = SubscriptionExecutor::Shared;
    let _maps = node
        .subscribe("voxel_map", Qos::MAP, shared, on_map)
        .unwrap();
    let points = node.publisher("points_enu", Qos::reliable(10)).unwrap();
    let _timer = runtime.timer(Duration::from_millis(100), move || {
        let _ = points.publish(cloud("map"));
    });
    let begin = Instant::now();
    while maps.recv_timeout(PATIENCE).unwrap() == 0 {
        assert!(begin.elapsed() < PATIENCE, "no map");
    }
    drop(other);
    mapper.kill().unwrap();
    mapper.wait().unwrap();
}
