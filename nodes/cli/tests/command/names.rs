//! Names that nothing answers to: parameters, nodes, topics.

use std::process::{Command, Stdio};
use std::time::Instant;

use lattice_msgs::sensor_msgs::{LaserScan, PointCloud2};
use lattice_runtime::env::Network;
use lattice_runtime::qos::Qos;
use lattice_runtime::ros_args::RosArgs;
use lattice_runtime::{LoopbackDomain, Runtime};

use crate::record::{PEER, expect, start};
use crate::{PATIENCE, error, python, refused};

const PARAMS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/bobcat.yaml");

#[test]
fn unknown_parameters_are_refused_by_every_command() {
    let latice = ["--ros-args", "-p", "latice:=bcc"];
    let commands: [&[&str]; 3] = [
        &["node", "lattice_mapper"],
        &["run", PARAMS, "--"],
        &["view", PARAMS, "--"],
    ];
    for command in commands {
        let line = error(&[command, &latice].concat());
        let expected = "parameter 'latice' of lattice_mapper is unknown; did you mean 'lattice'?\n";
        assert!(line.ends_with(expected), "{command:?}: {line}");
    }
    for direct in [&["--direct"][..], &[]] {
        let replay = ["replay", "nowhere", "-p", "latice:=bcc"];
        let line = error(&[&replay[..], direct].concat());
        assert!(line.contains("did you mean 'lattice'?"), "{line}");
        let replay = ["replay", "nowhere", "-p", "lattice_maper:lattice:=bcc"];
        let line = error(&[&replay[..], direct].concat());
        assert!(line.contains("did you mean 'lattice_mapper'?"), "{line}");
    }
    for (command, expected) in [
        (
            &["node", "bag_player", "--ros-args", "-p", "rat:=2.0"][..],
            "parameter 'rat' of bag_player is unknown; did you mean 'rate'?",
        ),
        (
            &["record", "-a", "--", "--ros-args", "-p", "storage:=mcap"],
            "parameter 'storage' of bag_recorder is unknown; `lattice record --help`",
        ),
        (
            &["run", PARAMS, "--only", "enu_tranformer"],
            "no node 'enu_tranformer' (`--only`); did you mean 'enu_transformer'?",
        ),
    ] {
        let line = error(command);
        assert!(line.contains(expected), "{line}");
    }
}

#[test]
fn values_out_of_range_are_refused_with_their_range() {
    for (node, wanted, expected) in [
        (
            "lattice_mapper",
            "max_message_bytes:=1",
            "`max_message_bytes` of /lattice_mapper = 1 (from the command line): expected a number from 1000 to 4294967295",
        ),
        (
            "enu_transformer",
            "points_topics:=[]",
            "`points_topics` of /enu_transformer = [] (from the command line): expected at least one topic",
        ),
        (
            "bag_player",
            "duration_s:=-1.0",
            "`duration_s` of /bag_player = -1.0 (from the command line): expected a number from 0.0 to 1000000000.0",
        ),
        (
            "map_merger",
            "robots:=[]",
            "`robots` of /map_merger = [] (from the command line): expected names of robots, each once",
        ),
        (
            "lattice_mapper",
            "max_voxels:=0",
            "`max_voxels` of /lattice_mapper = 0 (from the command line): expected 1 or more",
        ),
    ] {
        let output = refused(&["node", node, "--ros-args", "-p", wanted]);
        // Behind what is said of sockets, if anything is.
        let said = String::from_utf8(output.stderr).unwrap();
        let line = said.lines().last().unwrap();
        assert!(line.contains(expected), "{line}");
    }
}

#[test]
fn files_are_checked_by_section() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("robot.yaml");
    let path = at.display().to_string();
    let refused = |yaml: &str, commands: &[&[&str]], expected: &str| {
        std::fs::write(&at, yaml).unwrap();
        for command in commands {
            let line = error(command);
            assert!(line.contains(expected), "{command:?}: {line}");
        }
    };
    let (run, view) = (["run", &path], ["view", &path]);
    let replay = ["replay", "nowhere", "--direct", "--params", &path];
    let node = [
        "node",
        "lattice_mapper",
        "--ros-args",
        "--params-file",
        &path,
    ];
    let all: [&[&str]; 4] = [&run, &view, &replay, &node];
    let section = |of: &str, what: &str| format!("{of}: {{ros__parameters: {{{what}}}}}\n");
    refused(
        &section("/**/lattice_mapper", "latice: bcc"),
        &all,
        "`/**/lattice_mapper.ros__parameters.latice`); did you mean 'lattice'?",
    );
    refused(
        &section("/**/latice_mapper", "lattice: bcc"),
        &all,
        "names an unknown node; did you mean 'lattice_mapper'?",
    );
    let two = section("/**/lattice_mapper", "lattice: bcc") + &section("/**", "latice: bcc");
    refused(&two, &all[..3], "did you mean 'lattice'?");
}

