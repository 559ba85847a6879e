//! The `lattice` command as a user runs it.

use std::io::{Write, stderr};
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn lattice(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lattice"))
        .args(arguments)
        // Each replay takes a domain of its own.
        .env_remove("ROS_DOMAIN_ID")
        .output()
        .unwrap()
}

fn json(arguments: &[&str]) -> Value {
    let output = lattice(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn error(arguments: &[&str]) -> String {
    let output = lattice(arguments);
    assert!(!output.status.success(), "{arguments:?} should fail");
    assert!(output.stdout.is_empty());
    String::from_utf8(output.stderr).unwrap()
}

fn simulated(directory: &Path, storage: &str, seconds: &str) -> String {
    let log = directory.join(storage).display().to_string();
    let summary = json(&[
        "simulate",
        "bobcat",
        "--out",
        &log,
        "--duration",
        seconds,
        "--storage",
        storage,
        "--json",
    ]);
    assert!(summary["clouds"].as_u64().unwrap() > 100);
    log
}

const PARAMS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/bobcat.yaml");

/// Description of a map without the times and bytes that depend on the way it was made.
fn figures(report: &Value) -> Vec<Value> {
    let keys = [
        "lattice",
        "voxels",
        "points",
        "mse_per_dimension_m2",
        "map_crc32",
    ];
    let lattices = report["lattices"].as_array().unwrap().iter();
    lattices
        .map(|branch| keys.iter().map(|key| branch["map"][*key].clone()).collect())
        .collect()
}

#[test]
fn a_log_played_through_node_processes_gives_the_map_of_the_direct_replay() {
    let directory = tempfile::tempdir().unwrap();
    let log = simulated(directory.path(), "mcap", "3");
    let given = [&*log, "--params", PARAMS, "--lattice", "fcc,mcc", "--json"];
    let common = [&given[..], &["--orientation", "ground"]].concat();
    let direct = json(&[&["replay", "--direct"], &common[..]].concat());
    let by_param = [&given[..], &["-p", "lattice_orientation:=ground"]].concat();
    let by_param = json(&[&["replay", "--direct"], &by_param[..]].concat());
    assert_eq!(figures(&by_param), figures(&direct));
    let paper = json(&[&["replay", "--direct"], &given[..]].concat());
    assert_ne!(figures(&paper), figures(&direct));
    let played = json(&[&["replay"], &common[..]].concat());
    assert_eq!(
        direct["transformer"]["counts"]["clouds_dropped"],
        Value::Null
    );
    for report in [&direct, &played] {
        let counts = &report["transformer"]["counts"];
        assert_eq!(counts["clouds_in"], report["clouds_in_log"]);
        assert_eq!(counts["clouds_out"], report["clouds_in_log"]);
        assert_eq!(report["transformer"]["clouds_inbox_full"], 0);
    }
    assert_eq!(figures(&direct), figures(&played));
    for branch in played["lattices"].as_array().unwrap() {
        assert_eq!(branch["markers"]["voxels"], branch["map"]["voxels"]);
    }
}

#[test]
fn no_cloud_of_a_real_log_is_lost_on_the_way_through_node_processes() {
    let log = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../shared/data/kitti00/bag_mcap"
    );
    let buffer = std::fs::read_to_string("/proc/sys/net/core/rmem_max").unwrap_or_default();
    let large = buffer
        .trim()
        .parse::<u64>()
        .is_ok_and(|bytes| bytes >= 4 << 20);
    if !Path::new(log).exists() || !large {
        let _ = writeln!(
            stderr(),
            "SKIPPED: no {log}, or net.core.rmem_max below 4 MiB"
        );
        return;
    }
    let direct = json(&["replay", "--direct", log, "--lattice", "bcc", "--json"]);
    let played = json(&["replay", log, "--lattice", "bcc", "--json"]);
    assert_eq!(played["transformer"]["counts"]["clouds_out"], 8);
    assert_eq!(played["lattices"][0]["map"]["points"], 994_498);
    assert_eq!(figures(&direct), figures(&played));
}

#[test]
fn both_storages_give_the_same_map() {
    let directory = tempfile::tempdir().unwrap();
    let reports = ["mcap", "sqlite3"].map(|storage| {
        let log = simulated(directory.path(), storage, "2");
        json(&["replay", "--direct", &log, "--params", PARAMS, "--json"])
    });
    assert_eq!(figures(&reports[0]), figures(&reports[1]));
}

#[test]
fn a_map_file_can_be_looked_into_and_exported() {
    let directory = tempfile::tempdir().unwrap();
    let cloud = directory.path().join("cloud.xyz");
    std::fs::write(&cloud, "0 0 0\n0.01 0 0\n5 0 0\nnan 1 2\n").unwrap();
    let map = directory.path().join("cloud.lattice").display().to_string();
    let cloud = cloud.display().to_string();
    let rows = json(&[
        "quantize",
        &cloud,
        "--lattice",
        "fcc,cubic",
        "--map-out",
        &map,
        "--json",
    ]);
    assert_eq!(rows[0]["voxels"], 2);
    assert_eq!(rows[1]["lattice"], "cubic");
    assert_eq!(rows[1]["refused_not_finite"], 1);
    let info = json(&["map", "info", &map, "--json"]);
    assert_eq!(info["voxels"], 2);
    assert_eq!(info["points"], 3);
    for (form, begin) in [("centers", "ply"), ("mesh", "ply"), ("png", "\u{fffd}PNG")] {
        let out = directory.path().join(form);
        let name = out.display().to_string();
        let output = lattice(&["map", "export", &map, "--out", &name, "--as", form]);
        assert!(output.status.success());
        let bytes = std::fs::read(&out).unwrap();
        assert!(String::from_utf8_lossy(&bytes).starts_with(begin), "{form}");
    }
}

#[test]
fn errors_say_what_was_wrong_where_and_what_to_do() {
    let directory = tempfile::tempdir().unwrap();
    let nothing = directory.path().join("nothing").display().to_string();
    assert!(error(&["replay", "--direct", &nothing]).contains(&nothing));
    assert!(error(&["map", "info", &nothing]).contains(&nothing));
    assert!(error(&["quantize", &nothing]).contains(&nothing));
    assert!(error(&["quantize", &nothing, "--lattice", "penrose"]).contains("fcc"));
    assert!(error(&["node", "nobody"]).contains("lattice_mapper"));
    assert!(error(&["run", &nothing]).contains(&nothing));
    let log = simulated(directory.path(), "mcap", "2");
    let wrong = error(&["replay", "--direct", &log, "--points", "/nowhere"]);
    assert!(
        wrong.contains("/nowhere") && wrong.contains("/left/points"),
        "{wrong}"
    );
    let wrong = error(&["replay", "--direct", &log, "-p", "cell_volume_m3:=-1.0"]);
    assert!(wrong.contains("cell_volume_m3"), "{wrong}");
    assert!(error(&["simulate", "bobcat", "--out", &log]).contains("overwrite"));
}

#[test]
fn every_command_has_help() {
    for command in ["demo", "run", "replay", "simulate", "quantize", "map"] {
        let output = lattice(&[command, "--help"]);
        assert!(output.status.success());
        assert!(String::from_utf8(output.stdout).unwrap().contains("Usage"));
    }
}
