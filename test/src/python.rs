//! Programs of foreign peers: interpreters of Python, and those of `test/zenoh_peers`.

use std::io::Write;
use std::path::{Path, PathBuf};

/// The interpreter that `LATTICE_PYTHON` names, one with `test/python/requirements.txt` installed.
///
/// Without the variable, a line on standard error says so and the caller returns: such a test needs
/// packages that cargo does not bring.
pub fn python() -> Option<PathBuf> {
    named("LATTICE_PYTHON", "requirements.txt")
}

/// The interpreters that `LATTICE_ROS_PYTHON` names, separated by colons: each has the rclpy of one distribution,
/// such as `test/python/requirements-jazzy.txt` installs. None: as of [`python`].
pub fn ros_pythons() -> Vec<PathBuf> {
    let all = named("LATTICE_ROS_PYTHON", "requirements-jazzy.txt");
    all.map_or_else(Vec::new, |all| std::env::split_paths(&all).collect())
}

/// The interpreter that `LATTICE_ZENOH_PYTHON` names, one with `test/python/requirements-zenoh.txt` installed. None: as
/// of [`python`].
pub fn zenoh_python() -> Option<PathBuf> {
    named("LATTICE_ZENOH_PYTHON", "requirements-zenoh.txt")
}

/// The program of `test/zenoh_peers`, a node of ros2-client over Zenoh, that `LATTICE_ZENOH_PEER` names. None: as of [`python`].
pub fn zenoh_peer() -> Option<PathBuf> {
    program("LATTICE_ZENOH_PEER", "the program of test/zenoh_peers")
}

/// The router of the crate `zenohd` that `LATTICE_ZENOHD` names. None: as of [`python`].
pub fn zenohd() -> Option<PathBuf> {
    program("LATTICE_ZENOHD", "the router of the crate zenohd")
}

fn named(variable: &str, requirements: &str) -> Option<PathBuf> {
    let requirements = script(requirements);
    let what = format!("a python with {} installed", requirements.display());
    program(variable, &what)
}

fn program(variable: &str, what: &str) -> Option<PathBuf> {
    let Some(program) = std::env::var_os(variable) else {
        let test = std::thread::current().name().unwrap_or_default().to_owned();
        // Not eprintln: the test harness would keep it to itself.
        let _ = writeln!(
            std::io::stderr(),
            "SKIPPED {test}: {variable} is not set; have it name {what}"
        );
        return None;
    };
    Some(program.into())
}

/// Path of a file in `test/python/`.
pub fn script(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("python")
        .join(name)
}
