//! A managed node under the hands of a foreign manager.

use std::io::{Write, stderr};
use std::process::{Command, Stdio};

use lattice_runtime::LoopbackDomain;
use serde_json::{Value, json};

const MANAGER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../test/python/lifecycle_peer.py"
);

/// Numbers, names and order are those of `rcl_lifecycle`, `default_state_machine.c`, in Jazzy.
#[test]
fn a_managed_mapper_goes_through_the_states_of_rclcpp_lifecycle() {
    let Some(python) = std::env::var_os("LATTICE_PYTHON") else {
        let _ = writeln!(
            stderr(),
            "SKIPPED: LATTICE_PYTHON names no python with cyclonedds"
        );
        return;
    };
    let domain = LoopbackDomain::take().unwrap();
    let mut mapper = Command::new(env!("CARGO_BIN_EXE_lattice"))
        .args([
            "node",
            "lattice_mapper",
            "--ros-args",
            "-p",
            "managed:=true",
        ])
        .args(["-p", "cell_volume_m3:=0.125"])
        .env("ROS_DOMAIN_ID", domain.id().to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .spawn()
        .unwrap();
    let manager = Command::new(python)
        .arg(MANAGER)
        .arg(domain.id().to_string())
        .stderr(Stdio::inherit())
        .output();
    let _ = mapper.kill();
    let _ = mapper.wait();
    let manager = manager.unwrap();
    assert!(manager.status.success(), "{}", manager.status);
    let said: Value = serde_json::from_slice(&manager.stdout).unwrap();
    let states = "unknown unconfigured inactive active finalized configuring cleaningup \
                  shuttingdown activating deactivating errorprocessing";
    let ids = [0, 1, 2, 3, 4, 10, 11, 12, 13, 14, 15];
    let states = ids.into_iter().zip(states.split_whitespace());
    assert_eq!(said["states"], json!(states.collect::<Vec<_>>()));
    assert_eq!(said["graph"].as_array().map(Vec::len), Some(25));
    let configure = json!([[1, "configure", 10], [5, "shutdown", 12]]);
    assert_eq!(said["at first"], json!(["unconfigured", configure]));
    let refused = json!([false, "unconfigured"]);
    assert_eq!(
        (&said["activate too early"], &said["unknown"]),
        (&refused, &refused)
    );
    let fixed =
        "parameter 'max_map_bytes' cannot be set because it is read-only: the map is made with it";
    assert_eq!(said["set"], json!([[true, ""], [false, fixed]]));
    assert_eq!(
        (&said["used"], &said["set again"]),
        (&json!(1000), &json!([true, ""]))
    );
    let from_inactive = json!([[2, "cleanup", 11], [3, "activate", 13], [6, "shutdown", 12]]);
    assert_eq!(said["inactive"], from_inactive);
    for (step, state) in [
        ("configure", "inactive"),
        ("activate", "active"),
        ("deactivate", "inactive"),
        ("cleanup", "unconfigured"),
        ("shutdown", "finalized"),
    ] {
        assert_eq!(said[step], json!([true, state]), "{step}");
    }
    assert_eq!(said["again"], json!([[true, "inactive"], [true, "active"]]));
    assert_eq!(said["origin"], json!(48.1));
    assert_eq!(said["at last"], json!([]));
    let events = said["events"].as_array().unwrap();
    assert_eq!(events.len(), 14, "{events:?}");
    assert_eq!(
        events[0],
        json!(["configure", "unconfigured", "configuring"])
    );
    assert_eq!(
        events[1],
        json!(["transition_success", "configuring", "inactive"])
    );
    assert_eq!(
        events[13],
        json!(["transition_success", "shuttingdown", "finalized"])
    );
}
