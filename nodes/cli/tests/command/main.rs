//! The `lattice` command as a user runs it.
#![allow(clippy::unwrap_used)]

mod attitude;
mod bag_info;
mod beside_nav2;
mod browser;
mod calibrate;
mod demo;
mod depth_logs;
mod doctor;
mod driver_logs;
mod elevation_map;
mod evaluate;
mod files;
mod health;
mod indoor;
mod install;
mod lifecycle;
mod map;
mod map_save;
mod merger;
mod mounts;
mod names;
mod nodes;
mod odd;
mod pages;
mod paper;
mod player;
mod player_services;
mod point_files;
mod record;
mod respawn;
mod signals;
mod stamps;
mod streams;
mod unsent;
mod versions;
mod viewer;
mod viewer_colors;
mod viewer_foreign;
mod viewer_headset;
mod viewer_hostile;
mod viewer_layout;
mod viewer_mixed;
mod viewer_page;
mod viewer_planning;
mod viewer_survey;
mod viewer_tls;
mod viewer_words;
mod viewer_writing;

use std::io::{Write, stderr};
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use wait_timeout::ChildExt;

/// Long enough for a loaded machine; a test that passes does not wait for it.
const PATIENCE: Duration = Duration::from_secs(120);

/// A Python with the foreign peers; a line says where there is none.
fn python() -> Option<PathBuf> {
    let python = std::env::var_os("LATTICE_PYTHON");
    if python.is_none() {
        let _ = writeln!(
            stderr(),
            "SKIPPED: LATTICE_PYTHON names no python with cyclonedds"
        );
    }
    python.map(PathBuf::from)
}

fn lattice(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
    // Each replay takes a domain of its own.
    command.args(arguments).env_remove("ROS_DOMAIN_ID");
    command.env("RAYON_NUM_THREADS", "3");
    command
}

/// Output of a call that must fail, also where it starts a node that would run on.
fn refused(arguments: &[&str]) -> Output {
    let mut command = command(arguments);
    let piped = command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = piped.spawn().unwrap();
    if child.wait_timeout(PATIENCE).unwrap().is_none() {
        child.kill().unwrap();
        panic!("{arguments:?} runs on");
    }
    let output = child.wait_with_output().unwrap();
    assert!(!output.status.success(), "{arguments:?} should fail");
    output
}

/// Standard output of a call that must succeed.
fn text(arguments: &[&str]) -> String {
    let output = lattice(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&text(&[arguments, &["--json"]].concat())).unwrap()
}

/// The one line of an error.
fn error(arguments: &[&str]) -> String {
    let output = refused(arguments);
    assert!(output.stdout.is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}
