//! `lattice demo --indoor`: a survey and a headset through the nodes, short and with true labels.

use crate::json;

#[test]
fn a_headset_is_found_in_the_map_of_a_short_survey() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo").display().to_string();
    let report = json(&[
        "demo",
        "--indoor",
        "--true-labels",
        "--no-view",
        "--views",
        "240",
        "--rate",
        "3",
        "--out",
        &out,
    ]);
    assert_eq!(report["verdict"], "OK", "{report}");
    for (name, most) in [("off_m", 0.15), ("off_deg", 3.0)] {
        let off = report[name].as_f64();
        assert!(off.is_some_and(|off| off < most), "{name}: {report}");
    }
    // Every image became a cloud, and of each the true labels came to the map.
    assert_eq!(
        (&report["images"], &report["clouds"]),
        (&240.into(), &240.into())
    );
    assert!(report["headset_clouds"].as_u64() > Some(3), "{report}");
    assert!(report["label_share"].as_f64() > Some(0.97), "{report}");
    assert!(
        report["map_labels"]["compared"].as_u64() > Some(10_000),
        "{report}"
    );
    for name in [
        "log/metadata.yaml",
        "map.lattice",
        "rgbd.yaml",
        "headset.yaml",
    ] {
        assert!(folder.path().join("demo").join(name).exists(), "{name}");
    }
}

#[cfg(not(feature = "onnx"))]
#[test]
fn a_build_without_networks_says_what_to_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().display().to_string();
    let said = crate::error(&["demo", "--indoor", "--out", &out]);
    let command = "cargo run --release --features onnx --bin lattice -- demo --indoor";
    assert!(
        said.contains(command) && said.contains("--true-labels"),
        "{said}"
    );
}

#[test]
fn options_of_one_demo_are_not_taken_by_the_other() {
    for arguments in [
        ["demo", "--true-labels", "--no-view"].as_slice(),
        &["demo", "--indoor", "--lattice", "fcc"],
    ] {
        let output = crate::lattice(arguments);
        assert!(!output.status.success(), "{arguments:?}");
    }
}
