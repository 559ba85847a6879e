//! Files that `lattice` writes where the disk is full, the folder read-only, or it is killed.

use std::collections::BTreeMap;
use std::fs::{self, Permissions};
use std::io::{Write, stderr};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use lattice_runtime::LoopbackDomain;

use crate::record::{expect, play, spawn};
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
            assert_eq!(
                output.status.code(),
                Some(1),
                "{command:?} {full}: {errors}"
            );
            assert!(errors.contains(&out), "{errors}");
            assert_eq!(fs::read_to_string(&out).unwrap(), "old", "{command:?}");
            assert_eq!(fs::read_dir(&folder).unwrap().count(), 1, "{command:?}");
        }
        assert!(lattice(&command).status.success());
        fs::remove_dir_all(&folder).unwrap();
        fs::create_dir(&folder).unwrap();
    }
}

/// User of no rights.
const NOBODY: u32 = 65_534;

/// A call by a user whom permissions hold for; root is none.
fn by_nobody(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lattice"));
    command.args(arguments).env_remove("ROS_DOMAIN_ID");
    if fs::metadata("/proc/self").unwrap().uid() == 0 {
        command.uid(NOBODY).gid(NOBODY).env("HOME", "/nonexistent");
    }
    command
}

/// False, with a line, where that user cannot run the command.
fn nobody_can_run() -> bool {
    let version = by_nobody(&["--version"]).output();
    let runs = version.is_ok_and(|output| output.status.success());
    if !runs {
        let _ = writeln!(stderr(), "SKIPPED: a user without rights cannot run it");
    }
    runs
}

/// Every file below a folder, with its bytes.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => all.extend(contents(&path)),
            false => drop(all.insert(path.clone(), fs::read(&path).unwrap())),
        }
    }
    all
}

/// Sets who may do what with a folder and the folders in it; files are for everybody.
fn set_mode(folder: &Path, mode: u32) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => set_mode(&path, mode),
            false => fs::set_permissions(&path, Permissions::from_mode(0o666)).unwrap(),
        }
    }
    fs::set_permissions(folder, Permissions::from_mode(mode)).unwrap();
}

#[test]
fn in_a_read_only_folder_old_files_stay_and_the_error_names_it() {
    if !nobody_can_run() {
        return;
    }
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (points, map, log) = (at("points.xyz"), at("map"), at("locked/log"));
    let grid = |i: u32| format!("{} {} {}\n", i % 50, i / 50 % 50, i / 2500);
    fs::write(&points, (0..20_000).map(grid).collect::<String>()).unwrap();
    let quantize = ["quantize", &points, "--cell-volume", "0.1", "--map-out"];
    text(&[&quantize[..], &[&map]].concat());
    fs::create_dir(directory.path().join("locked")).unwrap();
    let simulate = ["simulate", "bobcat", "--duration", "4"];
    text(&[&simulate[..], &["--out", &log]].concat());
    let (out, new) = (at("locked/file"), at("locked/new"));
    fs::write(&out, "old").unwrap();
    fs::copy(&map, at("locked/autosave.lattice")).unwrap();
    let locked = directory.path().join("locked");
    set_mode(directory.path(), 0o755);
    set_mode(&locked, 0o555);
    let before = contents(&locked);
    let report = format!("report_file:={out}");
    let node = ["node", "lattice_mapper", "--ros-args", "-p", &report];
    let recover = ["bag", "recover", &log, "--out", &new];
    let replay = ["replay", "--direct", &log, "--params", PARAMS, "--map-out"];
    let commands: [Vec<&str>; 13] = [
        [&quantize[..], &[&out]].concat(),
        vec!["map", "export", &map, "-o", &out],
        vec!["map", "export", &map, "--as", "mesh", "-o", &out],
        vec!["map", "export", &map, "--as", "png", "-o", &out],
        vec!["map", "merge", &map, "-o", &out],
        vec!["simulate", "site", "--points", "9000", "--out", &out],
        vec!["simulate", "house", "--out", &new],
        [&simulate[..], &["--out", &new]].concat(),
        [&simulate[..], &["--overwrite", "--out", &log]].concat(),
        [&replay[..], &[&out]].concat(),
        recover.to_vec(),
        vec!["record", "-a", "-o", &new],
        node.to_vec(),
    ];
    for command in commands {
        let output = by_nobody(&command).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{command:?}: {errors}");
        let last = errors.lines().last().unwrap_or_default();
        let clear = last.contains("/locked") && last.contains("Permission denied");
        assert!(clear, "{command:?}: {errors}");
        assert!(contents(&locked) == before, "{command:?}");
    }
    a_map_that_is_not_saved_is_told(&log, &locked);
    assert!(contents(&locked) == before);
    set_mode(&locked, 0o755);
}

