//! Messages that DDS refuses to send are counted.

use std::process::Command;
use std::sync::Arc;
use std::sync::mpsc::channel;

use lattice_msgs::diagnostic_msgs::DiagnosticArray;
use lattice_msgs::lattice::LatticeMap;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};
use serde_json::Value;
use wait_timeout::ChildExt;

use crate::PATIENCE;
use crate::record::{expect, signal, spawn};
use crate::signals::grid_map;

/// Cyclone refuses larger samples than this.
const SMALL: &str = "<CycloneDDS><Domain id=\"any\"><Internal><MaxSampleSize>30000B</MaxSampleSize></Internal>\
    </Domain></CycloneDDS>";

#[test]
fn chunks_that_are_too_large_for_the_transport_are_counted_each() {
    let folder = tempfile::tempdir().unwrap();
    let cells = grid_map(folder.path(), 38);
    let domain = LoopbackDomain::take().unwrap();
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let runtime = Runtime::with_transport("follower", RosArgs::default(), &network).unwrap();
    let node = runtime.node("follower").unwrap();
    let (sender, came) = channel();
    let hear = move |chunk: Arc<LatticeMap>| _ = sender.send(chunk);
    let map = node.subscribe(
        "/voxel_map",
        Qos::MAP,
        SubscriptionExecutor::Dedicated,
        hear,
    );
    let _map = map.unwrap();
    let (sender, stated) = channel();
    let hear = move |message: Arc<DiagnosticArray>| _ = sender.send(message);
    let shared = SubscriptionExecutor::Shared;
    let diagnostics = node.subscribe("/diagnostics", Qos::DIAGNOSTICS, shared, hear);
    let _diagnostics = diagnostics.unwrap();

    let report = folder.path().join("report");
    let params = [
        "lattice:=cubic".to_owned(),
        "cell_volume_m3:=1.0".to_owned(),
        format!("map_dir:={}", folder.path().display()),
        "resume:=true".to_owned(),
        format!("report_file:={}", report.display()),
    ];
    let mut mapper = Command::new(env!("CARGO_BIN_EXE_lattice"));
    mapper.args(["node", "lattice_mapper", "--ros-args"]);
    mapper.args(params.iter().flat_map(|param| ["-p", param]));
    let mut mapper = spawn(&domain, mapper.env("CYCLONEDDS_URI", SMALL));
    expect(&mut mapper, &["resumed with"]);
    // The last chunk of the keyframe is a small one, and says how many there are.
    let last = came.recv_timeout(PATIENCE).unwrap();
    assert_eq!((last.chunk + 1, last.voxels_total), (last.chunks, cells));
    let refused = u64::from(last.chunks) - 1;
    assert!(refused > 5, "{refused}");
    let count = |message: &DiagnosticArray| {
        let tasks = message.status.iter();
        let mut map = tasks.filter(|task| task.name == "lattice_mapper: map");
        let values = map.next()?.values.iter();
        let mut found = values.filter(|value| value.key == "chunks_not_published");
        found.next()?.value.parse::<u64>().ok()
    };
    let counted = |message: Arc<DiagnosticArray>| count(&message) == Some(refused);
    while !counted(stated.recv_timeout(PATIENCE).unwrap()) {}
    signal(&mapper, "-INT");
    assert!(mapper.wait_timeout(PATIENCE).unwrap().unwrap().success());
    let report: Value = serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap();
    assert_eq!(report["chunks_not_published"], refused, "{report}");
    assert_eq!(report["counts"]["keyframes"], 1);
    assert_eq!(came.try_iter().count(), 0);
}
