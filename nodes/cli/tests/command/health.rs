//! `lattice health` beside a node that is well, one that is not, and none.

use std::process::{Command, Output};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use lattice_msgs::sensor_msgs::{PointCloud2, PointField};
use lattice_nodes::convert::{cloud, geometry};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime};

use crate::PATIENCE;
use crate::record::start;

fn health(domain: &LoopbackDomain, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lattice"))
        .arg("health")
        .args(arguments)
        .env("ROS_DOMAIN_ID", domain.id().to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .output()
        .unwrap()
}

#[test]
fn health_is_what_nodes_say_of_themselves() {
    let domain = LoopbackDomain::take().unwrap();
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let silent = health(&domain, &["--timeout", "1"]);
    let words = String::from_utf8_lossy(&silent.stderr);
    assert!(
        !silent.status.success() && words.contains("no diagnostics from every node in 1 s"),
        "{words}"
    );

    let runtime = Runtime::with_transport("well", RosArgs::default(), &network).unwrap();
    let node = runtime.node("well").unwrap();
    let publisher = node.publisher("/diagnostics", Qos::DIAGNOSTICS).unwrap();
    let ill = DiagnosticStatus {
        level: DiagnosticStatus::ERROR,
        name: "robot/ill: map".to_owned(),
        message: "no disk".to_owned(),
        ..DiagnosticStatus::default()
    };
    let _timer = runtime.timer(Duration::from_millis(100), move || {
        let message = DiagnosticArray {
            status: vec![ill.clone()],
            ..DiagnosticArray::default()
        };
        let _ = publisher.publish(message);
    });
    for (arguments, well, words) in [
        (&["well"][..], true, "well: transport"),
        (&["/robot/ill"], false, "no disk"),
        (&["well", "robot/ill"], false, "no disk"),
        (&["nobody", "--timeout", "1"], false, ""),
    ] {
        let timeout: &[&str] = if well || !words.is_empty() {
            &["--timeout", "60"]
        } else {
            &[]
        };
        let output = health(&domain, &[arguments, timeout].concat());
        let said = String::from_utf8_lossy(&output.stdout);
        assert_eq!(output.status.success(), well, "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {said}");
    }
    // Each of those that publish is heard, not the first alone.
    let output = health(&domain, &["--timeout", "60"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(!output.status.success(), "{said}");
    for words in ["well: transport", "no disk"] {
        assert!(said.contains(words), "{said}");
    }
}

/// A cloud of one point.
pub fn cloud(frame: &str) -> PointCloud2 {
    let data = [1.0_f32, 2.0, 3.0].map(f32::to_le_bytes).concat();
    let fields = cloud::xyz_fields(PointField::FLOAT32, 4);
    cloud::dense_cloud(geometry::header(frame, 1), fields, 12, 1, data)
}

#[test]
fn a_mapper_is_not_well_until_it_has_mapped_a_cloud() {
    let domain = LoopbackDomain::take().unwrap();
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let mut mapper = start(&domain, &["node", "lattice_mapper"]);
    let ask = || health(&domain, &["lattice_mapper", "--timeout", "60"]);
    let until = |well: bool, expected: &str| {
        let begin = Instant::now();
        loop {
            let output = ask();
            let said = String::from_utf8_lossy(&output.stdout);
            if output.status.success() == well && said.contains(expected) {
                return;
            }
            assert!(begin.elapsed() < PATIENCE, "{expected}: {said}");
        }
    };
    until(false, "s ago: none received on /points_enu");
    let begin =
        "WARN lattice_mapper: inputs: no publisher on /points_enu (sensor_msgs/msg/PointCloud2)";
    until(false, begin);
    let runtime = Runtime::with_transport("driver", RosArgs::default(), &network).unwrap();
    let node = runtime.node("driver").unwrap();
    let points = node.publisher("points_enu", Qos::reliable(10)).unwrap();
    let frame = Arc::new(Mutex::new("velodyne"));
    let of = Arc::clone(&frame);
    let _timer = runtime.timer(Duration::from_millis(100), move || {
        let _ = points.publish(cloud(*of.lock().unwrap()));
    });
    until(
        false,
        "the last rejected: cloud in frame 'velodyne', expected 'map'",
    );
    *frame.lock().unwrap() = "map";
    until(true, "OK lattice_mapper: inputs: publishers on all topics");
    mapper.kill().unwrap();
    mapper.wait().unwrap();
}
