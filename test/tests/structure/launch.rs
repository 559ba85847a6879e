//! Launch files start nodes that there are, with arguments that they declare.

use std::collections::BTreeMap;
use std::process::Command;

use lattice_nodes::executables::NODES;
use lattice_test::python::{python, script};

use super::root;

#[test]
fn launch_files_start_the_nodes_that_there_are() {
    let Some(python) = python() else { return };
    let folder = root().join("nodes/launch");
    let output = Command::new(python)
        .arg(script("launch_check.py"))
        .arg(&folder)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let found: BTreeMap<String, Vec<[String; 2]>> = serde_json::from_slice(&output.stdout).unwrap();
    for (file, nodes) in &found {
        assert!(!nodes.is_empty(), "{file}");
        for [executable, _] in nodes {
            let mut known = NODES.iter().map(|(name, _)| *name).chain(["bag_player"]);
            assert!(known.any(|name| name == executable), "{file}: {executable}");
        }
        let other = match file.strip_suffix(".py") {
            Some(name) => format!("{name}.xml"),
            None => file.replace(".xml", ".py"),
        };
        assert_eq!(found.get(&other), Some(nodes), "{file} and {other}");
    }
}
