//! Crates depend on each other one way.

use std::process::Command;

use serde_json::Value;

use super::root;

/// Every crate, and the crates of ours that it may use.
const EDGES: [(&str, &str); 11] = [
    ("lattice_core", ""),
    ("lattice_msgs", "lattice_msgs_generator"),
    ("lattice_msgs_generator", ""),
    ("lattice_bag", ""),
    ("lattice_cyclone_sys", ""),
    ("lattice_runtime", "lattice_cyclone_sys lattice_msgs"),
    (
        "lattice_nodes",
        "lattice_bag lattice_core lattice_msgs lattice_runtime",
    ),
    (
        "lattice_lab",
        "lattice_bag lattice_core lattice_msgs lattice_nodes lattice_runtime",
    ),
    (
        "lattice",
        "lattice_bag lattice_core lattice_lab lattice_msgs lattice_nodes lattice_runtime",
    ),
    (
        "lattice_test",
        "lattice_bag lattice_core lattice_lab lattice_msgs lattice_msgs_generator lattice_nodes lattice_runtime",
    ),
    ("lattice_test_ros2_client", "lattice_msgs lattice_runtime"),
];

/// Crates that a robot's build is spared: bags, pictures, plots, meshes.
const NOT_ON_A_ROBOT: &str = "async-tungstenite base64 bzip2 fast-surface-nets httparse lattice_bag lattice_lab mcap obvhs \
                              plotters png rusqlite";

/// Output of a cargo command. It may have to download crates: a build gets only those of its own platform.
pub fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .arg("--locked")
        .current_dir(root())
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn dependencies_point_one_way() {
    let metadata = cargo(&["metadata", "--no-deps", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&metadata).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    assert_eq!(packages.len(), EDGES.len());
    for package in packages {
        let name = package["name"].as_str().unwrap();
        let (_, allowed) = EDGES.iter().find(|(of, _)| *of == name).unwrap();
        for dependency in package["dependencies"].as_array().unwrap() {
            let on = dependency["name"].as_str().unwrap();
            let ours = EDGES.iter().any(|(of, _)| *of == on);
            let is_allowed = allowed.split(' ').any(|allowed| allowed == on);
            assert!(!ours || is_allowed, "{name} depends on {on}");
            let dds = ["ros2-client", "rustdds"].contains(&on);
            assert!(
                !dds || name == "lattice_test_ros2_client",
                "{name} depends on {on}"
            );
        }
    }
}

#[test]
fn a_robot_builds_only_what_a_robot_needs() {
    let tree = |more: &[&str]| {
        let tree = [
            "tree", "-p", "lattice", "-e", "normal", "--prefix", "none", "--format", "{p}",
        ];
        cargo(&[&tree, more].concat())
    };
    let has = |tree: &str, name: &str| {
        tree.lines()
            .any(|line| line.split(' ').next() == Some(name))
    };
    let (robot, all) = (tree(&["--no-default-features"]), tree(&[]));
    for name in NOT_ON_A_ROBOT.split(' ') {
        assert!(!has(&robot, name), "a robot builds {name}");
        assert!(
            has(&all, name),
            "{name} is not in any build: strike it off this list"
        );
    }
}
