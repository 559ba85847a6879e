//! `lattice record` beside foreign publishers, a player, and under signals.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;

use lattice_bag::BagReader;
use lattice_runtime::LoopbackDomain;
use serde_json::Value;
use wait_timeout::ChildExt;

use crate::nodes::{figures, simulated};
use crate::{PATIENCE, json, python, text};

pub const PEER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../test/python/record_peer.py"
);

/// A process of ours in a domain, whose log is on its standard error.
pub fn start(domain: &LoopbackDomain, arguments: &[&str]) -> Child {
    spawn(
        domain,
        Command::new(env!("CARGO_BIN_EXE_lattice")).args(arguments),
    )
}

/// A player of a log with more parameters, `NAME:=VALUE`.
pub fn play(domain: &LoopbackDomain, log: &str, parameters: &[&str]) -> Child {
    let bag = format!("bag:={log}");
    let parameters = parameters.iter().copied().chain([&*bag]);
    let parameters = parameters.flat_map(|parameter| ["-p", parameter]);
    let node = ["node", "bag_player", "--ros-args"].into_iter();
    start(domain, &node.chain(parameters).collect::<Vec<_>>())
}

/// The same as [`start`] of any command.
pub fn spawn(domain: &LoopbackDomain, command: &mut Command) -> Child {
    command
        .env("ROS_DOMAIN_ID", domain.id().to_string())
        .env("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Reads the log of a process until it has said all of these; the thread returns the rest.
pub fn expect(process: &mut Child, wanted: &[&str]) -> JoinHandle<Vec<String>> {
    let mut wanted = wanted.to_vec();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
    while !wanted.is_empty() {
        let line = lines.next().unwrap().unwrap();
        wanted.retain(|text| !line.contains(text));
    }
    std::thread::spawn(move || lines.map_while(Result::ok).collect())
}

pub fn signal(process: &Child, signal: &str) {
    let id = process.id().to_string();
    assert!(
        Command::new("kill")
            .args([signal, &id])
            .status()
            .unwrap()
            .success()
    );
}

/// Ends a recording by a signal; what it printed.
fn end(mut recorder: Child, by: &str) -> Value {
    signal(&recorder, by);
    let status = recorder.wait_timeout(PATIENCE).unwrap().unwrap();
    assert!(status.success(), "{status}");
    serde_json::from_reader(recorder.stdout.take().unwrap()).unwrap()
}

/// Records what the peer says; the bag must hold each message of it.
fn record_foreign(storage_and_more: &[&str], by: &str) -> Option<usize> {
    let python = python()?;
    let folder = tempfile::tempdir().unwrap();
    let types = folder.path().join("share/pit/msg");
    fs::create_dir_all(&types).unwrap();
    fs::write(
        types.join("Load.msg"),
        "string name\nfloat64 mass_kg\nuint16[] marks\n",
    )
    .unwrap();
    let share = folder.path().join("share").display().to_string();
    let bag = folder.path().join("bag").display().to_string();
    let domain = LoopbackDomain::take().unwrap();
    let record = [
        "record",
        "-a",
        "-x",
        "^/(rosout|diagnostics)$",
        "-o",
        &bag,
        "--json",
    ];
    let more = ["--msg-path", &share];
    let mut recorder = start(&domain, &[&record[..], &more, storage_and_more].concat());
    let mut peer = Command::new(&python)
        .args([PEER, "talk", &domain.id().to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let topics = [
        "recording /said ",
        "recording /pit/load ",
        "recording /latched ",
    ];
    expect(&mut recorder, &topics);
    let mut lines = BufReader::new(peer.stdout.take().unwrap()).lines();
    assert_eq!(lines.next().unwrap().unwrap(), "matched");
    peer.stdin.take().unwrap().write_all(b"\n").unwrap();
    let said = lines.next().unwrap().unwrap();
    let said: Value = serde_json::from_str(&said).unwrap();
    assert!(peer.wait().unwrap().success());
    let report = end(recorder, by);
    assert_eq!(report["messages"], 601, "{report}");
    let read = Command::new(python)
        .args([PEER, "read", &bag])
        .output()
        .unwrap();
    assert!(
        read.status.success(),
        "{}",
        String::from_utf8_lossy(&read.stderr)
    );
    let read: Value = serde_json::from_slice(&read.stdout).unwrap();
    assert_eq!(read, said);
    let info = json(&["bag", "info", &bag]);
    assert_eq!(info["messages"], 601);
    let names = fs::read_dir(&bag).unwrap();
    let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let files = names
        .filter(|name| name != "metadata.yaml")
        .inspect(|name| {
            assert!(!name.ends_with("-wal") && !name.ends_with("-shm"), "{name}");
        });
    Some(files.count())
}

#[test]
fn topics_of_any_type_are_recorded_and_read_elsewhere() {
    assert!(record_foreign(&["-s", "mcap"], "-INT").is_none_or(|files| files == 1));
}

#[test]
fn a_recording_is_split_and_compressed() {
    let split = ["-s", "sqlite3", "-b", "10000", "--compression-mode", "file"];
    assert!(record_foreign(&split, "-TERM").is_none_or(|files| files > 2));
    let messages = ["--compression-mode", "message"];
    assert!(record_foreign(&messages, "-TERM").is_none_or(|files| files == 1));
}

pub const PARAMS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/bobcat.yaml");

/// A recording of a system at work, and the log that it played.
fn record_system(folder: &Path, storage: &str) -> (Child, Child, Child, String, String) {
    let log = simulated(folder, "mcap", "4");
    let bag = folder.join("recorded").display().to_string();
    let domain = LoopbackDomain::take().unwrap();
    let mut recorder = start(
        &domain,
        &["record", "-a", "-s", storage, "-o", &bag, "--json"],
    );
    let mut nodes = start(&domain, &["run", PARAMS]);
    let player_params = [
        format!("bag:={log}"),
        "wait_for_subscribers:=['/left/points', '/novatel/oem7/inspvax']".to_owned(),
        "settle_s:=3.0".to_owned(),
    ];
    let params = player_params.iter().flat_map(|param| ["-p", param]);
    let node = ["node", "bag_player", "--ros-args"];
    let player = start(&domain, &node.into_iter().chain(params).collect::<Vec<_>>());
    expect(&mut nodes, &["publisher matched"]);
    expect(
        &mut recorder,
        &["/left/points ", "/novatel/oem7/inspvax ", "/tf_static "],
    );
    // The domain stays theirs: its number is taken for as long as they live.
    std::mem::forget(domain);
    (recorder, nodes, player, bag, log)
}

#[test]
fn a_recording_of_a_system_at_work_gives_the_same_map() {
    let folder = tempfile::tempdir().unwrap();
    let (recorder, mut nodes, mut player, bag, log) = record_system(folder.path(), "mcap");
    drop(player.stderr.take());
    assert!(player.wait_timeout(PATIENCE).unwrap().unwrap().success());
    signal(&nodes, "-TERM");
    nodes.wait().unwrap();
    let report = end(recorder, "-INT");
    let topics = report["topics"].as_array().unwrap();
    for name in [
        "/left/points",
        "/voxel_map",
        "/voxel_map_updates",
        "/voxel_markers",
        "/points_enu",
    ] {
        assert!(
            topics.iter().any(|topic| topic["name"] == name),
            "{name}: {report}"
        );
    }
    for topic in topics {
        assert_eq!(
            (&topic["lost"], &topic["not_written"]),
            (&0.into(), &0.into()),
            "{topic}"
        );
    }
    let map = |log: &str| figures(&json(&["replay", "--direct", log, "--params", PARAMS]));
    assert_eq!(map(&bag), map(&log), "{report}");
}

#[test]
fn on_a_full_disk_a_recording_ends_and_what_it_has_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let log = simulated(folder.path(), "mcap", "6");
    for storage in ["mcap", "sqlite3"] {
        let bag = folder.path().join(format!("full_{storage}"));
        let bag = bag.display().to_string();
        let domain = LoopbackDomain::take().unwrap();
        // Files of a megabyte; what is beyond is a signal.
        let script = "ulimit -f 2048; exec \"$@\"";
        let mut confined = Command::new("sh");
        let record = ["record", "-a", "-s", storage, "-o", &bag];
        let confined = confined
            .args(["-c", script, "sh", env!("CARGO_BIN_EXE_lattice")])
            .args(record);
        let recorder = spawn(&domain, confined);
        let topics = "wait_for_subscribers:=['/left/points', '/right/points', '/top/points']";
        let params = format!("bag:={log}");
        let player = [
            "node",
            "bag_player",
            "--ros-args",
            "-p",
            &params,
            "-p",
            topics,
            "-p",
            "loop:=true",
        ];
        let mut player = start(&domain, &player);
        drop(player.stderr.take());
        let ended = recorder.wait_with_output().unwrap();
        player.kill().unwrap();
        player.wait().unwrap();
        let errors = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(1), "{errors}");
        let last = errors.lines().last().unwrap();
        assert!(
            last.contains(&bag) && last.contains("free space"),
            "{errors}"
        );
        let info = json(&["bag", "info", &bag]);
        assert!(info["messages"].as_u64() > Some(10), "{storage}: {info}");
        let out = format!("{bag}_whole");
        text(&["bag", "recover", &bag, "--out", &out]);
        assert!(json(&["bag", "info", &out])["messages"].as_u64() > Some(10));
    }
}

#[test]
fn a_recorder_that_is_killed_leaves_what_it_had() {
    for storage in ["mcap", "sqlite3"] {
        let folder = tempfile::tempdir().unwrap();
        let (mut recorder, mut nodes, mut player, bag, _) = record_system(folder.path(), storage);
        drop(player.stderr.take());
        player.wait().unwrap();
        signal(&recorder, "-KILL");
        recorder.wait().unwrap();
        signal(&nodes, "-TERM");
        nodes.wait().unwrap();
        let info = json(&["bag", "info", &bag]);
        // It is mapped as it is.
        let report = json(&["replay", "--direct", &bag, "--params", PARAMS]);
        let mapped = report["transformer"]["counts"]["clouds_out"].as_u64();
        assert!(mapped > Some(100), "{storage}: {report}");
        // A second may be lost of more than four.
        let left = info["topics"].as_array().unwrap().iter();
        let left = left.filter(|topic| topic["name"] == "/left/points");
        let left: u64 = left.map(|topic| topic["messages"].as_u64().unwrap()).sum();
        assert!(left > 100, "{storage}: {info}");
        let out = folder.path().join("whole").display().to_string();
        let recovered = json(&["bag", "recover", &bag, "--out", &out]);
        let whole = BagReader::open(out.as_ref()).unwrap();
        // Those of a chunk that is cut come on top, marked.
        let unchecked = recovered["unchecked"].as_array().unwrap().iter();
        let unchecked: usize = unchecked
            .map(|of| of["log_times_ns"].as_array().unwrap().len())
            .sum();
        let readable = whole.message_count() - unchecked as u64;
        assert_eq!(
            Some(readable),
            info["messages"].as_u64(),
            "{storage}: {recovered}\n{info}"
        );
    }
}
