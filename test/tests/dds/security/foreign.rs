//! A permitted peer of another make: a program in C over Debian's Cyclone DDS with its own plugins.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::channel;

use lattice_test::domain::TestDomain;

use super::keystore::{Keystore, NOW, OF_A_NODE};
use super::peers::{Peer, talk, topic, until};
use super::{WORDS, can_run, runtime};

/// Loopback only and without multicast, as the tests have it.
const CONFIG: &str = "<CycloneDDS><Domain Id=\"any\"><General><Interfaces>\
    <NetworkInterface name=\"lo\" multicast=\"false\"/></Interfaces>\
    <AllowMulticast>false</AllowMulticast></General><Discovery>\
    <ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>20</MaxAutoParticipantIndex>\
    <Peers><Peer Address=\"127.0.0.1\"/></Peers></Discovery></Domain></CycloneDDS>";

/// Folder of the plugins, where Debian's `cyclonedds-dev` is installed; else a line says so.
fn plugins() -> Option<PathBuf> {
    let compiler = Command::new("idlc").arg("-v").output();
    let folders = fs::read_dir("/usr/lib").unwrap().flatten();
    let mut folders = folders.map(|folder| folder.path().join("libddsc0debian"));
    let found = folders.find(|folder| folder.join("libdds_security_auth.so").exists());
    if compiler.is_err() || found.is_none() {
        let _ = writeln!(std::io::stderr(), "SKIPPED: no cyclonedds-dev of Debian");
        return None;
    }
    found
}

/// The program, built in `folder`.
fn build(folder: &Path) -> PathBuf {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/dds/security");
    let run = |command: &mut Command| {
        let output = command.current_dir(folder).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{errors}");
    };
    run(Command::new("idlc").arg(sources.join("foreign.idl")));
    let program = sources.join("foreign.c");
    let line = [
        "-Wall",
        "-Werror",
        "-I.",
        "-o",
        "peer",
        "foreign.c",
        "-lddsc",
    ];
    run(Command::new("gcc").arg(program).args(line));
    folder.join("peer")
}

#[test]
fn a_permitted_cyclone_of_debian_hears_is_heard_and_is_answered() {
    let (true, Some(plugins)) = (can_run(), plugins()) else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let program = build(folder.path());
    let keystore = Keystore::make();
    let topics = [&OF_A_NODE[..], &["rt/domain*/talk"]].concat();
    keystore.add("ours", &topics, NOW);
    keystore.add("foreign", &topics, NOW);
    let domain = TestDomain::take();
    let talker = runtime(&domain, "talk", "/ours", Some(keystore.enforced())).unwrap();
    let node = talker.node("talk").unwrap();
    let answer = || (true, "of ours".to_owned());
    let _service = node.service_trigger("~/ask", answer).unwrap();
    let (sender, heard) = channel();
    let _talk = talk(&talker, ("talk", domain.id()), "ours", sender);
    let foreign = Peer::of(
        Command::new(program)
            .arg(domain.id().to_string())
            .args([&keystore.path("enclaves/foreign"), &plugins])
            .args([&topic(domain.id()), "/talk/ask"])
            .env("CYCLONEDDS_URI", CONFIG),
    );
    let mut words = 0;
    until(&heard, "a talk and an answer", |word| {
        words += usize::from(word == "foreign");
        let answered = foreign.has_printed("answered of ours");
        answered && foreign.count("ours") >= WORDS && words >= WORDS
    });
}
