//! A headset of CycloneDDS that is found in a map: clouds, `calibration`, `/tf`, service and action.
//!
//! Loopback only, no multicast. The headset is `python/calibration_peer.py`.

use std::fs;

use lattice_core::pose::Axes;
use lattice_test::clouds::{cloud, labelled_cloud};
use lattice_test::domain::TestDomain;
use lattice_test::flat::{Flat, headset_cloud, map_cloud};
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::python;
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::{Value, json};

/// More than `max_cloud_points`.
const TOO_MANY: usize = 600_000;

fn truth() -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.3);
    Isometry3::from_parts(Translation3::new(3.0, 2.0, 1.5), turn)
}

/// Distance of a transform of the peer from the truth, m and rad.
fn error(transform: &Value) -> (f64, f64) {
    let v: Vec<f64> = serde_json::from_value(transform.clone()).unwrap();
    let turn = UnitQuaternion::from_quaternion(Quaternion::new(v[6], v[3], v[4], v[5]));
    let found = Isometry3::from_parts(Translation3::new(v[0], v[1], v[2]), turn);
    let off = truth().inverse() * found;
    (off.translation.vector.norm(), off.rotation.angle())
}

#[track_caller]
fn assert_true(transform: &Value) {
    let (distance_m, angle_rad) = error(transform);
    assert!(distance_m < 0.02, "{distance_m} m off: {transform}");
    assert!(angle_rad < 0.006, "{angle_rad} rad off: {transform}");
}

#[test]
fn a_cyclone_headset_is_found_and_every_bad_cloud_refused() {
    let Some(python) = python() else { return };
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path();
    let flat = Flat::default();
    let look = flat.look(Point3::new(3.5, 3.8, 1.6), -2.2, &truth());
    let unity = |v: Vector3<f64>| Axes::UnityRuf.from_ros(v);
    let mirrored = |v: Vector3<f64>| unity(Vector3::new(v.x, -v.y, v.z));
    let good = headset_cloud(&look, 0, unity);
    let unlabelled = cloud("headset_origin", 0, &[[1.0, 2.0, 3.0]; 500]);
    let nan = labelled_cloud("headset_origin", 0, &[([f32::NAN; 3], 1); 500]);
    let large = labelled_cloud("headset_origin", 0, &vec![([1.0; 3], 1); TOO_MANY]);
    for (name, data) in [
        ("map", &map_cloud(&flat, 0).data),
        ("good", &good.data),
        ("mirrored", &headset_cloud(&look, 0, mirrored).data),
        ("empty", &labelled_cloud("headset_origin", 0, &[]).data),
        ("unlabelled", &unlabelled.data),
        ("nan", &nan.data),
        ("large", &large.data),
    ] {
        fs::write(path.join(name), data).unwrap();
    }
    let domain = TestDomain::take();
    let scenario = json!({"domain": domain.id()});
    fs::write(path.join("scenario.json"), scenario.to_string()).unwrap();

    let mapper = "cell_volume_m3:=0.000125 keep_labels:=true qos.points_enu.reliability:=reliable";
    let server = "headset_axes:=unity_ruf require_labels:=true \
                  qos.headset/points.reliability:=reliable";
    let nodes = [
        ("lattice_mapper", params(mapper)),
        ("semantic_icp_server", params(server)),
    ];
    let nodes = Nodes::start(&domain, &nodes);
    let found = peer::run(&python, "calibration_peer.py", &[path]);
    nodes.finish();

    eprintln!("searched, then tracked, s: {}", found["duration_s"]);
    assert_eq!(found["no_map"], "there is no map yet");
    assert_eq!(found["frames"], json!(["map", "headset_origin", "one"]));
    assert_true(&found["transform"]);
    let covariance: Vec<f64> = serde_json::from_value(found["covariance"].clone()).unwrap();
    for i in 0..6 {
        let variance = covariance[7 * i];
        assert!(variance > 0.0 && variance < 1e-3, "{covariance:?}");
    }
    for (name, part) in [
        // A mirrored cloud of Unity is one of WinRT that looks the other way.
        ("mirrored", "fits as winrt_rub, not as unity_ruf"),
        ("empty", "no points"),
        ("unlabelled", "no labels"),
        ("nan", "none of the 500 points is finite"),
        ("large", "600000"),
        ("hololens", "frame 'hololens', expected 'headset_origin'"),
    ] {
        let reason = found["refused"][name].as_str().unwrap();
        assert!(reason.contains(part), "{name}: {reason}");
    }
    assert_eq!(found["tf"][0], "map");
    assert_eq!(found["tf"][1], "headset_origin");
    assert_true(&found["tf"][2]);

    assert_eq!(found["service"][0], true);
    assert_eq!(found["service"][1], 1);
    assert_true(&found["service"][2]);
    assert_eq!(found["other_session"][0], false);
    let message = found["other_session"][1].as_str().unwrap();
    assert!(message.contains("'one', not 'two'"), "{message}");

    assert_eq!(found["accepted"], json!([true, true]));
    assert_eq!(found["busy"][0], 6);
    let message = found["busy"][1].as_str().unwrap();
    assert!(message.contains("busy"), "{message}");
    assert_eq!(found["action"][0], 4);
    assert_eq!(found["action"][1], true);
    assert_true(&found["action"][2]);
    assert_eq!(found["again"], 4, "the result is kept");
    let fractions: Vec<f64> = serde_json::from_value(found["fractions"].clone()).unwrap();
    assert!(!fractions.is_empty() && fractions.is_sorted());
    assert_eq!(found["unknown"], json!([0, 2]));
    assert_eq!(found["terminated"], 3);
    let short = "no search was long enough to be canceled";
    assert_eq!(found["canceling"], json!([true]), "{short}");
    assert_eq!(found["canceled"], json!([5, false, 0]));

    let counts = &found["diagnostics"];
    for (name, expected) in [
        ("clouds_wrong_frame", "1"),
        ("clouds_empty", "1"),
        ("clouds_no_place", "1"),
        ("clouds_unlabelled", "1"),
        ("clouds_too_large", "1"),
        ("clouds_no_map", "1"),
        ("clouds_malformed", "0"),
        ("searches_rejected", "2"),
        ("tracking_lost", "0"),
        ("inbox_full", "0"),
    ] {
        assert_eq!(counts[name], expected, "{name} of {counts}");
    }
    assert!(counts["class wall"].is_string(), "{counts}");
}
