//! `lattice evaluate` as a user runs it.

use std::path::Path;

use serde_json::Value;

use crate::{error, json, text};

fn evaluate<'a>(folder: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
    let quick = ["evaluate", "calibration", "--quick", "--scenes", "desk"];
    [&quick[..], &["--out", folder.to_str().unwrap()], more].concat()
}

/// The lines of the results in an order of their own, without the times.
fn trials(folder: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(folder.join("trials.jsonl")).unwrap();
    let line = |line: &str| {
        let mut trial: Value = serde_json::from_str(line).unwrap();
        trial.as_object_mut().unwrap().remove("wall_ms");
        trial.to_string()
    };
    let mut lines: Vec<String> = text.lines().map(line).collect();
    lines.sort_unstable();
    lines
}

#[test]
fn an_evaluation_is_continued_and_does_not_depend_on_threads() {
    let folder = tempfile::tempdir().unwrap();
    let report = text(&evaluate(folder.path(), &["--threads", "2"]));
    let all = trials(folder.path());
    // Settings; two shares of wrong labels, from a start by ten methods and without by ours; two timed.
    assert_eq!(all.len(), 1 + 2 * (10 + 1) + 2);
    for part in [
        "## Table 1 of the paper",
        "| desk | 5.42 | 0.05 |",
        "## What is accepted",
    ] {
        assert!(report.contains(part), "{report}");
    }
    for picture in ["d_se3", "success", "paired", "margins"] {
        let picture = folder.path().join(format!("{picture}.svg"));
        let text = std::fs::read_to_string(picture).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
    }

    // Ended in the middle of a line.
    let path = folder.path().join("trials.jsonl");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, &text[..text.len() * 3 / 4]).unwrap();
    let summary = json(&evaluate(folder.path(), &["--threads", "1"]));
    assert_eq!(summary["trials"], all.len() as u64 - 1);
    assert_eq!(trials(folder.path()), all);

    let other = error(&evaluate(folder.path(), &["--headset-scans", "2"]));
    assert!(other.contains("other settings"), "{other}");
}

#[test]
fn seeds_and_maps_without_end_are_refused_at_once() {
    for (command, option) in [
        ("calibration", "seeds"),
        ("calibration", "maps"),
        ("traps", "seeds"),
        ("town", "seeds"),
        ("rooms", "seeds"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let out = ["--out", folder.path().to_str().unwrap()];
        let most = u64::MAX.to_string();
        let option_of = format!("--{option}");
        let said = error(&[&["evaluate", command, &option_of, &most], &out[..]].concat());
        let expected = format!("{option} is {}, not within", u64::MAX as f64);
        assert!(said.contains(&expected), "{command}: {said}");
    }
}

/// Points of a room with a box in it, 5 cm apart, as lines of text; all of them moved by `x_m`.
fn room(x_m: f64) -> String {
    let patch = |[x, y, z]: [f64; 3], u: [f64; 3], v: [f64; 3], n: [u32; 2]| {
        let points = (0..n[0]).flat_map(move |i| (0..n[1]).map(move |j| (i, j)));
        let point = move |(i, j)| {
            let [s, t] = [i, j].map(|k: u32| 0.05 * (f64::from(k) + 0.5));
            let at = |k: usize| u[k] * s + v[k] * t;
            format!("{} {} {}\n", x + x_m + at(0), y + at(1), z + at(2))
        };
        points.map(point).collect::<String>()
    };
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    [
        patch([-2.0, -1.5, 0.0], x, y, [80, 60]),
        patch([-2.0, -1.5, 0.0], x, z, [80, 50]),
        patch([-2.0, 1.5, 0.0], x, z, [80, 50]),
        patch([-2.0, -1.5, 0.0], y, z, [60, 50]),
        patch([2.0, -1.5, 0.0], y, z, [60, 50]),
        patch([0.8, 0.2, 0.0], y, z, [24, 20]),
        patch([0.8, 0.2, 1.0], x, y, [16, 24]),
        patch([0.8, 0.2, 0.0], x, z, [16, 20]),
    ]
    .concat()
}

#[test]
fn parts_of_a_scan_are_found_in_another_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (map, cloud, truth, out) = (path("a.xyz"), path("b.xyz"), path("pose.txt"), path("out"));
    std::fs::write(&map, room(0.0)).unwrap();
    std::fs::write(&cloud, room(-0.3)).unwrap();
    std::fs::write(&truth, "1 0 0 0.3\n0 1 0 0\n0 0 1 0\n0 0 0 1\n").unwrap();
    let base = [
        "evaluate", "scans", "--map", &map, "--cloud", &cloud, "--out", &out,
    ];
    let more = ["--seeds", "1", "--sensor", "-0.8 0 1.5", "--truth", &truth];
    let all = [&base[..], &more].concat();
    let report = text(&[&all[..], &["--widths", "360"]].concat());
    assert!(
        report.contains("| 360 degrees | 1 | 1, 100 % |"),
        "{report}"
    );
    let said = error(&[&all[..], &["--widths", "0"]].concat());
    assert!(said.contains("widths is 0, not within"), "{said}");
    // Another place of the sensor, and the pose that a calibration finds.
    let said = error(&[&base[..], &["--seeds", "1"]].concat());
    assert!(said.contains("other settings"), "{said}");
    std::fs::write(&truth, "1 0 0\n").unwrap();
    let said = error(&all);
    assert!(said.contains("is not a rigid transform"), "{said}");
}
