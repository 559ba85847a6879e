//! Corrections of logs whose poses do not fit the merged map.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::fixture::{json as figures, refused, run, text};
use crate::logs::Logs;

/// Error of the INS of the second log: m to the east, north and up, degrees about up.
const OFFSET: [&str; 4] = ["0.8", "-0.5", "0.3", "0.4"];

fn read(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

/// A site of one log, and a log to align with it.
fn site(folder: &Path, offset: &[&str]) -> Option<(Logs, Logs)> {
    let site = Logs::simulate(&folder.join("old"), 1, "20", &[])?;
    let tables = folder.join("site");
    run(site.map(&tables, &[]));
    run(["merge", text(&tables)]);
    let mut new = Logs::simulate(&folder.join("new"), 2, "16", offset)?;
    new.logs.remove(0);
    run(new.map(&folder.join("trial"), &[]));
    Some((site, new))
}

fn align(folder: &Path, tables: &str, program: &Path, out: &Path) -> Vec<String> {
    let (tables, against) = (folder.join(tables), folder.join("site/merged"));
    let arguments = [
        "align",
        text(&tables),
        "--against",
        text(&against),
        "--program",
        text(program),
        "--out",
        text(out),
    ];
    arguments.map(str::to_owned).to_vec()
}

#[test]
fn a_log_that_lies_elsewhere_is_moved_onto_the_map() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let offset = [&["--ins-offset"][..], &OFFSET].concat();
    let Some((old, new)) = site(folder, &offset) else {
        return;
    };
    let out = folder.join("corrections.json");
    let said = run(align(folder, "trial", &old.lattice, &out));
    assert!(said.contains("1 to move"), "{said}");
    let found = read(&out)["logs"][0].clone();
    assert_eq!(
        (&found["action"], &found["found"]["verdict"]),
        (&json!("move"), &json!("OK"))
    );
    let site = folder.join("site");
    let report = figures(&run(new.map(&site, &["--corrections", text(&out)])));
    assert_eq!(
        (&report["parts_new"], &report["tasks_corrected"]),
        (&json!(1), &json!(1))
    );
    run(["merge", text(&site)]);
    // What is corrected says so, and is not corrected again.
    run(new.map(&folder.join("moved"), &["--corrections", text(&out)]));
    let again = align(folder, "moved", &old.lattice, &folder.join("again.json"));
    let said = refused(again);
    assert!(said.contains("corrected already"), "{said}");
    let offset_m = found["found"]["largest_move_m"].as_f64().unwrap();
    assert!((0.9..1.6).contains(&offset_m), "{offset_m}");
    let turn_deg = found["found"]["turn_deg"].as_f64().unwrap();
    assert!((turn_deg - 0.4).abs() < 0.1, "{turn_deg}");
    // What was applied undoes the error: here at the origin, where its turn moves nothing.
    let sum = |axis: usize| {
        let offset_m: f64 = OFFSET[axis].parse().unwrap();
        found["translation_m"][axis].as_f64().unwrap() + offset_m
    };
    let rest_m = (0..3).map(|axis| sum(axis).powi(2)).sum::<f64>().sqrt();
    assert!(rest_m < 0.06, "{rest_m}: {found}");
}

#[test]
fn a_log_that_fits_is_kept_and_one_that_moves_too_far_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let Some((old, new)) = site(folder, &[]) else {
        return;
    };
    let out = folder.join("corrections.json");
    let mut arguments = align(folder, "trial", &old.lattice, &out);
    let said = run(&arguments);
    assert!(said.contains("1 to keep"), "{said}");
    let report = figures(&run(
        new.map(&folder.join("kept"), &["--corrections", text(&out)])
    ));
    assert_eq!(
        (&report["parts_new"], &report["tasks_corrected"]),
        (&json!(1), &json!(0))
    );
    arguments.extend(["--min-move", "0", "--max-move", "0.000001"].map(str::to_owned));
    let said = run(&arguments);
    assert!(said.contains("1 to leave out"), "{said}");
    let tables = folder.join("left_out");
    let said = refused(new.map(&tables, &["--corrections", text(&out)]));
    assert!(said.contains("left out") && said.contains("log2"), "{said}");
    // The map that holds a log is no reference for it.
    let said = refused(align(folder, "site", &old.lattice, &out));
    assert!(
        said.contains("in the map that it would be aligned with"),
        "{said}"
    );
}
