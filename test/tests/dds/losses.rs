//! Losses of a node before its inbox: in its diagnostics while it runs, and alike in its report.

use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_core::lattice::LatticeKind;
use lattice_msgs::RosMessage;
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::lattice::LatticeMapUpdate;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_nodes::lattice_mapper::MapperOptions;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Runtime, SubscriptionExecutor};
use lattice_test::clouds::cloud;
use lattice_test::domain::TestDomain;
use lattice_test::maps::{self, insert};
use lattice_test::peer::Nodes;
use serde_json::Value;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(60);

#[test]
fn what_does_not_decode_is_in_diagnostics_and_report() {
    let folder = tempfile::tempdir().unwrap();
    let domain = TestDomain::take();
    let report = |node: &str| folder.path().join(node);
    let nodes = [
        "lattice_mapper",
        "voxel_marker_publisher",
        "enu_transformer",
    ];
    let started = nodes.map(|node| {
        let file = format!("report_file:={}", report(node).display());
        (node, vec![file])
    });
    let started = Nodes::start(&domain, &started);
    let runtime = Runtime::with_transport(
        "peer",
        RosArgs::parse(["--ros-args".to_owned()]).unwrap(),
        &domain.transport(),
    );
    let runtime = runtime.unwrap();
    let node = runtime.node("peer").unwrap();
    let raw = |topic: &str, ros_type| {
        let publisher = node.raw_publisher(topic, ros_type, None, Qos::reliable(10));
        publisher.unwrap()
    };
    let (cloud, map) = (PointCloud2::TYPE, "lattice_msgs/msg/LatticeMapUpdate");
    let inputs = [
        ("/points_enu", cloud),
        ("/voxel_map_updates", map),
        ("/points", cloud),
    ];
    let inputs = inputs.map(|(topic, ros_type)| raw(topic, ros_type));
    let (sender, heard) = channel();
    let hear = move |message| _ = sender.send(message);
    let diagnostics = node.subscribe::<DiagnosticArray>(
        "/diagnostics",
        Qos::DIAGNOSTICS,
        SubscriptionExecutor::Shared,
        hear,
    );
    let _diagnostics = diagnostics.unwrap();
    let mut missing = nodes.to_vec();
    while !missing.is_empty() {
        for input in &inputs {
            let lie = vec![0, 1, 0, 0, 255, 255, 255, 255];
            input.publish_within(lie, PATIENCE).unwrap();
        }
        let message = heard.recv_timeout(PATIENCE).unwrap();
        for status in &message.status {
            let lost = status.values.iter();
            let lost = lost.filter(|value| value.key == "undecodable");
            if lost.clone().any(|value| value.value != "0") {
                missing.retain(|node| !status.name.starts_with(node));
            }
        }
    }
    started.finish();
    for node in nodes {
        let text = std::fs::read_to_string(report(node)).unwrap();
        let report: Value = serde_json::from_str(&text).unwrap();
        assert!(report["undecodable"].as_u64() > Some(0), "{report}");
        let transport = report["transport"].as_object().unwrap();
        let mut undecodable = transport.iter();
        assert!(
            undecodable.any(|(of, _)| of.ends_with(" undecodable")),
            "{report}"
        );
    }
}

#[test]
fn updates_that_find_the_publisher_full_are_counted_each() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("report");
    let domain = TestDomain::take();
    let params = [
        format!("report_file:={}", file.display()),
        // The smallest, so that an update has more than the 1024 messages of a queue.
        "chunk_bytes:=2048".to_owned(),
        "qos.points_enu.reliability:=reliable".to_owned(),
    ];
    let mapper = Nodes::start(&domain, &[("lattice_mapper", params.to_vec())]);
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport("peer", args, &domain.transport()).unwrap();
    let node = runtime.node("peer").unwrap();
    let clouds = node.publisher("/points_enu", Qos::reliable(10)).unwrap();
    let qos = Qos::reliable(10_000);
    let heard = node.subscribe::<LatticeMapUpdate>(
        "/voxel_map_updates",
        qos,
        SubscriptionExecutor::Dedicated,
        |_| {},
    );
    let heard = heard.unwrap();
    let (sender, stated) = channel();
    let hear = move |message| _ = sender.send(message);
    let diagnostics = node.subscribe::<DiagnosticArray>(
        "/diagnostics",
        Qos::DIAGNOSTICS,
        SubscriptionExecutor::Shared,
        hear,
    );
    let _diagnostics = diagnostics.unwrap();
    while clouds.subscriber_count() == 0 || heard.publisher_count() == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    // The same mapper without a node.
    let mut twin = maps::mapper(MapperOptions {
        chunk_bytes: 2048,
        ..maps::options(LatticeKind::Fcc, 0.125)
    });
    let (mut chunks, mut clouds_in, mut dropped) = (0, 0_u32, 0);
    while dropped == 0 {
        clouds_in += 1;
        assert!(clouds_in < 10, "no update is too long for the queue");
        // Cells far apart, each in a key of its own.
        let point = |i: u32| [(i % 500) as f32, (i / 500) as f32, 2.0 * clouds_in as f32];
        let points: Vec<_> = (0..250_000).map(point).collect();
        insert(&mut twin, &points);
        chunks += twin.take_update().len() as u64;
        clouds.publish(cloud("map", 1, &points)).unwrap();
        // Until it is mapped, and what is not lost has come.
        loop {
            let all = stated.recv_timeout(PATIENCE).unwrap();
            let mapper = all
                .status
                .iter()
                .find(|of| of.name == "lattice_mapper: map");
            let value = |key: &str| {
                let values = mapper.into_iter().flat_map(|of| &of.values);
                let mut found = values.filter(|value| value.key == key);
                found.next().map_or(0, |value| value.value.parse().unwrap())
            };
            dropped = value("updates_not_published");
            let came = heard.received() + heard.lost();
            if value("updates") == u64::from(clouds_in) && came + dropped == chunks {
                break;
            }
        }
    }
    mapper.finish();
    let text = std::fs::read_to_string(&file).unwrap();
    let report: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(report["updates_not_published"], dropped, "{report}");
}
