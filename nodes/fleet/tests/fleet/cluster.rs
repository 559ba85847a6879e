//! A Ballista cluster on loopback whose processes are killed.

use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use lattice_fleet::map_stage::Task;
use lattice_fleet::part::Source;
use lattice_fleet::replay_options::ReplayOptions;
use wait_timeout::ChildExt;

use crate::fixture::{Recipe, json, merged, parts, program, refused, run, text};
use crate::logs::Logs;
use crate::signals::stalled_lattice;

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
    root: PathBuf,
    program: PathBuf,
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
    /// A cluster with logs and tables below a root, whose executors run a program.
    fn start(root: &Path, program: &Path) -> Cluster {
        let port = free_port();
        let mut cluster = Cluster {
            scheduler: None,
            executors: Vec::new(),
            port,
            root: root.to_owned(),
            program: program.to_owned(),
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
            "--root",
            text(&self.root),
        ];
        self.scheduler = Some(start(&arguments, self.port));
    }

    fn start_executor(&mut self) {
        let own = free_port();
        let (own_address, scheduler) = (
            format!("127.0.0.1:{own}"),
            format!("127.0.0.1:{}", self.port),
        );
        let places = [
            "--scheduler",
            &scheduler,
            "--address",
            &own_address,
            "--root",
            text(&self.root),
            "--program",
            text(&self.program),
        ];
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
    let mut cluster = Cluster::start(folder.path(), &logs.lattice);
    let (tables, engine) = (folder.path().join("tables [1] 50%"), cluster.engine());
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
    let mut cluster = Cluster::start(folder.path(), &stalled_lattice());
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
    // New tiles are in a temporary folder until all are there.
    let some_tile = || {
        let folders = fs::read_dir(&merged).into_iter().flatten().flatten();
        let mut tiles =
            folders.flat_map(|folder| fs::read_dir(folder.path()).into_iter().flatten());
        tiles.any(|tile| tile.is_ok_and(|tile| tile.path().is_dir()))
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

#[test]
fn names_that_are_patterns_or_escapes_are_literal_on_a_cluster() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), &stalled_lattice());
    let engine = cluster.engine();
    for name in crate::paths::NAMES {
        let folder = folder.path().join(format!("of {name}"));
        fs::create_dir(&folder).unwrap();
        let (tables, expected) = crate::paths::tables(&folder, name);
        let out = folder.join("out.lat");
        let merge = ["merge", text(&tables), "--engine", &engine];
        run(merge.into_iter().chain(["--map-out", text(&out)]));
        assert_eq!(fs::read(&out).unwrap(), expected, "{name}");
    }
}