/// A mapper whose folder is read-only still maps, and reports that it saves nothing.
fn a_map_that_is_not_saved_is_told(log: &str, folder: &Path) {
    let domain = LoopbackDomain::take().unwrap();
    let maps = format!("lattice_mapper:map_dir:={}", folder.display());
    let period = "lattice_mapper:autosave_period_s:=0.2";
    let mut command = by_nobody(&["run", PARAMS, "--", "--ros-args", "-p", &maps, "-p", period]);
    let mut nodes = spawn(&domain, &mut command);
    let mut player = play(&domain, log, &["loop:=true"]);
    drop(player.stderr.take());
    let told = "the map is not saved: \"autosave.lattice\": Permission denied";
    expect(&mut nodes, &[told]);
    player.kill().unwrap();
    player.wait().unwrap();
    nodes.kill().unwrap();
    nodes.wait().unwrap();
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
        assert_eq!(confined(full, &simulate("3")).status.code(), Some(1));
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
fn a_cut_log_is_replayed_up_to_the_cut_and_recovered() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name).display().to_string();
    let (log, out) = (at("log"), at("sound"));
    json(&["simulate", "bobcat", "--out", &log, "--duration", "8"]);
    let file = directory.path().join("log/log_0.mcap");
    let whole = fs::read(&file).unwrap();
    fs::write(&file, &whole[..whole.len() * 3 / 4]).unwrap();
    let all = json(&["bag", "info", &log])["metadata_messages"].as_u64();
    for log in [&log, &file.display().to_string()] {
        let cut = json(&["replay", "--direct", log, "--params", PARAMS]);
        assert!(cut["clouds_in_log"].as_u64() > Some(1), "{cut}");
        let told = cut["cuts"][0].as_str().unwrap();
        assert!(
            told.contains("truncated") && told.contains("messages precede it"),
            "{told}"
        );
    }
    let recovered = json(&["bag", "recover", &log, "--out", &out]);
    let messages = recovered["messages"].as_u64().unwrap();
    assert!(messages > 10, "{recovered}");
    assert_eq!(
        (recovered["claimed"].as_u64(), recovered["lost"].as_u64()),
        (all, Some(all.unwrap() - messages))
    );
    let told = recovered["told"][0].as_str().unwrap();
    assert!(
        told.contains("truncated") && !told.contains("bag recover"),
        "{told}"
    );
    let report = json(&["replay", "--direct", &out, "--params", PARAMS]);
    assert!(report["clouds_in_log"].as_u64() > Some(1), "{report}");
    assert_eq!(report["cuts"].as_array().map(Vec::len), Some(0));
    // Without metadata nobody knows how many there were.
    fs::remove_file(directory.path().join("log/metadata.yaml")).unwrap();
    let said = text(&["bag", "recover", &log, "--out", &at("again")]);
    assert!(
        said.contains("unknown how many are lost") && !said.contains("0 lost"),
        "{said}"
    );
    // Of nothing that can be read no log is made.
    fs::write(&file, &whole[..200]).unwrap();
    let nothing = lattice(&["bag", "recover", &log, "--out", &at("nothing")]);
    let errors = String::from_utf8_lossy(&nothing.stderr);
    assert_eq!(nothing.status.code(), Some(1), "{errors}");
    assert!(errors.contains("nothing can be recovered"), "{errors}");
    assert!(!Path::new(&at("nothing")).exists());
}
