//! A camera of CycloneDDS whose images a network labels.
//!
//! Loopback only, no multicast. The camera is `python/segmenter_peer.py`; networks are made by `onnx_models.py`.

use std::fs;
use std::path::Path;

use lattice_nodes::executables;
use lattice_nodes::headset_cloud::HeadsetReport;
use lattice_nodes::report;
use lattice_nodes::segmenter::SegmenterReport;
use lattice_nodes::semantic_cloud::CloudReport;
use lattice_runtime::Runtime;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::python;
use serde_json::{Value, json};

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
    write_scenario(&domain, path);
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

/// The scenario of a peer that sends a JPEG file.
fn write_scenario(domain: &TestDomain, folder: &Path) {
    let jpeg = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../nodes/src/segmenter/red_blue.jpg"
    );
    let scenario = json!({"domain": domain.id(), "jpeg": jpeg});
    fs::write(folder.join("scenario.json"), scenario.to_string()).unwrap();
}

/// Parameters of a node with a network inside, whose topics are reliable.
fn inside(topics: &str, model: &str, further: &str) -> Vec<String> {
    let topics = topics.split_whitespace();
    let qos: Vec<_> = topics
        .map(|topic| format!("qos.{topic}.reliability:=reliable"))
        .collect();
    let qos = qos.join(" ");
    let numbers = "mean:=[0.5,0.5,0.5] std:=[0.5,0.5,0.5]";
    params(&format!("{qos} model:={model} {numbers} {further}"))
}

fn right(found: &Value, fields: &str, least: u64) {
    let fields: Vec<_> = fields.split(' ').collect();
    assert_eq!(found["fields"], json!(fields));
    assert!(found["points"].as_u64() >= Some(least), "{found}");
    for wrong in ["wrong", "wrong_color", "wrong_probs"] {
        assert_eq!(found[wrong], 0, "{wrong}: {found}");
    }
    let far = found["far_from_one"].as_f64();
    assert!(far.is_some_and(|far| far < 1e-3), "{found}");
    assert_eq!(found["names"], json!([[0, "other"], [1, "red"]]));
}

#[test]
fn networks_inside_of_nodes_label_what_a_cyclone_camera_and_headset_see() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    peer::run(&python, "onnx_models.py", &[path]);
    let domain = TestDomain::take();
    write_scenario(&domain, path);
    let model = path.join("red.onnx").display().to_string();
    let report = |name: &str| path.join(name).display().to_string();
    let camera = format!(
        "input_size:=[160,120] label_probs:=true report_file:={}",
        report("camera")
    );
    let topics =
        "depth_registered/image_rect rgb/image_rect_color rgb/camera_info points labels/image";
    let camera = inside(topics, &model, &camera);
    let headset = format!(
        "input_size:=[16,8] compressed_color:=true headset_axes:=unity_ruf stride:=1 report_file:={}",
        report("headset")
    );
    let topics = "headset/image/compressed headset/camera_info headset/pose headset/points";
    let headset = inside(topics, &model, &headset);
    let nodes = [("semantic_cloud", camera), ("headset_cloud", headset)];
    let nodes = Nodes::start(&domain, &nodes);
    let found = peer::run(&python, "onnx_inside_peer.py", &[path]);
    nodes.finish();

    let camera = &found["depth_camera"];
    let fields = "x y z rgb label confidence label_probs";
    right(camera, fields, 160 * 120);
    assert_eq!(camera["later"], 160 * 120);
    assert_eq!(camera["told"], camera["names"]);
    assert_eq!(camera["mask"], json!(["mono8", 160, 120, "camera"]));
    let refused = camera["refused"].as_str().unwrap();
    assert!(refused.contains("1000 bytes, but 120 rows"), "{refused}");
    let headset = &found["headset"];
    let fields = "x y z rgb label confidence vp_x vp_y vp_z label_probs";
    right(headset, fields, 16 * 8);
    let refused = headset["refused"].as_str().unwrap();
    assert!(refused.contains("its JPEG file"), "{refused}");

    let camera: CloudReport = report::read(&path.join("camera")).unwrap();
    let headset: HeadsetReport = report::read(&path.join("headset")).unwrap();
    for network in [camera.network.unwrap(), headset.network.unwrap()] {
        assert_eq!(network.dropped["malformed"], 1);
        let dropped: u64 = network.dropped.values().sum();
        assert_eq!(network.images_in, network.labels_out + dropped);
    }
    assert_eq!((camera.images_lost, headset.messages_lost), (0, 0));
    assert!(camera.counts.clouds_out >= 2 && headset.counts.clouds_out >= 1);
}

/// Refusal of a node at its start.
fn refusal(domain: &TestDomain, name: &str, line: &str) -> String {
    let params = params(line).into_iter();
    let params = params.flat_map(|param| ["-p".to_owned(), param]);
    let args = ["--ros-args".to_owned()].into_iter().chain(params);
    let args = RosArgs::parse(args).unwrap();
    let runtime = Runtime::with_transport(name, args, &domain.transport()).unwrap();
    let started = executables::find(name).unwrap()(&runtime, name);
    started.map(drop).unwrap_err().to_string()
}

#[test]
fn a_model_that_a_program_cannot_run_is_refused_at_the_start() {
    let domain = TestDomain::take();
    for (node, given, expected) in [
        (
            "semantic_cloud",
            "model:=/nowhere/model.onnx",
            "No such file",
        ),
        (
            "headset_cloud",
            "model:=/nowhere/model.onnx",
            "No such file",
        ),
        (
            "headset_cloud",
            "model:=/nowhere/model.onnx labels_from:=mesh",
            "does not use label images",
        ),
        ("semantic_cloud", "backend:=caffe", "tract or ort"),
    ] {
        let error = refusal(&domain, node, given);
        assert!(error.contains(expected), "{node}: {error}");
    }
}
