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
