//! Files that `lattice` writes where the disk is full, or it is killed.

use std::fs;
use std::process::{Command, Output};

use crate::{error, json, lattice, text};

const PARAMS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../params/bobcat.yaml");

/// A call that may write files of a few kilobytes; `shell` sets what happens beyond.
fn confined(shell: &str, arguments: &[&str]) -> Output {
    let script = format!("{shell}; ulimit -f 8; exec \"$@\"");
    let mut command = Command::new("sh");
    command.args(["-c", &script, "sh", env!("CARGO_BIN_EXE_lattice")]);
    command.args(arguments).output().unwrap()
}

#[test]
fn on_a_full_disk_and_at_a_kill_the_old_file_stays_and_nothing_else() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (points, map) = (at("points.xyz"), at("map"));
    let grid = |i: u32| format!("{} {} {}\n", i % 50, i / 50 % 50, i / 2500);
    fs::write(&points, (0..20_000).map(grid).collect::<String>()).unwrap();
    let quantize = ["quantize", &points, "--cell-volume", "0.1", "--map-out"];
    text(&[&quantize[..], &[&map]].concat());
    let folder = directory.path().join("out");
    fs::create_dir(&folder).unwrap();
    let out = folder.join("file").display().to_string();
    let commands: [&[&str]; 6] = [
        &quantize,
        &["map", "export", &map, "-o"],
        &["map", "export", &map, "--as", "mesh", "-o"],
        &["map", "export", &map, "--as", "png", "-o"],
        &["map", "merge", &map, "-o"],
        &["simulate", "site", "--points", "9000", "--out"],
    ];
    for command in commands {
        let command = [command, &[&out]].concat();
        for full in ["trap '' XFSZ", "true"] {
            fs::write(&out, "old").unwrap();
            let output = confined(full, &command);
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(!output.status.success(), "{command:?}: {errors}");
            assert_eq!(output.status.code().is_some(), full != "true");
            assert!(full == "true" || errors.contains(&out), "{errors}");
            assert_eq!(fs::read_to_string(&out).unwrap(), "old", "{command:?}");
            assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "{command:?}");
        }
        assert!(lattice(&command).status.success());
        fs::remove_dir_all(&folder).unwrap();
        fs::create_dir(&folder).unwrap();
    }
}

#[test]
fn a_report_that_cannot_be_written_is_refused_at_the_start() {
    let directory = tempfile::tempdir().unwrap();
    for nowhere in [directory.path(), &directory.path().join("no/where")] {
        for node in [
            "enu_transformer",
            "lattice_mapper",
            "voxel_marker_publisher",
        ] {
            let report = format!("report_file:={}", nowhere.display());
            let output = lattice(&["node", node, "--ros-args", "-p", &report]);
            let errors = String::from_utf8_lossy(&output.stderr);
            assert!(!output.status.success(), "{errors}");
            assert!(errors.contains("report_file"), "{errors}");
        }
    }
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 0);
    assert!(error(&["map", "info", "nowhere"]).contains("nowhere"));
}

#[test]
fn an_earlier_log_stays_until_the_new_one_is_whole() {
    let directory = tempfile::tempdir().unwrap();
    let log = directory.path().join("log").display().to_string();
    let simulate = |duration| {
        [
            "simulate",
            "bobcat",
            "--overwrite",
            "--out",
            &log,
            "--duration",
            duration,
        ]
    };
    text(&simulate("2"));
    let files = || {
        let names = [
            "log_0.mcap",
            "metadata.yaml",
            "truth/poses.csv",
            "truth/points.ply",
        ];
        names.map(|name| fs::read(directory.path().join("log").join(name)).unwrap())
    };
    let before = files();
    for full in ["trap '' XFSZ", "true"] {
        assert!(!confined(full, &simulate("3")).status.success());
        assert!(files() == before, "{full}");
    }
    text(&simulate("3"));
    assert!(files() != before);
    assert_eq!(
        json(&["bag", "info", &log])["topics"]
            .as_array()
            .unwrap()
            .len(),
        7
    );
}

#[test]
fn a_cut_log_is_recovered() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (log, out) = (at("log"), at("sound"));
    json(&["simulate", "bobcat", "--out", &log, "--duration", "8"]);
    let file = directory.path().join("log/log_0.mcap");
    let whole = fs::read(&file).unwrap();
    fs::write(&file, &whole[..whole.len() * 3 / 4]).unwrap();
    let refused = lattice(&["replay", "--direct", &log, "--params", PARAMS]);
    let errors = String::from_utf8_lossy(&refused.stderr);
    assert!(errors.contains("truncated") && errors.contains("lattice bag recover"));
    let recovered = json(&["bag", "recover", &log, "--out", &out]);
    assert!(recovered["messages"].as_u64() > Some(10), "{recovered}");
    assert!(recovered["told"][0].as_str().unwrap().contains("truncated"));
    let report = json(&["replay", "--direct", &out, "--params", PARAMS]);
    assert!(report["clouds_in_log"].as_u64() > Some(1), "{report}");
}
