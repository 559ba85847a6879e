//! Topics and services under the names and types of octomap_server.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use lattice_msgs::octomap_msgs::{
    BoundingBoxQuery, BoundingBoxQueryRequest, GetOctomap, GetOctomapRequest, Octomap,
};
use lattice_msgs::std_srvs::{Empty, EmptyRequest};
use lattice_msgs::{RosMessage, RosService, cdr};
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Node, Runtime, Subscription, SubscriptionExecutor};
use lattice_test::clouds::cloud;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::python;
use serde_json::json;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

#[track_caller]
fn call<S: RosService>(node: &Node, name: &str, request: &S::Request) -> S::Response {
    let client = node.client::<S>(name).unwrap();
    let request = cdr::to_vec(request).unwrap();
    let answer = smol::block_on(client.call(request, PATIENCE)).unwrap();
    let answer = cdr::from_slice::<S::Response>(&answer);
    answer.unwrap_or_else(|_| panic!("{name}: no {}", S::Response::TYPE))
}

#[test]
fn clients_of_octomap_server_are_answered() {
    let domain = TestDomain::take();
    let mapper = ("lattice_mapper", params("octomap_services:=true"));
    let nodes = Nodes::start(&domain, &[mapper]);
    let args = RosArgs::parse([]).unwrap();
    let runtime = Runtime::with_transport("client", args, &domain.transport()).unwrap();
    let node = runtime.node("client").unwrap();
    for service in ["clear_bbox", "clear_bbx"] {
        let name = format!("/lattice_mapper/{service}");
        call::<BoundingBoxQuery>(&node, &name, &BoundingBoxQueryRequest::default());
    }
    call::<Empty>(&node, "/lattice_mapper/reset", &EmptyRequest::default());
    nodes.finish();
}

fn hear(node: &Node, topic: &str) -> (Subscription, Receiver<Arc<Octomap>>) {
    let (sender, receiver) = channel();
    let handler = move |message| {
        // The test may have heard enough.
        let _ = sender.send(message);
    };
    let shared = SubscriptionExecutor::Shared;
    let subscription = node.subscribe::<Octomap>(topic, Qos::LATCHED, shared, handler);
    (subscription.unwrap(), receiver)
}

/// The next octree with voxels.
fn next(heard: &Receiver<Arc<Octomap>>) -> Arc<Octomap> {
    loop {
        let octomap = heard.recv_timeout(PATIENCE).unwrap();
        if !octomap.data.is_empty() {
            return octomap;
        }
    }
}

#[test]
fn octrees_are_latched_and_served() {
    let domain = TestDomain::take();
    let line = "octomap_services:=true lattice:=cubic cell_size_m:=0.5 centers_period_s:=0.05";
    let nodes = Nodes::start(&domain, &[("lattice_mapper", params(line))]);
    let runtime = |name: &str| {
        let args = RosArgs::parse([]).unwrap();
        Runtime::with_transport(name, args, &domain.transport()).unwrap()
    };
    let driver = runtime("driver");
    let driver = driver.node("driver").unwrap();
    let points = driver.publisher("/points_enu", Qos::reliable(10)).unwrap();
    let (sender, joined) = channel();
    points.on_subscriber_joined(move || {
        let _ = sender.send(());
    });
    joined.recv_timeout(PATIENCE).unwrap();
    // One voxel of the cell size apart: no eight of half the size are a leaf.
    let wall: Vec<[f32; 3]> = (0..100).map(|i| [10.0, i as f32, 1.0]).collect();
    points.publish(cloud("map", 1_000_000_000, &wall)).unwrap();

    let (_binary, binary) = hear(&driver, "/octomap_binary");
    let (_full, full) = hear(&driver, "/octomap_full");
    let (binary, full) = (next(&binary), next(&full));
    for (octomap, is_binary) in [(&binary, true), (&full, false)] {
        assert_eq!((octomap.id.as_str(), octomap.binary), ("OcTree", is_binary));
        assert_eq!(
            (octomap.resolution, &*octomap.header.frame_id),
            (0.25, "map")
        );
    }
    // Who joins later has the same, and so has who asks.
    let late = runtime("late");
    let late = late.node("late").unwrap();
    let (_again, again) = hear(&late, "/octomap_binary");
    assert_eq!(next(&again).data, binary.data);
    for (name, octomap) in [("/octomap_binary", &binary), ("/octomap_full", &full)] {
        let answer = call::<GetOctomap>(&late, name, &GetOctomapRequest::default());
        assert_eq!(answer.map, **octomap);
    }
    if let Some(python) = python() {
        let id = domain.id().to_string();
        let found = peer::run(&python, "octomap_peer.py", &[id.as_ref()]);
        for (name, octomap) in [("octomap_binary", &binary), ("octomap_full", &full)] {
            let seen = json!(["OcTree", octomap.binary, 0.25, "map", octomap.data.len()]);
            assert_eq!(found[name], json!([seen, seen]), "{name}");
        }
    }
    nodes.finish();
}
