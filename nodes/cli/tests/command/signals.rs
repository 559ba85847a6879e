//! Nodes that are ended by signals, as a terminal and `ros2 launch` send them.

use std::io::{BufRead, BufReader, Write, stderr};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use lattice_msgs::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use lattice_msgs::nav_msgs::OccupancyGrid;
use lattice_msgs::visualization_msgs::MarkerArray;
use lattice_runtime::qos::Qos;
use lattice_runtime::{LoopbackDomain, Runtime, Subscription, SubscriptionExecutor};
use serde_json::Value;
use wait_timeout::ChildExt;

use crate::names::peer;
use crate::nodes::simulated;
use crate::record::{expect, play, signal, start};
use crate::{PATIENCE, json};

/// Longest time that a peer may list a node after the signal. A stock node is gone after 0.03 s.
const LISTED: Duration = Duration::from_millis(500);

/// Longest time from the signal to the end of a process.
const END: Duration = Duration::from_secs(2);

const PEER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../test/python/node_list_peer.py"
);

#[test]
fn a_peer_over_fast_dds_lists_no_node_that_was_interrupted() {
    let Some(pythons) = std::env::var_os("LATTICE_ROS_PYTHON") else {
        let _ = writeln!(
            stderr(),
            "SKIPPED: LATTICE_ROS_PYTHON names no python with rclpy"
        );
        return;
    };
    for python in std::env::split_paths(&pythons) {
        lists_no_node_that_was_interrupted(&python);
    }
}

