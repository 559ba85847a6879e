//! `bag_player` under the hands of a foreign client.

use std::process::{Command, Stdio};

use lattice_bag::BagReader;
use lattice_runtime::LoopbackDomain;
use serde_json::{Value, json};
use wait_timeout::ChildExt;

use crate::nodes::simulated;
use crate::record::start;
use crate::{PATIENCE, python};

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

#[test]
fn a_renamed_player_and_recorder_take_what_is_under_their_name_in_the_code() {
    let directory = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let file = directory.path().join("params.yaml").display().to_string();
    let bag = directory.path().join("bag").display().to_string();
    let ros_args = ["--ros-args", "-r", "__node:=other", "--params-file", &file];
    let player = [&["node", "bag_player"], &ros_args[..]].concat();
    let recorder = [&["record", "-a", "-o", &bag, "--"], &ros_args[..]].concat();
    for (name, arguments, wrong) in [
        ("bag_player", player, "rate: -1.0"),
        ("bag_recorder", recorder, "max_message_bytes: 0"),
    ] {
        let text = format!("{name}:\n  ros__parameters:\n    {wrong}\n");
        std::fs::write(&file, text).unwrap();
        let mut node = start(&domain, &arguments);
        // One that passes the file over plays nothing, or records until it is stopped.
        let status = node.wait_timeout(PATIENCE).unwrap();
        let _ = node.kill();
        let said = node.wait_with_output().unwrap().stderr;
        let said = String::from_utf8_lossy(&said);
        let (parameter, _) = wrong.split_once(':').unwrap();
        assert!(status.is_some_and(|status| !status.success()), "{said}");
        assert!(said.contains(parameter), "{said}");
    }
}
