//! Standard output and standard error that are closed or full.

use std::fs::{self, File};
use std::io::pipe;
use std::process::{Command, Output, Stdio};

use crate::text;

/// A pipe whose reader has gone.
fn closed() -> Stdio {
    let (_, writer) = pipe().unwrap();
    writer.into()
}

fn run(arguments: &[&str], out: Stdio, err: Stdio) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
    let command = command.args(arguments).env_remove("ROS_DOMAIN_ID");
    command.stdout(out).stderr(err);
    command.spawn().unwrap().wait_with_output().unwrap()
}

#[test]
fn a_closed_pipe_ends_a_command_quietly() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (points, map, log) = (at("points.xyz"), at("map"), at("log"));
    fs::write(&points, "1 2 3\n4 5 6\n").unwrap();
    text(&["quantize", &points, "--map-out", &map]);
    let simulate = [
        "simulate",
        "bobcat",
        "--duration",
        "2",
        "--overwrite",
        "--out",
    ];
    text(&[&simulate[..], &[&log]].concat());
    let commands: [&[&str]; 10] = [
        &["bag", "info", &log],
        &["bag", "info", &log, "--json"],
        &["map", "info", &map],
        &["map", "query", &map, "--nearest", "0", "0", "0"],
        &["map", "diff", &map, &map],
        &["quantize", &points],
        &["link", &at("links")],
        &["replay", &log, "--direct", "--json"],
        &[&simulate[..], &[&log]].concat(),
        &["--help"],
    ];
    for command in commands {
        let output = run(command, closed(), Stdio::piped());
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{command:?}: {errors}");
        // A replay says which topics it takes, and what for the time of points.
        let said = [
            "clouds: ",
            "poses: ",
            "transforms: ",
            "not taken: ",
            "/left/points: time of points: ",
            "/right/points: time of points: ",
            "/top/points: time of points: ",
        ];
        let is_choice =
            |line: &&str| command[0] == "replay" && said.iter().any(|s| line.starts_with(s));
        let others: Vec<&str> = errors.lines().filter(|line| !is_choice(line)).collect();
        assert!(others.is_empty(), "{command:?}: {others:?}");
    }
    // An error has its status though nobody reads it.
    let output = run(&["map", "info", "nowhere"], closed(), closed());
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn an_output_that_is_full_fails_the_command() {
    let folder = tempfile::tempdir().unwrap();
    let points = folder.path().join("points.xyz").display().to_string();
    fs::write(&points, "1 2 3\n").unwrap();
    let full = File::options().write(true).open("/dev/full").unwrap();
    let output = run(&["quantize", &points], full.into(), Stdio::piped());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(
        errors.starts_with("lattice: standard output: No space left"),
        "{errors}"
    );
}