fn lists_no_node_that_was_interrupted(python: &Path) {
    let domain = LoopbackDomain::take().unwrap();
    let mut peer = Command::new(python)
        .args([PEER, &domain.id().to_string(), "lattice_mapper"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(peer.stdout.take().unwrap()).lines();
    let mut node = start(&domain, &["node", "lattice_mapper"]);
    assert_eq!(said.next().unwrap().unwrap(), "there");
    let interrupted = Instant::now();
    signal(&node, "-INT");
    assert_eq!(said.next().unwrap().unwrap(), "gone");
    let listed = interrupted.elapsed();
    assert!(listed < LISTED, "listed for {listed:?}");
    assert!(node.wait().unwrap().success());
    let ended = interrupted.elapsed();
    assert!(peer.wait().unwrap().success());
    let _ = writeln!(stderr(), "listed for {listed:?}, ended after {ended:?}");
}

#[test]
fn two_interrupts_at_once_are_one() {
    let domain = LoopbackDomain::take().unwrap();
    let runtime = peer(&domain);
    let (_diagnostics, stated) = diagnostics(&runtime);
    let mut node = start(&domain, &["node", "lattice_mapper"]);
    let is_its = |status: &DiagnosticStatus| status.name.starts_with("lattice_mapper: ");
    while !stated
        .recv_timeout(PATIENCE)
        .unwrap()
        .status
        .iter()
        .any(is_its)
    {}
    let id = node.id().to_string();
    let both = Command::new("kill")
        .args(["-INT", &id, &id])
        .status()
        .unwrap();
    assert!(both.success());
    let status = node.wait_timeout(PATIENCE).unwrap().unwrap();
    assert!(status.success(), "{status}");
}

/// Diagnostics of all nodes from now on.
fn diagnostics(runtime: &Runtime) -> (Subscription, Receiver<Arc<DiagnosticArray>>) {
    let node = runtime.node("peer").unwrap();
    let (state, stated) = channel();
    let hear = move |all: Arc<DiagnosticArray>| drop(state.send(all));
    let shared = SubscriptionExecutor::Shared;
    let subscription = node.subscribe("/diagnostics", Qos::DIAGNOSTICS, shared, hear);
    (subscription.unwrap(), stated)
}

/// Interrupts a node, which must end in time; its report.
fn interrupted(node: Child, report: &Path) -> Value {
    end(node);
    serde_json::from_slice(&std::fs::read(report).unwrap()).unwrap()
}

/// Interrupts a node, which must end in time.
fn end(mut node: Child) {
    let begin = Instant::now();
    signal(&node, "-INT");
    let status = node.wait_timeout(PATIENCE).unwrap().unwrap();
    let ended = begin.elapsed();
    let _ = writeln!(stderr(), "ended after {ended:?}");
    assert!(status.success() && ended < END, "{status} after {ended:?}");
}

/// Writes the map of a cube of points 1 m apart as the autosave of a mapper; the number of its voxels.
pub fn grid_map(folder: &Path, edge: u32) -> u64 {
    let path = |name: &str| folder.join(name).display().to_string();
    let (points, map) = (path("grid.bin"), path("autosave.lattice"));
    let place = |i: u32| [i % edge, i / edge % edge, i / (edge * edge)].map(|v| v as f32 + 0.3);
    let numbers = (0..edge.pow(3)).flat_map(|i| place(i).into_iter().chain([0.0]));
    let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
    std::fs::write(&points, bytes).unwrap();
    let cubes = ["--lattice", "cubic", "--cell-size", "1"];
    json(&[&["quantize", &points, "--map-out", &map], &cubes[..]].concat());
    u64::from(edge.pow(3))
}

#[test]
fn a_mapper_of_two_million_voxels_ends_in_time_with_its_report() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let cells = grid_map(folder.path(), 128);
    let domain = LoopbackDomain::take().unwrap();
    let report = path("report");
    let params = [
        "lattice:=cubic".to_owned(),
        "cell_volume_m3:=1.0".to_owned(),
        format!("map_dir:={}", folder.path().display()),
        "resume:=true".to_owned(),
        format!("report_file:={report}"),
    ];
    let params = params.iter().flat_map(|param| ["-p", param]);
    let node = ["node", "lattice_mapper", "--ros-args"].into_iter();
    let mut mapper = start(&domain, &node.chain(params).collect::<Vec<_>>());
    expect(&mut mapper, &["resumed with"]);
    let report = interrupted(mapper, Path::new(&report));
    assert_eq!(report["voxels"], cells);
    assert_eq!(report["counts"]["keyframes"], 0);
}

/// Starts a node in a namespace, whose report has its name.
fn launch(
    domain: &LoopbackDomain,
    folder: &Path,
    [name, namespace]: [&str; 2],
    params: &[&str],
) -> Child {
    let report_file = format!("report_file:={}", folder.join(name).display());
    let namespace = format!("__ns:={namespace}");
    let params = params.iter().copied().chain([&*report_file]);
    let params = params.flat_map(|param| ["-p", param]);
    let node = ["node", name, "--ros-args", "-r", &namespace].into_iter();
    start(domain, &node.chain(params).collect::<Vec<_>>())
}

/// Each node that follows a map of two million voxels, while others draw it, ends in time.
#[test]
fn followers_of_two_million_voxels_end_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let cells = grid_map(folder.path(), 128);
    let domain = LoopbackDomain::take().unwrap();
    let runtime = peer(&domain);
    let node = runtime.node("peer").unwrap();
    let (_diagnostics, stated) = diagnostics(&runtime);
    // What is subscribed to is drawn.
    let drawn = |_: Arc<MarkerArray>| {};
    let dedicated = SubscriptionExecutor::Dedicated;
    let markers = node.subscribe("/robot/voxel_markers", Qos::MARKERS, dedicated, drawn);
    let _markers = markers.unwrap();
    let drawn = |_: Arc<OccupancyGrid>| {};
    let grids = node.subscribe("/robot/projected_map", Qos::LATCHED, dedicated, drawn);
    let _grids = grids.unwrap();

    let report = |name: &str| folder.path().join(name);
    let launch = |name: &str, namespace: &str, params: &[&str]| {
        launch(&domain, folder.path(), [name, namespace], params)
    };
    // Each with its task, and the value there that counts the voxels of its map.
    let followers = [
        ("voxel_marker_publisher", "/robot", "markers", "voxels"),
        ("semantic_icp_server", "/robot", "calibration", "map_voxels"),
        ("map_projector", "/robot", "grid", "voxels"),
        ("map_merger", "/", "merged map", "voxels"),
    ];
    let started = followers.map(|(name, namespace, ..)| {
        let params: &[&str] = match name {
            "map_merger" => &["robots:=[robot]"],
            _ => &[],
        };
        let mut follower = launch(name, namespace, params);
        expect(&mut follower, &[name]);
        follower
    });
    let map_dir = format!("map_dir:={}", folder.path().display());
    let of_cubes = ["lattice:=cubic", "cell_volume_m3:=1.0", "resume:=true"];
    let params = [&of_cubes[..], &[&map_dir]].concat();
    let mut mapper = launch("lattice_mapper", "/robot", &params);
    expect(&mut mapper, &["resumed with"]);
    let all = cells.to_string();
    for ((name, _, task, key), follower) in followers.into_iter().zip(started) {
        let late = Instant::now() + PATIENCE;
        let has_all = |message: &DiagnosticArray| {
            let mut of_task = message.status.iter();
            let status = of_task.find(|of| of.name.ends_with(&format!("{name}: {task}")));
            let mut values = status.into_iter().flat_map(|status| &status.values);
            values.any(|value| value.key == key && value.value == all)
        };
        while !has_all(&stated.recv_timeout(PATIENCE).unwrap()) {
            assert!(Instant::now() < late, "{name} has no map");
        }
        let report = interrupted(follower, &report(name));
        let counted = report.get(key).unwrap_or(&report["counts"][key]);
        assert_eq!(*counted, cells, "{name}: {report}");
    }
    interrupted(mapper, &report("lattice_mapper"));
}

