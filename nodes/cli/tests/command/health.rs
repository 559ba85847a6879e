//! `lattice health` beside a node that is well, one that is not, and none.

use std::process::{Command, Output};
use std::time::Duration;

use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime};

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
        !silent.status.success() && words.contains("no word"),
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
    } // Each of those that publish is heard, not the first alone.
    let output = health(&domain, &["--timeout", "60"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(!output.status.success(), "{said}");
    for words in ["well: transport", "no disk"] {
        assert!(said.contains(words), "{said}");
    }
}