#[test]
fn what_lies_outside_of_the_roots_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let outer = folder.path().canonicalize().unwrap();
    let (root, outside) = (outer.join("root"), outer.join("outside"));
    for folder in [&root, &outside] {
        fs::create_dir(folder).unwrap();
        fs::write(folder.join("log.mcap"), text(folder)).unwrap();
    }
    let tables = root.join("tables");
    let (foreign, linked) = (outside.join("tables"), root.join("linked"));
    for tables in [&tables, &foreign] {
        fs::create_dir_all(tables.join("parts")).unwrap();
        fs::create_dir_all(tables.join("tmp")).unwrap();
    }
    fs::create_dir(&linked).unwrap();
    fs::create_dir(linked.join("tmp")).unwrap();
    symlink(foreign.join("parts"), linked.join("parts")).unwrap();
    symlink(outside.join("log.mcap"), root.join("link.mcap")).unwrap();
    let cluster = Cluster::start(&root, &stalled_lattice());
    let place = format!("127.0.0.1:{}", cluster.port);
    let good = Task {
        tables: tables.clone(),
        options: ReplayOptions::default(),
        source: Source {
            kind: "log".to_owned(),
            path: text(&root.join("log.mcap")).to_owned(),
            sha256: "a digest".to_owned(),
            slice_s: (0.0, None),
            settings: Vec::new(),
            program: "lattice 0.0.0".to_owned(),
            placed: false,
        },
        corrected: false,
    };
    let of_log = |path: &Path| {
        let mut task = good.clone();
        task.source.path = text(path).to_owned();
        task
    };
    let of_tables = |path: &Path| Task {
        tables: path.to_owned(),
        ..good.clone()
    };
    let of_param = |param: &str| {
        let mut task = good.clone();
        task.options.param = vec![param.to_owned()];
        task.source.settings = task.options.settings();
        task
    };
    let mut other_version = good.clone();
    other_version.source.program = "lattice 9.9.9".to_owned();
    let mut other_settings = good.clone();
    other_settings.source.settings = vec!["--lattice".to_owned()];
    let attacks = [
        ("not below a root", of_log(&outside.join("log.mcap"))),
        ("not below a root", of_log(&root.join("link.mcap"))),
        ("not below a root", of_log(&root.join("missing"))),
        ("without `..`", of_log(&root.join("../outside/log.mcap"))),
        ("must be absolute", of_log(Path::new("--out-table=/etc"))),
        ("not below a root", of_tables(&linked)),
        ("NAME:=VALUE", of_param("--map-out=/etc/x")),
        ("install one version", other_version),
        ("differs from its options", other_settings),
    ];
    let runtime = tokio::runtime::Runtime::new().unwrap();
    // The driver puts its tasks into the tables of the first one.
    for (expected, attack) in attacks {
        let mut tasks = vec![attack];
        let mut carrier = other_named(&good);
        carrier.source.program = "lattice 9.9.9".to_owned();
        tasks.insert(0, carrier);
        let (new, failed) = runtime
            .block_on(lattice_fleet::cluster::map(&place, &tasks))
            .unwrap();
        let named = failed.iter().any(|why| why.contains(expected));
        assert!(
            new == 0 && failed.len() == 2 && named,
            "{expected}: {failed:?}"
        );
    }
    // A query reads no file out of the roots either, and tasks that lie there do not even arrive.
    let error = runtime.block_on(lattice_fleet::cluster::map(&place, &[of_tables(&foreign)]));
    let said = error.unwrap_err().to_string();
    assert!(said.contains("not below a root"), "{said}");
    let map = Recipe::new(1).write(&outside);
    run(["to-table", text(&map), "-o", text(&foreign)]);
    let engine = cluster.engine();
    let said = refused(["merge", text(&foreign), "--engine", &engine]);
    assert!(said.contains("not below a root"), "{said}");
    assert!(!foreign.join("merged/merged.json").exists());
    assert!(parts(&tables).is_empty());
}

/// The task of another log.
fn other_named(task: &Task) -> Task {
    let mut other = task.clone();
    other.source.sha256 = "another digest".to_owned();
    other
}

#[test]
fn a_task_names_no_program() {
    let task = r#"{"tables": "/t", "program": "/bin/sh", "options": {"params": [], "param": []}, "corrected": false,
        "source": {"kind": "log", "path": "/l", "sha256": "", "slice_s": [0, null], "settings": [], "program": "",
        "placed": false}}"#;
    let error = serde_json::from_str::<Task>(task).unwrap_err().to_string();
    assert!(error.contains("unknown field `program`"), "{error}");
    serde_json::from_str::<Task>(&task.replace("\"program\": \"/bin/sh\", ", "")).unwrap();
}

#[test]
fn addresses_beyond_this_machine_need_an_option() {
    let folder = tempfile::tempdir().unwrap();
    let root = ["--root", text(folder.path())];
    let program = stalled_lattice();
    let executor = ["serve", "executor", "--program", text(&program)];
    for arguments in [
        ["serve", "scheduler", "--address", "0.0.0.0:0"].to_vec(),
        ["serve", "scheduler", "--address", "[::]:0"].to_vec(),
        [&executor[..], &["--address", "0.0.0.0:0"]].concat(),
        [&executor[..], &["--scheduler", "192.0.2.1:50050"]].concat(),
    ] {
        let said = refused(arguments.iter().chain(&root));
        let named = said.contains("is not a loopback address") && said.contains("--insecure");
        assert!(named, "{arguments:?}: {said}");
    }
    let said = refused(["serve", "scheduler"]);
    assert!(said.contains("--root"), "{said}");
}
