//! A depth camera and a segmenter of CycloneDDS, whose images become a map with labels.
//!
//! Loopback only, no multicast. The camera is `python/rgbd_peer.py`.

use std::fs;

use lattice_nodes::report;
use lattice_nodes::semantic_cloud::CloudReport;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::python;
use serde_json::json;

#[test]
fn a_cyclone_camera_and_segmenter_make_a_map_with_labels() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let domain = TestDomain::take();
    let scenario = json!({"domain": domain.id()});
    fs::write(path.join("scenario.json"), scenario.to_string()).unwrap();
    let reliable = |topics: &[&str]| {
        let qos = topics.iter();
        let qos = qos.map(|topic| format!("qos.{topic}.reliability:=reliable"));
        qos.collect::<Vec<_>>().join(" ")
    };
    let images = [
        "depth_registered/image_rect",
        "labels/image",
        "rgb/camera_info",
        "points",
    ];
    let report_file = path.join("report").display().to_string();
    let cloud = format!("{} report_file:={report_file}", reliable(&images));
    let transformer = format!("ins.source:=tf {}", reliable(&["points", "points_enu"]));
    let mapper = "cell_volume_m3:=0.000125 keep_labels:=true";
    let mapper = format!("{mapper} {}", reliable(&["points_enu"]));
    let nodes = [
        ("semantic_cloud", params(&cloud)),
        ("enu_transformer", params(&transformer)),
        ("lattice_mapper", params(&mapper)),
    ];
    let nodes = Nodes::start(&domain, &nodes);
    let found = peer::run(&python, "rgbd_peer.py", &[path]);
    nodes.finish();

    // Of 14 frames one has no labels and one no depth.
    assert_eq!(found["clouds"], 12);
    assert_eq!(found["expected"], 12);
    assert_eq!(found["frame"], "camera");
    assert!(
        found["excess_m"].as_f64().is_some_and(|m| m < 0.0),
        "{found}"
    );
    assert_eq!(found["wrong_labels"], 0);
    assert!(found["fewest_points"].as_u64() > Some(17_000), "{found}");
    let names = json!([[0, "void"], [1, "floor"], [2, "wall"], [3, "panel"]]);
    assert_eq!(found["names"], names);
    let refused = found["refused"].as_str().unwrap();
    assert!(
        refused.contains("depth: 1000 bytes, but 120 rows"),
        "{refused}"
    );

    let centers = &found["centers"];
    assert_eq!(centers["frame"], "map");
    // Half the width of a cell of 5 cm, and some.
    assert!(
        centers["farthest_m"].as_f64().is_some_and(|m| m < 0.05),
        "{centers}"
    );
    for label in ["1", "2", "3"] {
        assert!(centers["voxels"][label].as_u64() > Some(100), "{centers}");
    }

    let report: CloudReport = report::read(&path.join("report")).unwrap();
    let counts = &report.counts;
    assert_eq!((counts.depth_in, counts.labels_in), (14, 13));
    let dropped = counts
        .dropped
        .iter()
        .map(|(reason, n)| (reason.as_str(), *n));
    let expected = [
        ("depth_malformed", 1),
        ("depth_no_partner", 1),
        ("labels_no_partner", 1),
    ];
    assert_eq!(dropped.collect::<Vec<_>>(), expected);
    assert_eq!((report.images_lost, report.clouds_not_published), (0, 0));
}
