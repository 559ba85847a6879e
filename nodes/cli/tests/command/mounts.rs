//! `lattice calibrate mounts` as a user runs it.

use std::path::Path;

use serde_json::Value;

use crate::lattice;

/// Exit status, standard output and errors.
fn mounts(arguments: &[&str]) -> (i32, String, String) {
    let output = lattice(&[&["calibrate", "mounts"], arguments].concat());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let status = output.status.code().unwrap();
    (status, text(&output.stdout), text(&output.stderr))
}

fn simulate(arguments: &[&str], folder: &Path) -> String {
    let log = folder.display().to_string();
    let output = lattice(&[&["simulate"], arguments, &["--out", &log]].concat());
    assert!(output.status.success());
    log
}

fn triple(value: &Value) -> [f64; 3] {
    let values = value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap());
    values.collect::<Vec<_>>().try_into().unwrap()
}

#[test]
fn a_wrong_boresight_of_the_loader_is_found_checked_and_gone_with_the_parameters() {
    let folder = tempfile::tempdir().unwrap();
    let log = simulate(&["bobcat", "--duration", "30"], &folder.path().join("log"));
    let sensors = [
        "--ins",
        "inspvax",
        "--points",
        "/left/points",
        "--points",
        "/right/points",
        "--points",
        "/top/points",
    ];
    let run = |options: &[&str]| mounts(&[&[log.as_str()], &sensors[..], options].concat());
    let (status, stdout, stderr) = run(&["--json"]);
    assert_eq!(status, 0, "{stderr}");
    let stated: Value = serde_json::from_str(&stdout).unwrap();
    for number in stated["numbers"].as_array().unwrap() {
        let limit = if number["unit"] == "deg" { 0.3 } else { 0.15 };
        assert!(
            number["correction"].as_f64().unwrap().abs() < limit,
            "{number}"
        );
    }
    // 3 degrees and 0.2 m beside the INS of the log.
    let lever_arm = triple(&stated["parameters"]["ins.lever_arm_m"]);
    let boresight = triple(&stated["parameters"]["ins.boresight_rpy_rad"]);
    let list = |[x, y, z]: [f64; 3]| format!("[{x:.6}, {y:.6}, {z:.6}]");
    let params = |lever_arm: [f64; 3], boresight: [f64; 3]| {
        [
            format!("ins.lever_arm_m:={}", list(lever_arm)),
            format!("ins.boresight_rpy_rad:={}", list(boresight)),
        ]
    };
    let [x, y, z] = lever_arm;
    let [roll, pitch, yaw] = boresight;
    let [wrong_arm, wrong_turn] = params([x + 0.2, y - 0.1, z], [roll, pitch, yaw + 0.05]);
    let (status, _, stderr) = run(&["--check", "-p", &wrong_arm, "-p", &wrong_turn]);
    assert_eq!(status, 1);
    assert!(
        stderr.contains("degrees better if turned about z: `lattice calibrate mounts"),
        "{stderr}"
    );
    let wrong = ["-p", &wrong_arm, "-p", &wrong_turn];
    let replay = [&["replay", "--direct", &log], &sensors[..], &wrong[..]].concat();
    let output = lattice(&replay);
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{printed}");
    assert!(
        printed.contains("note: clouds fit") && printed.contains("better if turned about z"),
        "{printed}"
    );
    let (status, stdout, stderr) = run(&["-p", &wrong_arm, "-p", &wrong_turn, "--json"]);
    assert_eq!(status, 0, "{stderr}");
    let found: Value = serde_json::from_str(&stdout).unwrap();
    let arm = triple(&found["parameters"]["ins.lever_arm_m"]);
    let turn = triple(&found["parameters"]["ins.boresight_rpy_rad"]);
    for (found, stated) in arm.iter().zip(lever_arm).take(2) {
        assert!((found - stated).abs() < 0.03, "{arm:?} {lever_arm:?}");
    }
    for (found, stated) in turn.iter().zip(boresight) {
        assert!((found - stated).abs() < 0.003, "{turn:?} {boresight:?}");
    }
    let [right_arm, right_turn] = params(arm, turn);
    let (status, stdout, stderr) = run(&["--check", "-p", &right_arm, "-p", &right_turn]);
    assert_eq!(status, 0, "{stderr}");
    assert!(stdout.contains("the stated mount fits"), "{stdout}");
}

#[test]
fn logs_without_poses_and_several_sensors_without_a_choice_are_refused_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let drive = simulate(&["drive", "--duration", "2"], &folder.path().join("drive"));
    let (status, _, stderr) = mounts(&[&drive]);
    assert_eq!(status, 1);
    assert!(
        stderr.contains("the log has no poses") && stderr.contains("record one"),
        "{stderr}"
    );
    let log = simulate(
        &["bobcat", "--duration", "2"],
        &folder.path().join("loader"),
    );
    let (status, _, stderr) = mounts(&[&log]);
    assert_eq!(status, 1);
    assert!(
        stderr.contains("3 sensors") && stderr.contains("--points /left/points"),
        "{stderr}"
    );
    let (status, _, stderr) = mounts(&["--points", "/left/points", &log, "--start", "100"]);
    assert_eq!(status, 1);
    assert!(stderr.contains("no points with poses"), "{stderr}");
}
