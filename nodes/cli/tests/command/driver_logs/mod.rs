//! Logs as drivers and estimators record them: the reference map cell for cell, or a refusal by name.
//!
//! `test/python/driver_logs.py` makes the logs with `rosbags` and the cells that they must give.

mod cases;
mod oddities;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::{Command, Stdio};

use lattice_core::voxels::file::MapContents;
use serde::Deserialize;
use serde_json::Value;

use self::cases::{Case, Outcome, cases, drivers};
use crate::nodes::figures;
use crate::{lattice, python};

const MAKER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../test/python/driver_logs.py"
);
/// Points of each cell by its index.
type Cells = BTreeMap<[i32; 3], u32>;

/// Output of the maker: maps, and the number of its map for each log.
#[derive(Deserialize)]
struct Made {
    maps: Vec<Vec<(i32, i32, i32, u32)>>,
    logs: BTreeMap<String, usize>,
}

impl Made {
    /// Makes the logs of some cases in `folder`.
    fn of(cases: &[Case], folder: &Path) -> Option<Self> {
        let logs: BTreeMap<_, _> = cases.iter().map(|case| (case.log, case.storage)).collect();
        let logs = logs.iter().map(|(log, storage)| format!("{log}:{storage}"));
        let mut maker = Command::new(python()?);
        maker.arg(MAKER).arg(folder).args(logs);
        let output = maker.stderr(Stdio::inherit()).output().unwrap();
        assert!(output.status.success(), "{MAKER}");
        Some(serde_json::from_slice(&output.stdout).unwrap())
    }

    fn cells(&self, log: &str) -> Cells {
        let rows = self.maps[self.logs[log]].iter();
        rows.map(|&(x, y, z, count)| ([x, y, z], count)).collect()
    }
}

fn cells_of_file(path: &Path) -> Cells {
    let map = MapContents::read(&std::fs::read(path).unwrap()[..], usize::MAX).unwrap();
    let datum = map.datum_index();
    let counts = map.voxels().unwrap().iter().map(|voxel| voxel.count);
    let index = |key: [i32; 3]| [0, 1, 2].map(|i| (i64::from(key[i]) + datum[i]) as i32);
    let keys = map.keys().iter().map(|key| index(key.unpack()));
    keys.zip(counts).collect()
}

/// Difference of a map from the reference, in words.
fn compare(found: &Cells, expected: &Cells) -> Result<(), String> {
    if found == expected {
        return Ok(());
    }
    let other = |a: &Cells, b: &Cells| a.keys().filter(|cell| !b.contains_key(*cell)).count();
    let counts = found.iter().filter(|(cell, count)| {
        let expected = expected.get(*cell);
        expected.is_some_and(|expected| expected != *count)
    });
    Err(format!(
        "{} cells instead of {}: {} beside, {} missing, {} of other counts",
        found.len(),
        expected.len(),
        other(found, expected),
        other(expected, found),
        counts.count()
    ))
}

/// Runs `lattice replay` of a case; its report if it ended as the case says.
fn replay(case: &Case, folder: &Path, options: &[&str]) -> Result<Option<Value>, String> {
    let bag = folder.join(case.log).display().to_string();
    let arguments = [&["replay", &bag, "--json"], case.arguments, options].concat();
    let output = lattice(&arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    let texts = match case.outcome {
        Outcome::Map => case.says,
        Outcome::Refused(texts) => texts,
    };
    let refused = !matches!(case.outcome, Outcome::Map);
    if output.status.code() != Some(i32::from(refused)) {
        return Err(format!("{}: {errors}", output.status));
    }
    if let Some(text) = texts.iter().find(|text| !errors.contains(*text)) {
        return Err(format!("no '{text}' in: {errors}"));
    }
    match refused {
        true => Ok(None),
        false => Ok(Some(serde_json::from_slice(&output.stdout).unwrap())),
    }
}

/// Runs a check on each case and shows all that fail.
fn check_all(cases: &[Case], check: impl Fn(&Case) -> Result<(), String>) {
    let failed = cases.iter().filter_map(|case| {
        let why = check(case).err()?;
        Some(format!("{} {:?}: {why}\n", case.log, case.arguments))
    });
    let failed: Vec<String> = failed.collect();
    let (count, all) = (failed.len(), cases.len());
    assert!(
        failed.is_empty(),
        "{count} of {all} logs:\n{}",
        failed.concat()
    );
}

#[test]
fn a_lidar_without_poses_is_mapped_by_its_odometry() {
    let folder = tempfile::tempdir().unwrap();
    let logs = [cases::mcap("lidar_alone"), cases::sqlite3("lidar_and_imu")];
    let Some(_) = Made::of(&logs, folder.path()) else {
        return;
    };
    for log in logs {
        let case = log.says(&["none in the log; lidar odometry on", "replayed directly"]);
        let report = replay(&case, folder.path(), &[]).unwrap().unwrap();
        let counts = &report["odometry"]["counts"];
        // The machine of the logs moves by 3.6 m in their 3 s; the first 0.3 m are not mapped.
        let count = |name: &str| counts[name].as_u64().unwrap();
        assert!((1..=4).contains(&count("lost_one_place")), "{report:#}");
        assert_eq!(
            count("scans_ok") + count("lost_one_place"),
            30,
            "{report:#}"
        );
        assert_eq!(report["odometry"]["scans_mapped"], count("scans_ok"));
        let path_m = counts["path_m"].as_f64().unwrap();
        assert!((2.7..5.0).contains(&path_m), "{path_m} m");
        let clouds_out = &report["transformer"]["counts"]["clouds_out"];
        assert_eq!(*clouds_out, count("scans_ok"), "{report:#}");
    }
}

#[test]
fn logs_of_drivers_give_the_reference_map_or_say_what_is_missing() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path();
    let cases = cases();
    let Some(made) = Made::of(&cases, folder) else {
        return;
    };
    check_all(&cases, |case| {
        let map = folder.join("map.lattice");
        let options = ["--direct", "--map-out", &map.display().to_string()];
        match replay(case, folder, &options)? {
            Some(_) => compare(&cells_of_file(&map), &made.cells(case.log)),
            None => Ok(()),
        }
    });
}