/// A runtime of another process than that of the nodes.
pub fn peer(domain: &LoopbackDomain) -> Runtime {
    let network = Network {
        domain_id: domain.id(),
        localhost_only: true,
        ..Network::from_env().unwrap()
    };
    Runtime::with_transport("peer", RosArgs::default(), &network).unwrap()
}

/// Asks for the health of the transformer until its diagnostics have all of these.
fn stated(domain: &LoopbackDomain, expected: &[&str]) {
    let begin = Instant::now();
    loop {
        let child = start(domain, &["health", "enu_transformer", "--timeout", "60"]);
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        if expected.iter().all(|text| said.contains(text)) {
            return;
        }
        assert!(begin.elapsed() < PATIENCE, "{said}");
    }
}

#[test]
fn a_topic_without_publisher_is_named_beside_others_of_its_type() {
    let domain = LoopbackDomain::take().unwrap();
    let peer = peer(&domain);
    let node = peer.node("peer").unwrap();
    let clouds = ["/velodyne_points", "/map_centers"];
    let _scan = node.publisher::<LaserScan>("/scan", Qos::SCANS).unwrap();
    let _clouds = clouds.map(|topic| node.publisher::<PointCloud2>(topic, Qos::SCANS).unwrap());
    let odometry = "nav_msgs/msg/Odometry";
    let _odometry = node.raw_publisher("/points", odometry, None, Qos::DEFAULT);
    let names = "-p ins.source:=odometry -p ins.topic:=odom --params-file";
    let folder = tempfile::tempdir().unwrap();
    // As ros2 launch gives one file to all nodes.
    let shared = folder.path().join("nav2.yaml");
    let text = "/**: {ros__parameters: {robot_name: rex, use_sim_time: false}}\n\
                controller_server: {ros__parameters: {controller_frequency: 20.0}}\n";
    std::fs::write(&shared, text).unwrap();
    let shared = shared.display().to_string();
    let node = ["node", "enu_transformer", "--ros-args"].into_iter();
    let node: Vec<_> = node.chain(names.split(' ')).chain([&*shared]).collect();
    let mut transformer = start(&domain, &node);
    expect(
        &mut transformer,
        &[
            "parameter 'robot_name' of enu_transformer is unknown",
            "[WARN]",
            "no publisher on /points (sensor_msgs/msg/PointCloud2) after 3 s",
            "no publisher on /odom (nav_msgs/msg/Odometry) after 3 s",
            "no publisher on /points; of other types of clouds there are: /scan (sensor_msgs/msg/LaserScan); remap \
             with -r points:=TOPIC, or set points_topics",
        ],
    );
    stated(
        &domain,
        &[
            "WARN enu_transformer: inputs: ",
            "no publisher on /points (sensor_msgs/msg/PointCloud2) after 3 s; of that type there are: \
             /velodyne_points; remap with -r points:=/velodyne_points or set points_topics; /points is \
             published as nav_msgs/msg/Odometry",
            "no publisher on /odom (nav_msgs/msg/Odometry) after 3 s; of that type there are: /points; ",
        ],
    );
    transformer.kill().unwrap();
    transformer.wait().unwrap();
}

#[test]
fn a_foreign_publisher_of_another_type_is_named() {
    let Some(python) = python() else { return };
    let domain = LoopbackDomain::take().unwrap();
    let mut peer = Command::new(python)
        .args([PEER, "talk", &domain.id().to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let said = [
        "node",
        "enu_transformer",
        "--ros-args",
        "-p",
        "points_topics:=[said]",
    ];
    let mut transformer = start(&domain, &said);
    expect(&mut transformer, &["no publisher on /said "]);
    stated(&domain, &["; /said is published as std_msgs/msg/String"]);
    for child in [&mut transformer, &mut peer] {
        child.kill().unwrap();
        child.wait().unwrap();
    }
}
