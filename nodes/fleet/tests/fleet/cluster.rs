//! A Ballista cluster on loopback whose processes are killed.

use std::fs;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use wait_timeout::ChildExt;

use crate::fixture::{Recipe, json, merged, parts, program, run, text};
use crate::logs::Logs;

const LONGEST: Duration = Duration::from_secs(120);

/// A process that ends with its holder.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

struct Cluster {
    scheduler: Option<Process>,
    executors: Vec<Process>,
    port: u16,
}

/// A port with a free one behind it.
fn free_port() -> u16 {
    loop {
        let first = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = first.local_addr().unwrap().port();
        if port < u16::MAX && TcpListener::bind(("127.0.0.1", port + 1)).is_ok() {
            return port;
        }
    }
}

fn start(arguments: &[&str], port: u16) -> Process {
    let mut command = program();
    command
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let process = Process(command.spawn().unwrap());
    wait_for("a port", || {
        std::net::TcpStream::connect(("127.0.0.1", port)).is_ok()
    });
    process
}

fn wait_for(what: &str, mut there: impl FnMut() -> bool) {
    let end = Instant::now() + LONGEST;
    while !there() {
        assert!(Instant::now() < end, "no {what} after {LONGEST:?}");
        std::thread::yield_now();
    }
}

impl Cluster {
    fn start() -> Cluster {
        let port = free_port();
        let mut cluster = Cluster {
            scheduler: None,
            executors: Vec::new(),
            port,
        };
        cluster.start_scheduler();
        (0..2).for_each(|_| cluster.start_executor());
        cluster
    }

    fn start_scheduler(&mut self) {
        let address = format!("127.0.0.1:{}", self.port);
        let arguments = [
            "serve",
            "scheduler",
            "--executor-timeout",
            "5",
            "--address",
            &address,
        ];
        self.scheduler = Some(start(&arguments, self.port));
    }

    fn start_executor(&mut self) {
        let own = free_port();
        let (own_address, scheduler) = (
            format!("127.0.0.1:{own}"),
            format!("127.0.0.1:{}", self.port),
        );
        let places = ["--scheduler", &scheduler, "--address", &own_address];
        let arguments = ["serve", "executor", "--slots", "1"]
            .into_iter()
            .chain(places);
        let executor = start(&arguments.collect::<Vec<_>>(), own);
        self.executors.push(executor);
    }

    fn engine(&self) -> String {
        format!("ballista://127.0.0.1:{}", self.port)
    }
}

#[test]
fn an_executor_that_is_killed_while_it_maps_costs_time_only() {
    let folder = tempfile::tempdir().unwrap();
    let Some(logs) = Logs::simulate(folder.path(), 6, "8", &[]) else {
        return;
    };
    let expected = logs.expected(folder.path());
    let mut cluster = Cluster::start();
    let (tables, engine) = (folder.path().join("tables"), cluster.engine());
    fs::create_dir_all(tables.join("parts")).unwrap();
    let mut map = program();
    map.args(logs.map(&tables, &["--engine", &engine]))
        .stdout(Stdio::null());
    let mut map = Process(map.spawn().unwrap());
    wait_for("first part", || !parts(&tables).is_empty());
    drop(cluster.executors.pop());
    let status = map
        .0
        .wait_timeout(LONGEST)
        .unwrap()
        .expect("no end of the map stage");
    assert!(status.success());
    assert_eq!(parts(&tables).len(), logs.logs.len());
    let out = folder.path().join("out.lat");
    run([
        "merge",
        text(&tables),
        "--engine",
        &engine,
        "--map-out",
        text(&out),
    ]);
    assert_eq!(fs::read(&out).unwrap(), expected);
}

/// Tables of maps that a cluster merges for a while.
fn large_tables(folder: &Path) -> (std::path::PathBuf, Vec<u8>) {
    let recipes: Vec<_> = (0..6)
        .map(|seed| Recipe {
            points: 200_000,
            volume_m3: 0.5,
            ..Recipe::new(seed)
        })
        .collect();
    let tables = folder.join("tables");
    for recipe in &recipes {
        run(["to-table", text(&recipe.write(folder)), "-o", text(&tables)]);
    }
    (tables, merged(recipes.iter().map(Recipe::map)))
}

#[test]
fn a_merge_ends_with_the_same_bytes_whatever_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let (tables, expected) = large_tables(folder.path());
    let mut cluster = Cluster::start();
    let engine = cluster.engine();
    let (merged, out) = (folder.path().join("merged"), folder.path().join("out.lat"));
    let arguments = [
        "merge",
        text(&tables),
        "--out",
        text(&merged),
        "--engine",
        &engine,
    ];
    // Several queries, so that the kill is between or within them.
    let arguments = [
        &arguments[..],
        &["--rows-at-once", "60000", "--map-out", text(&out)],
    ]
    .concat();
    let some_tile = || {
        let entries = fs::read_dir(&merged).into_iter().flatten().flatten();
        entries.filter(|entry| entry.path().is_dir()).count() > 0
    };
    let mut merge = Process(program().args(&arguments).spawn().unwrap());
    wait_for("first tile", some_tile);
    drop(cluster.executors.pop());
    let status = merge
        .0
        .wait_timeout(LONGEST)
        .unwrap()
        .expect("no end of the merge");
    assert!(status.success());
    assert_eq!(fs::read(&out).unwrap(), expected);
    // Without its scheduler a merge fails; calling it again with another ends it.
    fs::remove_dir_all(&merged).unwrap();
    fs::remove_file(&out).unwrap();
    cluster.start_executor();
    let mut merge = Process(
        program()
            .args(&arguments)
            .stderr(Stdio::null())
            .spawn()
            .unwrap(),
    );
    wait_for("first tile", some_tile);
    cluster.scheduler = None;
    let status = merge
        .0
        .wait_timeout(LONGEST)
        .unwrap()
        .expect("no end without a scheduler");
    if !status.success() {
        cluster.executors.clear();
        cluster.start_scheduler();
        cluster.start_executor();
        let again = [&arguments[..], &["--json"]].concat();
        assert!(json(&run(&again))["tiles"].as_u64() > Some(0));
    }
    assert_eq!(fs::read(&out).unwrap(), expected);
}