/// The same bags as a directory and, converted, as rosbag2.
#[test]
fn ros1_bags_give_the_map_of_their_rosbag2_twins() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path();
    let cases = cases::ros1();
    let Some(made) = Made::of(&cases, folder) else {
        return;
    };
    check_all(&cases, |case| {
        let map = folder.join("map.lattice");
        let options = ["--direct", "--map-out", &map.display().to_string()];
        replay(case, folder, &options)?;
        compare(&cells_of_file(&map), &made.cells(case.log))?;
        let [bag, out] = ["", "_converted"].map(|ending| {
            let bag = folder.join(format!("{}{ending}", case.log));
            bag.display().to_string()
        });
        let output = lattice(&["bag", "convert", &bag, "--out", &out]);
        let errors = String::from_utf8_lossy(&output.stderr);
        if !output.status.success() {
            return Err(format!("bag convert: {errors}"));
        }
        let direct = std::fs::read(&map).unwrap();
        let output = lattice(&[&["replay", &out], &options[..]].concat());
        let errors = String::from_utf8_lossy(&output.stderr);
        match output.status.success() && std::fs::read(&map).unwrap() == direct {
            true => Ok(()),
            false => Err(format!("not the map of the bag itself: {errors}")),
        }
    });
}

/// Lines in the last column of the tables of a page: its code spans, but for those said to be in the report.
fn quoted_lines(page: &str) -> Vec<String> {
    let rows = page.lines().filter(|line| line.starts_with('|'));
    let last = rows.filter_map(|row| row.trim_end_matches('|').rsplit(" | ").next());
    let said = last.filter(|cell| cell.starts_with('`') && !cell.contains("in the report"));
    let bare = |cell: &str| {
        cell.trim()
            .trim_start_matches("``")
            .trim_end_matches("``")
            .trim()
            .to_owned()
    };
    said.map(|cell| match cell.starts_with("``") {
        true => bare(cell),
        false => cell.trim().trim_matches('`').to_owned(),
    })
    .collect()
}

#[test]
fn each_line_on_the_page_of_odd_logs_is_one_that_a_log_gives() {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/odd_logs.md");
    let lines = quoted_lines(&std::fs::read_to_string(page).unwrap());
    assert!(lines.len() > 20, "{lines:?}");
    let texts: Vec<&str> = cases()
        .iter()
        .flat_map(|case| match case.outcome {
            Outcome::Map => case.says,
            Outcome::Refused(texts) => texts,
        })
        .copied()
        .collect();
    let is_asserted = |line: &&String| texts.iter().any(|text| text.contains(line.as_str()));
    let others: Vec<_> = lines.iter().filter(|line| !is_asserted(line)).collect();
    assert!(others.is_empty(), "no log is asserted to give {others:#?}");
}

#[test]
fn logs_of_drivers_give_the_same_over_dds() {
    let directory = tempfile::tempdir().unwrap();
    let folder = directory.path();
    let logs = |cases: &[Case]| {
        cases
            .iter()
            .map(|case| case.log)
            .collect::<BTreeSet<_>>()
            .len()
    };
    let over_dds = |cases: Vec<Case>| -> Vec<Case> {
        cases.into_iter().filter(|case| case.over_dds).collect()
    };
    let (part, count) = (logs(&over_dds(drivers())), logs(&drivers()));
    assert!(3 * part >= count, "{part} of {count}");
    let cases = over_dds(cases());
    let Some(made) = Made::of(&cases, folder) else {
        return;
    };
    check_all(&cases, |case| {
        let Some(played) = replay(case, folder, &["--rate", "3"])? else {
            return Ok(());
        };
        let expected = made.cells(case.log);
        let map = &played["lattices"][0]["map"];
        let points: u32 = expected.values().sum();
        if map["voxels"] != expected.len() || map["points"] != points {
            return Err(format!("{} cells, {} points", map["voxels"], map["points"]));
        }
        // The test above compares the direct map with the reference, cell for cell.
        let direct = replay(case, folder, &["--direct"])?.unwrap_or_default();
        match figures(&played) == figures(&direct) {
            true => Ok(()),
            false => Err("other figures than the direct replay".into()),
        }
    });
}
