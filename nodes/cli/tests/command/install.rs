//! Needs of packages: licences, the report to a service manager, and places of files.

use std::fs;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::{Child, Command};

use lattice_runtime::LoopbackDomain;
use wait_timeout::ChildExt;

use crate::record::{expect, signal, spawn};
use crate::{PATIENCE, error, text};

#[test]
fn licences_are_said_to_be_missing_in_a_build_from_the_source() {
    let about = text(&["about"]);
    assert!(about.contains(concat!("lattice ", env!("CARGO_PKG_VERSION"))));
    assert!(about.contains("viewer") && about.contains(".ci/licences"));
    let error = error(&["about", "--licences"]);
    assert!(error.contains("share/lattice/licences.txt") && error.contains(".ci/licences"));
}

/// Starts a mapper by a parameter file in the folder, with a socket of a service manager.
fn run_with_manager(folder: &Path, domain: &LoopbackDomain, socket: &Path) -> Child {
    let params = folder.join("robot.yaml");
    fs::write(
        &params,
        "/**/lattice_mapper:\n  ros__parameters:\n    lattice: fcc\n",
    )
    .unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
    command.arg("run").arg(&params);
    spawn(domain, command.env("NOTIFY_SOCKET", socket))
}

fn ends_by_a_signal(mut nodes: Child) {
    signal(&nodes, "-TERM");
    let status = nodes.wait_timeout(PATIENCE).unwrap().unwrap();
    assert!(status.success(), "{status}");
}

#[test]
fn nodes_report_to_a_service_manager_that_they_have_started() {
    let folder = tempfile::tempdir().unwrap();
    let socket = folder.path().join("notify");
    let manager = UnixDatagram::bind(&socket).unwrap();
    manager.set_read_timeout(Some(PATIENCE)).unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let nodes = run_with_manager(folder.path(), &domain, &socket);
    let mut report = [0; 64];
    let length = manager.recv(&mut report).unwrap();
    assert_eq!(&report[..length], b"READY=1");
    ends_by_a_signal(nodes);
}

#[test]
fn nodes_run_without_the_service_manager_that_the_environment_names() {
    let folder = tempfile::tempdir().unwrap();
    let domain = LoopbackDomain::take().unwrap();
    let socket = folder.path().join("missing");
    let mut nodes = run_with_manager(folder.path(), &domain, &socket);
    let _rest = expect(&mut nodes, &["[WARN]", "NOTIFY_SOCKET="]);
    ends_by_a_signal(nodes);
}

#[test]
fn a_demo_writes_to_a_folder_of_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let demo = Command::new(env!("CARGO_BIN_EXE_lattice"))
        .args(["demo", "--duration", "2", "--lattice", "fcc", "--no-view"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(demo.status.success(), "{demo:?}");
    let written: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(written.len(), 1);
    assert!(folder.path().join("lattice_demo/map.lattice").exists());
}
