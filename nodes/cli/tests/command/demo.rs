//! `lattice demo` and replays over DDS beside others of their kind, and the page at their end.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write, stderr};
use std::net::TcpStream;
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::nodes::{figures, simulated};
use crate::{error, json};

#[test]
fn two_replays_of_one_shell_do_not_meet_and_each_writes_its_map() {
    let folder = tempfile::tempdir().unwrap();
    let log = simulated(folder.path(), "mcap", "2");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let replays = ["fcc", "bcc"].map(|lattice| {
        let map = path(&format!("{lattice}.lattice"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
        command
            .args(["replay", &log, "--lattice", lattice, "--json"])
            .args(["--map-out", &map])
            .env("ROS_DOMAIN_ID", "7")
            .env("ROS_STATIC_PEERS", "127.0.0.1")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        (lattice, map, command.spawn().unwrap())
    });
    for (lattice, map, replay) in replays {
        let output = replay.wait_with_output().unwrap();
        let words = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{lattice}: {words}");
        // Nothing is lost, so that nobody needs a larger buffer.
        assert!(!words.contains("rmem_max"), "{lattice}: {words}");
        let played: Value = serde_json::from_slice(&output.stdout).unwrap();
        let direct = path("direct.lattice");
        let arguments = ["replay", "--direct", &log, "--lattice", lattice];
        let of_direct = json(&[&arguments[..], &["--map-out", &direct]].concat());
        assert_eq!(figures(&played), figures(&of_direct), "{lattice}");
        let voxels = |map: &str| json(&["map", "info", map])["voxels"].clone();
        assert_eq!(voxels(&map), voxels(&direct), "{lattice}");
    }
}

#[test]
fn a_folder_is_for_one_demo_at_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let lock = File::open(folder.path()).unwrap();
    lock.try_lock().unwrap();
    let out = folder.path().display().to_string();
    for demo in [["demo"].as_slice(), &["demo", "--indoor", "--true-labels"]] {
        let refused = error(&[demo, &["--out", &out]].concat());
        assert!(
            refused.contains("--out") && refused.contains(&out),
            "{refused}"
        );
    }
}

#[test]
fn in_a_terminal_the_page_of_a_demo_stays() {
    let folder = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_lattice");
    let out = folder.path().display();
    let demo = format!("{program} demo --duration 4 --lattice bcc,fcc --port 0 --out {out}");
    // Gives the demo a terminal.
    let terminal = Command::new("script")
        .args(["-qefc", &demo, "/dev/null"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut terminal) = terminal else {
        let _ = writeln!(stderr(), "SKIPPED: no script, which gives a terminal");
        return;
    };
    let lines = BufReader::new(terminal.stdout.take().unwrap()).lines();
    let mut lines = lines.map(Result::unwrap);
    let line = lines.find(|line| line.contains("the page stays at"));
    let line = line.unwrap();
    assert!(line.contains("Ctrl-C"), "{line}");
    let (_, address) = line.split_once("http://").unwrap();
    let address = address.split([' ', '/']).next().unwrap();
    let mut page = TcpStream::connect(address).unwrap();
    write!(page, "GET / HTTP/1.1\r\nHost: {address}\r\n\r\n").unwrap();
    let mut answer = [0; 15];
    page.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 200 OK");
    for map in ["map.bcc.lattice", "map.fcc.lattice", "map.png"] {
        assert!(folder.path().join(map).exists(), "{map}");
    }
    // The terminal goes, and the demo with it.
    terminal.kill().unwrap();
    terminal.wait().unwrap();
}
