//! `bag_player` under the hands of a foreign client.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_bag::BagReader;
use lattice_msgs::sensor_msgs::PointCloud2;
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime, SubscriptionExecutor};
use serde_json::{Value, json};
use wait_timeout::ChildExt;

use crate::nodes::simulated;
use crate::record::{play, start};
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

#[test]
fn in_lockstep_each_message_waits_for_the_answer_to_the_one_before() {
    let directory = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let log = simulated(directory.path(), "mcap", "2");
    let bag = BagReader::open(log.as_ref()).unwrap();
    let mut topics = bag.topics().iter();
    let of_left = topics.find(|topic| topic.name == "/left/points").unwrap();
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    let runtime = Runtime::with_transport("answering", RosArgs::default(), &network).unwrap();
    let node = runtime.node("answering").unwrap();
    let answers = node.publisher("/answers", Qos::latched(10)).unwrap();
    let (told, clouds) = channel();
    let handler = move |cloud: Arc<PointCloud2>| drop(told.send(cloud));
    let qos = Qos::reliable(1000);
    let _clouds = node.subscribe(
        "/left/points",
        qos,
        SubscriptionExecutor::Dedicated,
        handler,
    );
    // Far faster than anybody answers.
    let parameters = [
        "lockstep:=['/left/points', '/answers']",
        "wait_for_subscribers:=['/left/points']",
        "qos./left/points.reliability:=reliable",
        "rate:=1000.0",
        "max_wait_s:=600.0",
    ];
    let mut player = play(&domain, &log, &parameters);
    drop(player.stderr.take());
    for number in 0..of_left.message_count {
        let cloud = clouds.recv_timeout(PATIENCE).unwrap();
        if number < 5 {
            let early = clouds.recv_timeout(Duration::from_millis(50));
            assert!(early.is_err(), "{number}: another one before the answer");
        }
        let header = cloud.header.clone();
        let answer = PointCloud2 {
            header,
            ..PointCloud2::default()
        };
        answers.publish(answer).unwrap();
    }
    let status = player.wait_timeout(PATIENCE).unwrap();
    assert!(status.is_some_and(|status| status.success()), "{status:?}");
    for (pair, words) in [
        ("['/left/points', '/nowhere']", "no publisher on '/nowhere'"),
        ("['/nothing', '/answers']", "'/nothing' is not played"),
        ("['/left/points']", "expected pairs"),
    ] {
        let pair = format!("lockstep:={pair}");
        let player = play(&domain, &log, &[&pair, "wait_timeout_s:=0.2"]);
        let output = player.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        let refused = !output.status.success() && said.contains(words);
        assert!(refused && said.contains("lockstep"), "{pair}: {said}");
    }
}
