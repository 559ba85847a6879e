//! A headset of CycloneDDS that sends its mesh in chunks, labels and poses, in the axes of Unity.
//!
//! Loopback only, no multicast. The headset is `python/headset_peer.py`.

use std::fs;

use lattice_nodes::headset_cloud::HeadsetReport;
use lattice_nodes::report;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::python;
use serde_json::json;

#[test]
fn a_cyclone_headset_sees_its_mesh_until_that_is_replaced() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let domain = TestDomain::take();
    let scenario = json!({"domain": domain.id()});
    fs::write(path.join("scenario.json"), scenario.to_string()).unwrap();
    let topics = ["labels/image", "camera_info", "pose", "points"];
    let qos = topics.map(|topic| format!("qos.headset/{topic}.reliability:=reliable"));
    let report_file = path.join("report").display().to_string();
    let given = format!(
        "{} headset_axes:=unity_ruf stride:=2 report_file:={report_file}",
        qos.join(" ")
    );
    let nodes = Nodes::start(&domain, &[("headset_cloud", params(&given))]);
    let found = peer::run(&python, "headset_peer.py", &[path]);
    nodes.finish();

    assert!(found["chunks"].as_u64() > Some(1), "{found}");
    assert_eq!(found["names"], json!([[0, "left"], [1, "right"]]));
    let all = 80 * 60;
    for (look, at_m) in [(0, "3"), (1, "3"), (2, "4")] {
        let look = &found["looks"][look];
        assert_eq!(look["frame"], "headset_origin");
        assert_eq!(look["wrong"], 0);
        assert!(
            look["off_px"].as_f64().is_some_and(|px| px < 0.01),
            "{look}"
        );
        assert_eq!(look["viewpoint_m"], json!([0.0, 0.0, 0.0]));
        let count = |at_m: &str| look["at_m"][at_m].as_u64().unwrap_or(0);
        assert_eq!(count(at_m) + count("2"), all, "{look}");
    }
    // The shelf is 0.4 m wide at 2 m: 28 pixels.
    let shelf = |look: usize| found["looks"][look]["at_m"]["2"].as_u64();
    assert!((190..=200).contains(&shelf(0).unwrap()), "{found}");
    assert_eq!((shelf(1), shelf(2)), (None, None));

    let report: HeadsetReport = report::read(&path.join("report")).unwrap();
    let counts = &report.counts;
    assert_eq!((counts.surfaces_replaced, counts.surfaces_removed), (3, 1));
    assert_eq!((counts.clouds_out, counts.sessions), (3, 1));
    let dropped = counts.dropped.iter();
    let dropped: Vec<_> = dropped.map(|(reason, n)| (reason.as_str(), *n)).collect();
    let expected = [
        ("labels_no_pose", 1),
        ("mesh_indices", 1),
        ("mesh_other_session", 1),
    ];
    assert_eq!(dropped, expected);
    assert_eq!((report.messages_lost, report.undecodable), (0, 0));
}
