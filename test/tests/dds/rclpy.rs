//! Nodes of ours seen by ROS 2 Jazzy and Kilted: rclpy over the Fast DDS that comes with each.

use std::fs;
use std::path::Path;
use std::time::Duration;

use lattice_msgs::cdr;
use lattice_msgs::hash_of;
use lattice_msgs::std_srvs::{Trigger, TriggerRequest, TriggerResponse};
use lattice_runtime::Runtime;
use lattice_runtime::ros_args::RosArgs;
use lattice_test::domain::TestDomain;
use lattice_test::peer::{self, Nodes, params};
use lattice_test::python::ros_pythons;
use serde_json::{Value, json};

const PATIENCE: Duration = Duration::from_secs(60);

/// Calls of each server of the peer.
const CALLS: usize = 20;

/// Lengths of the answers of servers of the peer, which come in order.
fn answers(domain: &TestDomain) -> Vec<usize> {
    let args = RosArgs::parse(["--ros-args".to_owned()]).unwrap();
    let runtime = Runtime::with_transport("asking", args, &domain.transport()).unwrap();
    let node = runtime.node("asking").unwrap();
    let mut lengths = Vec::new();
    for name in ["/peer/short", "/peer/long"] {
        let client = node.client::<Trigger>(name).unwrap();
        for _ in 0..CALLS {
            let request = cdr::to_vec(&TriggerRequest::default()).unwrap();
            let answer = smol::block_on(client.call(request, PATIENCE)).unwrap();
            let answer: TriggerResponse = cdr::from_slice(&answer).unwrap();
            assert!(answer.success);
            lengths.push(answer.message.len());
        }
    }
    lengths
}

fn of_ros(python: &Path, scenario: &Value) -> Value {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("scenario.json");
    fs::write(&file, scenario.to_string()).unwrap();
    peer::run(python, "rclpy_peer.py", &[&file])
}

#[test]
fn rclpy_reads_and_changes_a_node_and_answers_ours() {
    for python in ros_pythons() {
        reads_changes_and_answers(&python);
    }
}

fn reads_changes_and_answers(python: &Path) {
    println!("{}", python.display());
    let domain = TestDomain::take();
    let directory = tempfile::tempdir().unwrap();
    let answered = directory.path().join("answered");
    let cloud = "sensor_msgs/msg/PointCloud2";
    let scenario = json!({
        "domain": domain.id(),
        "node": "lattice_mapper",
        "set": {"max_cloud_points": 1234, "lattice": "bcc", "max_voxels": 0, "none": 1},
        "event": {"max_cloud_points": 1234},
        "type": [cloud, hash_of(cloud)],
        "asked": 2 * CALLS,
        "answered": answered,
    });
    let mapper = params("map_dir:=/tmp");
    let nodes = Nodes::start(&domain, &[("lattice_mapper", mapper)]);
    let found = std::thread::scope(|scope| {
        let found = scope.spawn(|| of_ros(python, &scenario));
        let lengths = answers(&domain);
        fs::write(&answered, "").unwrap();
        let expected = [[10; CALLS], [5000; CALLS]].concat();
        assert_eq!(lengths, expected);
        found.join().unwrap()
    });
    nodes.finish();

    let values = found["values"].as_object().unwrap();
    assert!(values.len() > 50, "{values:?}");
    assert_eq!(values["lattice"], "fcc");
    assert_eq!(found["read_only"].as_object().unwrap().len(), values.len());
    assert_eq!(found["read_only"]["lattice"], true);
    assert_eq!(found["not_loaded"], json!([]));
    let set = &found["set"];
    assert_eq!(set["max_cloud_points"], Value::Null);
    assert_eq!(
        set["lattice"],
        "parameter 'lattice' cannot be set because it is read-only: the map is made with it"
    );
    assert_eq!(
        set["max_voxels"],
        "Parameter {max_voxels} doesn't comply with integer range."
    );
    assert_eq!(
        set["none"],
        "parameter 'none' cannot be set because it was not declared"
    );
    assert_eq!(found["type"], json!([true, 9]));
    assert!(found["sources"].as_u64().unwrap() > 1000, "{found}");
    assert_eq!(found["levels"], json!([["lattice_mapper", 0]]));
    assert_eq!(found["reset"], true);
    let topics = json!({"/map_centers": [cloud], "/voxel_map": ["lattice_msgs/msg/LatticeMap"]});
    assert_eq!(found["topics"], topics);
    // The one that asked has ended.
    assert_eq!(found["nodes"], json!(["lattice_mapper", "peer"]));
    let services = found["services"].as_array().unwrap();
    for name in ["clear_box", "query", "set_parameters"] {
        assert!(services.contains(&json!(name)), "{name}: {services:?}");
    }
}
