//! The `lattice` command as a user runs it.

use std::io::{Write, stderr};
use std::path::Path;

use serde_json::Value;

use crate::{error, json, lattice, text};

/// A log of the simulated loader in `directory`.
pub fn simulated(directory: &Path, storage: &str, seconds: &str) -> String {
    let log = directory.join(storage).display().to_string();
    let bobcat = ["simulate", "bobcat", "--out", &log, "--duration", seconds];
    let summary = json(&[&bobcat[..], &["--storage", storage]].concat());
    assert!(summary["clouds"].as_u64().unwrap() > 100);
    log
}

const PARAMS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/bobcat.yaml");

/// Description of a map without the times and bytes that depend on the way it was made.
pub fn figures(report: &Value) -> Vec<Value> {
    let keys = "lattice voxels points mse_per_dimension_m2 map_checksum";
    let lattices = report["lattices"].as_array().unwrap().iter();
    lattices
        .map(|branch| {
            keys.split(' ')
                .map(|key| branch["map"][key].clone())
                .collect()
        })
        .collect()
}

#[test]
fn a_log_played_through_node_processes_gives_the_map_of_the_direct_replay() {
    let directory = tempfile::tempdir().unwrap();
    let log = simulated(directory.path(), "mcap", "3");
    let given = [&*log, "--params", PARAMS, "--lattice", "fcc,mcc"];
    let common = [&given[..], &["--orientation", "ground"]].concat();
    let direct = json(&[&["replay", "--direct", "--markers"], &common[..]].concat());
    let by_param = [&given[..], &["-p", "lattice_orientation:=ground"]].concat();
    let by_param = json(&[&["replay", "--direct"], &by_param[..]].concat());
    assert_eq!(figures(&by_param), figures(&direct));
    for (drawn, plain) in std::iter::zip(
        direct["lattices"].as_array().unwrap(),
        by_param["lattices"].as_array().unwrap(),
    ) {
        assert_eq!(drawn["markers"]["voxels"], drawn["map"]["voxels"]);
        assert!(drawn["markers"]["marker_bytes"].as_u64().unwrap() > 0);
        assert!(plain["markers"].is_null());
    }
    let paper = json(&[&["replay", "--direct"], &given[..]].concat());
    assert_ne!(figures(&paper), figures(&direct));
    let played = json(&[&["replay"], &common[..]].concat());
    for report in [&direct, &played] {
        let counts = &report["transformer"]["counts"];
        assert_eq!(counts["clouds_in"], report["clouds_in_log"]);
        assert_eq!(counts["clouds_out"], report["clouds_in_log"]);
        for lost in ["clouds_inbox_full", "clouds_not_published"] {
            assert_eq!(report["transformer"][lost], 0, "{lost}");
        }
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
    let direct = json(&["replay", "--direct", log, "--lattice", "bcc"]);
    let played = json(&["replay", log, "--lattice", "bcc"]);
    assert_eq!(played["transformer"]["counts"]["clouds_out"], 8);
    assert_eq!(played["lattices"][0]["map"]["points"], 994_498);
    assert_eq!(figures(&direct), figures(&played));
}

#[test]
fn both_storages_give_the_same_map() {
    let directory = tempfile::tempdir().unwrap();
    let [mcap, sqlite3] = ["mcap", "sqlite3"].map(|storage| {
        let log = simulated(directory.path(), storage, "2");
        figures(&json(&["replay", "--direct", &log, "--params", PARAMS]))
    });
    assert_eq!(mcap, sqlite3);
}

#[test]
fn a_map_file_can_be_looked_into_and_exported() {
    let directory = tempfile::tempdir().unwrap();
    let cloud = directory.path().join("cloud.xyz");
    std::fs::write(&cloud, "0 0 0\n0.01 0 0\n5 0 0\nnan 1 2\n").unwrap();
    let map = directory.path().join("cloud.lattice").display().to_string();
    let cloud = cloud.display().to_string();
    let quantize = ["quantize", &cloud, "--lattice", "fcc,cubic"];
    let rows = json(&[&quantize[..], &["--map-out", &map]].concat());
    assert_eq!(rows[0]["voxels"], 2);
    assert_eq!(rows[1]["lattice"], "cubic");
    assert_eq!(rows[1]["refused_not_finite"], 1);
    let info = json(&["map", "info", &map]);
    assert_eq!(info["voxels"], 2);
    assert_eq!(info["points"], 3);
    for (form, begin) in [("centers", "ply"), ("mesh", "ply"), ("png", "\u{fffd}PNG")] {
        let out = directory.path().join(form);
        let name = out.display().to_string();
        text(&["map", "export", &map, "--out", &name, "--as", form]);
        let bytes = std::fs::read(&out).unwrap();
        assert!(String::from_utf8_lossy(&bytes).starts_with(begin), "{form}");
    }
    let xyz = directory.path().join("centres.xyz").display().to_string();
    text(&["map", "export", &map, "-o", &xyz]);
    assert_eq!(std::fs::read_to_string(&xyz).unwrap().lines().count(), 2);
    assert_eq!(
        json(&["quantize", &xyz, "--lattice", "fcc"])[0]["voxels"],
        2
    );
    for (out, form, known) in [
        ("a.las", "centers", ".ply, .pcd, .xyz, .bt or .ot"),
        ("a.xyz", "mesh", ".ply"),
    ] {
        let out = directory.path().join(out);
        let line = error(&[
            "map",
            "export",
            &map,
            "-o",
            &out.display().to_string(),
            "--as",
            form,
        ]);
        assert!(line.contains(known) && !out.exists(), "{line}");
    }
}

#[test]
fn a_quantization_that_leaves_points_out_fails_and_labels_are_kept() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (cloud, map) = (at("cloud.ply"), at("map"));
    let rows: String = (0..60).map(|i| format!("{i} 0 0 {}\n", i % 2)).collect();
    let head = "ply\nformat ascii 1.0\nelement vertex 60\nproperty float x\nproperty float y\n\
                property float z\nproperty ushort label\nend_header\n";
    std::fs::write(&cloud, format!("{head}{rows}")).unwrap();
    let quantize = ["quantize", &cloud, "--lattice", "fcc", "--map-out", &map];
    let line = error(&[&quantize[..], &["--max-voxels", "5"]].concat());
    assert!(line.contains("55 points exceed --max-voxels 5"), "{line}");
    assert!(!std::path::Path::new(&map).exists());
    text(&quantize);
    let options = lattice_nodes::files::points::PointFileOptions::default();
    let read = lattice_nodes::files::semantic::read_semantic(map.as_ref(), &options).unwrap();
    let labels: Vec<_> = read.cloud.labels.iter().map(|label| label.top()).collect();
    assert_eq!(labels.len(), 60);
    assert!(labels.contains(&Some(0)) && labels.contains(&Some(1)));
    let nan = at("nan.xyz");
    std::fs::write(&nan, "nan 0 0\n").unwrap();
    assert!(error(&["quantize", &nan]).contains("none of its 1 points is finite"));
}

