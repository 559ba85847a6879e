//! Services of every node, asked by a peer of CycloneDDS: parameters by the rules of
//! rclcpp's `node_parameters.cpp` and `parameter_service.cpp`, levels of loggers, descriptions of types.

use std::fs;

use lattice_msgs::hash_of;
use lattice_runtime::logging;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::python;
use serde_json::{Value, json};

const NOT_DECLARED: &str = "One or more parameters were not declared before setting";

/// Parameters to set, and the answers: all together, and each by itself.
fn refused() -> Vec<(Value, Value)> {
    let none = Value::Null;
    let same = |wanted: Value, reason: &str| (wanted, json!([reason, reason]));
    vec![
        (
            json!([["none", 1]]),
            json!([
                NOT_DECLARED,
                "parameter 'none' cannot be set because it was not declared"
            ]),
        ),
        same(
            json!([["lattice", "bcc"]]),
            "parameter 'lattice' cannot be set because it is read-only: the map is made with it",
        ),
        same(
            json!([["max_voxels", 0.5]]),
            "Wrong parameter type, parameter {max_voxels} is of type {integer}, setting it to \
             {double} is not allowed.",
        ),
        same(
            json!([["max_voxels", 0]]),
            "Parameter {max_voxels} doesn't comply with integer range.",
        ),
        same(
            json!([["centers_period_s", 1e9]]),
            "Parameter {centers_period_s} doesn't comply with floating point range.",
        ),
        same(
            json!([["max_voxels", none]]),
            "cannot undeclare a statically typed parameter",
        ),
        same(
            json!([["when_full", "burst"]]),
            "parameter `when_full` of /lattice_mapper = \"burst\" (set at run time): \"burst\", \
             expected refuse or forget_oldest",
        ),
        same(
            json!([["forget_after_s", 5.0]]),
            "parameter `forget_after_s` of /lattice_mapper = 5.0 (set at run time): stamps of voxels \
             cannot be switched on or off at run time",
        ),
        // The first could be set, and is not.
        (
            json!([["max_cloud_points", 7], ["none", 1]]),
            json!([
                NOT_DECLARED,
                none,
                "parameter 'none' cannot be set because it was not declared"
            ]),
        ),
    ]
}

#[test]
fn a_cyclone_peer_describes_dumps_edits_and_loads_parameters() {
    let Some(python) = python() else { return };
    // Fails if another test was first, which has the same.
    let _ = logging::init(&RosArgs::default(), "logger");
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("scenario.json");
    let domain = TestDomain::take();
    let edits = json!({"centers_period_s": 0.05, "max_voxels": 5000, "ignored_labels": [3, 4]});
    let cloud = "sensor_msgs/msg/PointCloud2";
    let scenario = json!({
        "domain": domain.id(),
        "node": "lattice_mapper",
        "refused": refused().iter().map(|(wanted, _)| wanted).collect::<Vec<_>>(),
        "edits": edits,
        "types": [[cloud, hash_of(cloud)], [cloud, "RIHS01_00"], ["none/msg/None", ""]],
    });
    fs::write(&file, scenario.to_string()).unwrap();
    let mapper = params("centers_period_s:=86400.0 keep_labels:=true");
    let nodes = Nodes::start(&domain, &[("lattice_mapper", mapper)]);
    let found = peer::run(&python, "param_peer.py", &[&file]);
    nodes.finish();

    let described = &found["described"];
    let of = |name: &str| described[name].clone();
    let expected = json!({
        "type": 3,
        "description": "Period of map_centers, octomap_binary and octomap_full.",
        "constraints": "",
        "read_only": false,
        "range": [[0.01, 86400.0]],
    });
    assert_eq!(of("centers_period_s"), expected);
    assert_eq!(
        of("when_full")["constraints"],
        "one of: refuse or forget_oldest"
    );
    assert_eq!(of("cell_volume_m3")["read_only"], true);
    assert_eq!(of("use_sim_time")["read_only"], false);
    let undescribed = described.as_object().unwrap().iter();
    let undescribed = undescribed.filter(|(_, one)| one["description"] == "");
    assert_eq!(undescribed.count(), 0, "{described}");

    for ((wanted, expected), answer) in refused().iter().zip(found["refused"].as_array().unwrap()) {
        assert_eq!(answer, expected, "{wanted}");
    }
    // They were a day away before the period was set.
    assert_eq!(found["centers_before"], 0);
    assert_eq!(found["changed"], edits);
    assert_eq!(found["not_loaded"], json!({}));
    let events = found["events"].as_array().unwrap();
    assert_eq!(events.len(), 3, "{events:?}");
    assert!(events.contains(&json!(["/lattice_mapper", {"max_voxels": 5000}])));

    assert_eq!(found["stamps_s"], json!([0, 77, true]));

    let levels = json!([["lattice_mapper", 10], ["none", 0]]);
    assert_eq!(found["levels"], levels, "{found}");
    assert_eq!(found["levels_set"][0], json!([true, ""]));
    assert_eq!(found["levels_set"][1][0], false);

    let types = &found["types"];
    assert_eq!(types[0][0], true);
    assert_eq!(types[0][2][1], json!(["height", 7]));
    assert_eq!(types[0][3][2], "std_msgs/msg/Header");
    assert!(
        types[1][1]
            .as_str()
            .unwrap()
            .contains("has the hash RIHS01_9198"),
        "{types}"
    );
    assert_eq!(types[2][0], false);
}
