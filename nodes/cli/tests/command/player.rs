//! `bag_player` under the hands of a foreign client.

use std::process::{Command, Stdio};

use lattice_bag::BagReader;
use lattice_runtime::LoopbackDomain;
use serde_json::{Value, json};

use crate::nodes::simulated;
use crate::python;

const CLIENT: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../test/python/player_peer.py"
);

#[test]
fn a_player_obeys_the_services_of_rosbag2() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let log = simulated(directory.path(), "mcap", "4");
    let first_ns = BagReader::open(log.as_ref()).unwrap().start_ns().unwrap();
    let params = format!("bag:={log} start_paused:=true clock_hz:=100.0");
    let params = params.split(' ').flat_map(|param| ["-p", param]);
    let mut player = Command::new(env!("CARGO_BIN_EXE_lattice"))
        .args(["node", "bag_player", "--ros-args"])
        .args(params)
        .env("ROS_DOMAIN_ID", domain.id().to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .spawn()
        .unwrap();
    let client = Command::new(python)
        .arg(CLIENT)
        .args([domain.id().to_string(), first_ns.to_string()])
        .stderr(Stdio::inherit())
        .output();
    let client = client.unwrap();
    let stopped = client.status.success() && player.wait().unwrap().success();
    let _ = player.kill();
    let _ = player.wait();
    assert!(stopped, "{}", client.status);
    let said: Value = serde_json::from_slice(&client.stdout).unwrap();
    let expected = json!([
        ["is_paused", true],
        ["set_rate", false],
        ["set_rate", false],
        ["set_rate", true],
        ["get_rate", 2.0],
        ["play_next", true],
        ["burst", 500],
        ["seek", false],
        ["seek", false],
        ["seek", true],
        ["toggle_paused", 0],
        ["play_next", false],
        ["pause", 0],
        ["is_paused", true],
        ["resume", 0],
        ["is_paused", false],
        ["play", false],
        ["pause", 0],
        ["play", false],
        ["play", true],
        ["pause", 0],
        ["stop", 0],
    ]);
    assert_eq!(said, expected);
}