#[test]
fn errors_say_what_was_wrong_where_and_what_to_do() {
    let directory = tempfile::tempdir().unwrap();
    let nothing = directory.path().join("nothing").display().to_string();
    assert!(error(&["replay", "--direct", &nothing]).contains(&nothing));
    assert!(error(&["map", "info", &nothing]).contains(&nothing));
    assert!(error(&["quantize", &nothing]).contains(&nothing));
    let usage = lattice(&["quantize", &nothing, "--lattice", "penrose"]);
    assert!(String::from_utf8_lossy(&usage.stderr).contains("fcc"));
    assert!(!usage.status.success() && usage.stdout.is_empty());
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
        assert!(text(&[command, "--help"]).contains("Usage"));
    }
}

#[test]
fn the_help_of_a_node_has_every_parameter() {
    let help = text(&["node", "lattice_mapper", "--help"]);
    for line in [
        "  max_voxels: integer, 1 or more (default 20000000)\n      Most voxels.",
        "  lattice [fixed]: string (default \"fcc\")\n      cubic, bcc",
        "  when_full: string, refuse or forget_oldest (default \"refuse\")",
    ] {
        assert!(help.contains(line), "{help}");
    }
    let player = text(&["node", "bag_player", "-h"]);
    assert!(
        player.contains("  rate: double, 0.001 to 1000 (default 1.0)"),
        "{player}"
    );
}
