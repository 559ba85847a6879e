//! Map frames: logs without a geodetic origin, and one drive in two files.

use std::fs;
use std::path::{Path, PathBuf};

use lattice_fleet::part::Source;
use lattice_fleet::tables::Tables;

use crate::fixture::{Recipe, json, merged, refused, run, text};
use crate::logs::Logs;

const BRISBANE: [f64; 3] = [-27.5, 152.9, 80.0];

/// A part of the log `log`, whose map is that of a recipe.
#[derive(Clone)]
struct OfLog {
    log: &'static str,
    slice_s: (f64, Option<f64>),
    origin: Option<[f64; 3]>,
    placed: bool,
    seed: u64,
}

impl OfLog {
    fn new(log: &'static str, seed: u64, origin: Option<[f64; 3]>) -> OfLog {
        OfLog {
            log,
            slice_s: (0.0, None),
            origin,
            placed: false,
            seed,
        }
    }

    fn placed(self) -> OfLog {
        OfLog {
            placed: true,
            ..self
        }
    }

    fn add(&self, tables: &Path) {
        let source = Source {
            kind: "log".to_owned(),
            path: format!("/logs/{}", self.log),
            sha256: format!("digest of {}", self.log),
            slice_s: self.slice_s,
            settings: Vec::new(),
            program: "lattice 0.1.0".to_owned(),
            placed: self.placed,
        };
        let tables = Tables::open_or_create(tables).unwrap();
        let map = Recipe::new(self.seed).map().into();
        assert!(tables.add(&map, source, self.origin).unwrap().new);
    }
}

fn tables(folder: &Path, logs: &[OfLog]) -> PathBuf {
    let tables = folder.join("t\u{e4}bles #1");
    logs.iter().for_each(|log| log.add(&tables));
    tables
}

#[test]
fn logs_without_an_origin_need_a_correction_or_the_word_of_the_user() {
    let gps = OfLog::new("gps", 1, Some(BRISBANE));
    let odometry = OfLog::new("odometry [1]", 2, None);
    let lidar = OfLog::new("lidar", 3, None);
    for logs in [
        vec![odometry.clone(), lidar.clone()],
        vec![gps.clone(), odometry.clone()],
        vec![
            gps.clone().placed(),
            odometry.clone(),
            lidar.clone().placed(),
        ],
    ] {
        let folder = tempfile::tempdir().unwrap();
        let tables = tables(folder.path(), &logs);
        let out = folder.path().join("out.lat");
        let said = refused(["merge", text(&tables), "--map-out", text(&out)]);
        let named = said.contains("odometry [1]") && said.contains("has no geodetic origin");
        assert!(
            named && said.contains("--same-frame") && said.contains("align"),
            "{said}"
        );
        assert!(!tables.join("merged").exists() && !out.exists());
        run([
            "merge",
            text(&tables),
            "--same-frame",
            "--map-out",
            text(&out),
        ]);
        let maps = logs.iter().map(|log| Recipe::new(log.seed).map());
        assert_eq!(fs::read(&out).unwrap(), merged(maps));
    }
    let slice = |from_s, to_s, seed| OfLog {
        slice_s: (from_s, to_s),
        seed,
        ..odometry.clone()
    };
    for logs in [
        // One log, one frame, even in slices.
        vec![slice(0.0, Some(9.0), 2), slice(9.0, None, 4)],
        // Placed in the map of a log, or of a site.
        vec![odometry.clone(), lidar.clone().placed()],
        vec![
            gps.clone(),
            odometry.clone().placed(),
            lidar.clone().placed(),
        ],
        vec![gps.clone(), OfLog::new("other", 5, Some(BRISBANE))],
    ] {
        let folder = tempfile::tempdir().unwrap();
        run(["merge", text(&tables(folder.path(), &logs))]);
    }
}

#[test]
fn maps_of_a_replay_without_origin_have_frames_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let tables = folder.path().join("tables");
    for seed in [1, 2] {
        let map = Recipe::new(seed).write(folder.path());
        run(["to-table", text(&map), "-o", text(&tables), "--own-frame"]);
    }
    let said = refused(["merge", text(&tables)]);
    assert!(said.contains("has no geodetic origin"), "{said}");
    run(["merge", text(&tables), "--same-frame"]);
}

#[test]
fn one_drive_in_two_files_is_refused() {
    let mut logs = [
        OfLog::new("as mcap", 1, Some(BRISBANE)),
        OfLog::new("as sqlite3", 1, Some(BRISBANE)),
    ];
    let folder = tempfile::tempdir().unwrap();
    let said = refused(["merge", text(&tables(folder.path(), &logs))]);
    let named = said.contains("/logs/as mcap") && said.contains("/logs/as sqlite3");
    assert!(named && said.contains("are one drive"), "{said}");
    logs[1].seed = 2;
    let folder = tempfile::tempdir().unwrap();
    run(["merge", text(&tables(folder.path(), &logs))]);
}

#[test]
fn a_drive_recorded_as_mcap_and_as_sqlite3_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut logs) = Logs::simulate(&folder.path().join("mcap"), 1, "3", &[]) else {
        return;
    };
    let sqlite = &["--storage", "sqlite3"];
    let other = Logs::simulate(&folder.path().join("sqlite3"), 1, "3", sqlite).unwrap();
    logs.logs.extend(other.logs);
    let tables = folder.path().join("tables");
    assert_eq!(json(&run(logs.map(&tables, &[])))["parts_new"], 2);
    let said = refused(["merge", text(&tables)]);
    assert!(
        said.contains("are one drive") && said.contains("sqlite3"),
        "{said}"
    );
}

/// Options by which the poses of a log are those of its odometry, without an origin.
const ODOMETRY: [&str; 6] = [
    "-p",
    "ins.source:=odometry",
    "-p",
    "ins.topic:=/ins/odometry",
    "-p",
    "origin.mode:=first_fix",
];

#[test]
fn align_places_a_log_without_an_origin() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some(site) = Logs::simulate(&folder.join("site logs"), 1, "20", &[]) else {
        return;
    };
    let (tables, trial) = (folder.join("site"), folder.join("trial"));
    run(site.map(&tables, &[]));
    run(["merge", text(&tables)]);
    let mut log = Logs::simulate(&folder.join("logs"), 2, "16", &[]).unwrap();
    log.logs.remove(0);
    run(log.map(&trial, &ODOMETRY));
    // Without a correction nobody knows where the log lies.
    let mixed = folder.join("mixed");
    run(site.map(&mixed, &[]));
    run(log.map(&mixed, &ODOMETRY));
    let said = refused(["merge", text(&mixed)]);
    let named = said.contains("has no geodetic origin") && said.contains("log2");
    assert!(named, "{said}");
    let out = folder.join("corrections.json");
    let against = tables.join("merged");
    let align = ["align", text(&trial), "--against", text(&against)];
    let program = ["--out", text(&out), "--program", text(&log.lattice)];
    run(align.into_iter().chain(program));
    let corrections = ["--corrections", text(&out)];
    let report = json(&run(
        log.map(&tables, &[&ODOMETRY[..], &corrections].concat())
    ));
    assert_eq!(report["parts_new"], 1);
    run(["merge", text(&tables)]);
}
