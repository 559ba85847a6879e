//! Losses of a node before its inbox: in its diagnostics while it runs, and alike in its report.

use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_msgs::RosMessage;
use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{Load, Runtime};
use lattice_test::domain::TestDomain;
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
        ("/map_updates", map),
        ("/points", cloud),
    ];
    let inputs = inputs.map(|(topic, ros_type)| raw(topic, ros_type));
    let (sender, heard) = channel();
    let hear = move |message| _ = sender.send(message);
    let diagnostics =
        node.subscribe::<DiagnosticArray>("/diagnostics", Qos::DIAGNOSTICS, Load::Small, hear);
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