/// Nodes that are still reading a map of two million voxels leave the rest of it out.
#[test]
fn followers_in_the_middle_of_a_map_end_in_time() {
    let folder = tempfile::tempdir().unwrap();
    grid_map(folder.path(), 128);
    let domain = LoopbackDomain::take().unwrap();
    let runtime = peer(&domain);
    let node = runtime.node("peer").unwrap();
    // Markers that nobody subscribes to are not drawn.
    let drawn = |_: Arc<MarkerArray>| {};
    let dedicated = SubscriptionExecutor::Dedicated;
    let markers = node.subscribe("/robot/voxel_markers", Qos::MARKERS, dedicated, drawn);
    let _markers = markers.unwrap();
    let map_dir = format!("map_dir:={}", folder.path().display());
    let of_cubes = ["lattice:=cubic", "cell_volume_m3:=1.0", "resume:=true"];
    let params = [&of_cubes[..], &[&map_dir]].concat();
    let mut mapper = launch(
        &domain,
        folder.path(),
        ["lattice_mapper", "/robot"],
        &params,
    );
    expect(&mut mapper, &["resumed with"]);
    for (name, namespace, task, left_out) in [
        (
            "voxel_marker_publisher",
            "/robot",
            "markers",
            "voxels_not_drawn",
        ),
        ("map_merger", "/", "merged map", "voxels_not_merged"),
    ] {
        let (_diagnostics, stated) = diagnostics(&runtime);
        let params: &[&str] = match name {
            "map_merger" => &["robots:=[robot]"],
            _ => &[],
        };
        let mut follower = launch(&domain, folder.path(), [name, namespace], params);
        let lines = expect(&mut follower, &[]);
        let late = Instant::now() + PATIENCE;
        let has_begun = |message: &DiagnosticArray| {
            let mut of_task = message.status.iter();
            let status = of_task.find(|of| of.name.ends_with(&format!("{name}: {task}")));
            let mut values = status.into_iter().flat_map(|status| &status.values);
            values.any(|value| value.key == "messages_in" && value.value != "0")
        };
        while !has_begun(&stated.recv_timeout(PATIENCE).unwrap()) {
            assert!(Instant::now() < late, "{name} has no map");
        }
        end(follower);
        let Ok(report) = std::fs::read(folder.path().join(name)) else {
            // A starved node abandons the piece that it is in, and says so.
            let lines = lines.join().unwrap();
            let abandoned = "in the middle of its work and without a report";
            assert!(
                lines.iter().any(|line| line.contains(abandoned)),
                "{lines:?}"
            );
            continue;
        };
        let report: Value = serde_json::from_slice(&report).unwrap();
        assert!(report[left_out].is_u64(), "{report}");
    }
    interrupted(mapper, &folder.path().join("lattice_mapper"));
}

#[test]
fn a_player_ends_in_time_at_full_rate_beside_a_follower_that_acknowledges_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let log = simulated(folder.path(), "mcap", "3");
    let domain = LoopbackDomain::take().unwrap();
    let mut follower = start(&domain, &["node", "enu_transformer"]);
    let report = folder.path().join("report");
    let params = [
        "rate:=1000.0".to_owned(),
        "loop:=true".to_owned(),
        "wait_for_subscribers:=[/tf]".to_owned(),
        format!("report_file:={}", report.display()),
    ];
    let params: Vec<&str> = params.iter().map(String::as_str).collect();
    let mut player = play(&domain, &log, &params);
    expect(&mut player, &["the log restarts"]);
    signal(&follower, "-STOP");
    let report = interrupted(player, &report);
    assert_ne!(report["unacknowledged"], 0, "{report}");
    signal(&follower, "-KILL");
    follower.wait().unwrap();
}
