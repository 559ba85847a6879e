//! A camera of CycloneDDS whose images a network labels.
//!
//! Loopback only, no multicast. The camera is `python/segmenter_peer.py`; networks are made by `onnx_models.py`.

use std::fs;

use lattice_nodes::report;
use lattice_nodes::segmenter::SegmenterReport;
use lattice_test::domain::TestDomain;
use lattice_test::python::python;
use serde_json::json;

use super::peer::{self, Nodes, params};

#[test]
fn a_cyclone_camera_gets_labels_of_a_network() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    peer::run(&python, "onnx_models.py", &[path]);
    let domain = TestDomain::take();
    let scenario = json!({"domain": domain.id()});
    fs::write(path.join("scenario.json"), scenario.to_string()).unwrap();
    let report_file = path.join("report").display().to_string();
    let topics = ["rgb/image_rect_color", "labels/image", "labels/confidence"];
    let qos = topics.map(|topic| format!("qos.{topic}.reliability:=reliable"));
    let given = format!(
        "{} model:={} input_size:=[80,60] mean:=[0.5,0.5,0.5] std:=[0.5,0.5,0.5] report_file:={report_file}",
        qos.join(" "),
        path.join("red.onnx").display()
    );
    let nodes = Nodes::start(&domain, &[("segmenter", params(&given))]);
    let found = peer::run(&python, "segmenter_peer.py", &[path]);
    nodes.finish();

    assert_eq!(found["names"], json!([[0, "other"], [1, "red"]]));
    let looks = found["looks"].as_array().unwrap();
    assert_eq!(looks.len(), 9);
    for look in looks {
        assert_eq!(look["encoding"], "mono8");
        assert_eq!(
            (&look["frame"], &look["size"]),
            (&json!("camera"), &json!([80, 60]))
        );
        assert_eq!(look["wrong"], 0, "{found}");
        // Logits of 2 and 4, or 2 and -4.
        assert!(
            (224..=255).contains(&look["sure"].as_u64().unwrap()),
            "{look}"
        );
    }
    let refused = found["refused"].as_str().unwrap();
    assert!(
        refused.contains("encoding 'bayer_rggb8', expected rgb8"),
        "{refused}"
    );
    let report: SegmenterReport = report::read(&path.join("report")).unwrap();
    let counts = &report.counts;
    let greetings = found["greetings"].as_u64().unwrap();
    let skipped = counts.dropped.get("skipped").copied().unwrap_or_default();
    assert_eq!(counts.images_in, greetings + 11);
    assert_eq!(counts.labels_out, greetings - skipped + 9);
    assert_eq!(counts.dropped.values().sum::<u64>(), skipped + 2);
    assert_eq!((report.images_lost, report.undecodable), (0, 0));
}

#[test]
fn a_cyclone_camera_that_packs_its_images_gets_labels_too() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    peer::run(&python, "onnx_models.py", &[path]);
    let domain = TestDomain::take();
    let jpeg = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../nodes/src/segmenter/red_blue.jpg"
    );
    let scenario = json!({"domain": domain.id(), "jpeg": jpeg});
    fs::write(path.join("scenario.json"), scenario.to_string()).unwrap();
    let topics = [
        "rgb/image_rect_color/compressed",
        "labels/image",
        "labels/confidence",
    ];
    let qos = topics.map(|topic| format!("qos.{topic}.reliability:=reliable"));
    let given = format!(
        "{} model:={} input_size:=[16,8] mean:=[0.5,0.5,0.5] std:=[0.5,0.5,0.5] compressed:=true",
        qos.join(" "),
        path.join("red.onnx").display()
    );
    let nodes = Nodes::start(&domain, &[("segmenter", params(&given))]);
    let found = peer::run(&python, "segmenter_peer.py", &[path]);
    nodes.finish();
    assert_eq!(found["red"], json!([1.0, 0.0]));
    let refused = found["refused"].as_str().unwrap();
    assert!(refused.contains("expected jpeg"), "{refused}");
}
