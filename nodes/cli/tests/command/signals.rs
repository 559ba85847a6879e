//! Nodes that are ended by signals, as a terminal and `ros2 launch` send them.

use std::io::{BufRead, BufReader, Write, stderr};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use lattice_runtime::LoopbackDomain;
use wait_timeout::ChildExt;

use crate::PATIENCE;
use crate::record::{expect, signal, start};

/// Longest time that a peer may list a node after the signal. A stock node is gone after 0.03 s.
const LISTED: Duration = Duration::from_millis(500);

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
    let mut node = start(&domain, &["node", "lattice_mapper"]);
    expect(&mut node, &["lattice_mapper"]);
    let id = node.id().to_string();
    let both = Command::new("kill")
        .args(["-INT", &id, &id])
        .status()
        .unwrap();
    assert!(both.success());
    let status = node.wait_timeout(PATIENCE).unwrap().unwrap();
    assert!(status.success(), "{status}");
}
