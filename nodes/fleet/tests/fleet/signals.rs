//! Signals end replays and remove temporary folders.

use std::fs;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use wait_timeout::ChildExt;

use crate::fixture::{from_environment, parts, program, refused, text};

const LONGEST: Duration = Duration::from_secs(60);

/// The program whose replay never ends.
pub fn stalled_lattice() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fleet/stalled_lattice.sh")
}

/// A process that ends with its holder.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let end = Instant::now() + LONGEST;
    while !there() {
        assert!(Instant::now() < end, "no {what} after {LONGEST:?}");
        std::thread::yield_now();
    }
}

fn signal(process: &Child, name: &str) {
    let id = process.id().to_string();
    assert!(
        Command::new("kill")
            .args([name, &id])
            .status()
            .unwrap()
            .success()
    );
}

/// True while a process runs; one that nobody has waited for yet does not.
fn runs(id: &str) -> bool {
    let state = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    let state = state
        .rsplit(')')
        .next()
        .and_then(|rest| rest.trim().chars().next());
    state.is_some_and(|state| state != 'Z')
}

/// Maps two logs with the program whose replay never ends, sends a signal, and checks that nothing is left.
fn nothing_is_left(mut command: Command, name: &str, number: i32, removes_folders: bool) {
    let folder = tempfile::tempdir().unwrap();
    let (stalled, tables) = (
        folder.path().join("stalled"),
        folder.path().join("t [1] #\u{e4}"),
    );
    fs::create_dir(&stalled).unwrap();
    command.args([
        "map",
        "-o",
        text(&tables),
        "--program",
        text(&stalled_lattice()),
    ]);
    for log in ["log 1.mcap", "log 2.mcap"] {
        let log = folder.path().join(log);
        fs::write(&log, text(&log)).unwrap();
        command.arg(log);
    }
    command.args(["--workers", "2"]).env("STALLED", &stalled);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    let mut running = Process(command.spawn().unwrap());
    let replays = || -> Vec<String> {
        let names = fs::read_dir(&stalled)
            .unwrap()
            .map(|entry| entry.unwrap().file_name());
        names.map(|name| name.into_string().unwrap()).collect()
    };
    wait_for("replays", || replays().len() == 2);
    let entries = || fs::read_dir(tables.join("tmp")).unwrap().count();
    assert_eq!(entries(), 2);
    signal(&running.0, name);
    let status = running.0.wait_timeout(LONGEST).unwrap().unwrap();
    assert_eq!(status.signal(), Some(number), "{status}");
    wait_for("end of the replays", || {
        !replays().iter().any(|id| runs(id))
    });
    if removes_folders {
        assert_eq!(entries(), 0, "{name}");
    }
    assert!(parts(&tables).is_empty());
}

#[test]
fn a_signal_ends_the_replays_and_removes_their_folders() {
    nothing_is_left(program(), "-TERM", 15, true);
    nothing_is_left(program(), "-INT", 2, true);
    // Nobody can remove folders after that, but the replays end.
    nothing_is_left(program(), "-KILL", 9, false);
}

#[test]
fn lattice_fleet_receives_its_signals_itself() {
    let Some(lattice) = from_environment("LATTICE_PROGRAM") else {
        return;
    };
    let programs = Path::new(env!("CARGO_BIN_EXE_lattice-fleet"))
        .parent()
        .unwrap();
    let path = std::env::var_os("PATH").unwrap();
    let path = [programs.to_owned()]
        .into_iter()
        .chain(std::env::split_paths(&path));
    let mut command = Command::new(lattice);
    command
        .arg("fleet")
        .env("PATH", std::env::join_paths(path).unwrap());
    nothing_is_left(command, "-TERM", 15, true);
}

#[test]
fn a_log_without_tasks_counts_as_one_task_that_failed() {
    let folder = tempfile::tempdir().unwrap();
    let (tables, missing) = (folder.path().join("tables"), folder.path().join("missing"));
    let program = stalled_lattice();
    let said = refused([
        "map",
        "-o",
        text(&tables),
        "--program",
        text(&program),
        text(&missing),
    ]);
    assert!(
        said.contains("1 of 1 tasks failed") && said.contains("missing"),
        "{said}"
    );
}
