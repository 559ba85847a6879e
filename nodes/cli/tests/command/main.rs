//! The `lattice` command as a user runs it.
#![allow(clippy::unwrap_used)]

mod attitude;
mod bag_info;
mod beside_nav2;
mod browser;
mod calibrate;
mod demo;
mod doctor;
mod driver_logs;
mod evaluate;
mod files;
mod health;
mod indoor;
mod lifecycle;
mod map;
mod merger;
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
mod streams;
mod unsent;
mod versions;
mod viewer;
mod viewer_foreign;
mod viewer_headset;
mod viewer_hostile;
mod viewer_layout;
mod viewer_page;
mod viewer_planning;
mod viewer_survey;
mod viewer_words;
mod viewer_writing;

use std::io::{Write, stderr};
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::Duration;

use serde_json::Value;

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
    Command::new(env!("CARGO_BIN_EXE_lattice"))
        .args(arguments)
        // Each replay takes a domain of its own.
        .env_remove("ROS_DOMAIN_ID")
        .env("RAYON_NUM_THREADS", "3")
        .output()
        .unwrap()
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
    let output = lattice(arguments);
    assert!(!output.status.success(), "{arguments:?} should fail");
    assert!(output.stdout.is_empty());
    let text = String::from_utf8(output.stderr).unwrap();
    assert_eq!(text.lines().count(), 1, "{text}");
    text
}
