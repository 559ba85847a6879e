//! Nodes beside those of Nav2: names of topics that Nav2 has for other types, and logs and rules of before.

use std::sync::Arc;
use std::sync::mpsc::channel;
use std::time::Duration;

use lattice_bag::{BagWriter, Storage, TopicSpec, WriterOptions};
use lattice_msgs::RosMessage;
use lattice_msgs::cdr;
use lattice_msgs::geometry_msgs::TransformStamped;
use lattice_msgs::lattice::LatticeMap;
use lattice_msgs::nav_msgs::Odometry;
use lattice_msgs::tf2_msgs::TFMessage;
use lattice_nodes::convert::geometry;
use lattice_runtime::qos::Qos;
use lattice_runtime::{LoopbackDomain, SubscriptionExecutor};

use crate::PATIENCE;
use crate::names::peer;
use crate::record::{expect, play, start};

const GRID: &str = "nav_msgs/msg/OccupancyGrid";

#[test]
fn an_old_rule_applies_and_another_type_on_the_topic_is_named() {
    let domain = LoopbackDomain::take().unwrap();
    let peer = peer(&domain);
    let server = peer.node("map_server").unwrap();
    let _map = server.raw_publisher("/map", GRID, None, Qos::LATCHED);
    let arguments = ["node", "lattice_mapper", "--ros-args", "-r"];
    let mut mapper = start(&domain, &[&arguments[..], &["map:=/map"]].concat());
    expect(
        &mut mapper,
        &[
            "remap rule map:=/map: the topic map of the voxel map is now voxel_map, and the rule applies to it; \
             write -r voxel_map:=/map",
            "/map has two types: this process publishes lattice_msgs/msg/LatticeMap and another one \
             nav_msgs/msg/OccupancyGrid; `ros2 topic echo` and rosbag2 refuse such a topic: remap ours with \
             -r /map:=/NAMESPACE/map",
        ],
    );
    mapper.kill().unwrap();
    mapper.wait().unwrap();
}

#[test]
fn a_log_of_before_is_played_under_the_new_name() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log");
    let options = WriterOptions::default();
    let mut writer = BagWriter::create(&log, Storage::Mcap, options).unwrap();
    let topic = |name: &str, type_name: &str| TopicSpec {
        name: name.to_owned(),
        type_name: type_name.to_owned(),
        type_hash: String::new(),
        definition: None,
        offered_qos: Vec::new(),
    };
    let topics = [("/map", LatticeMap::TYPE), ("/nav2/map", GRID)];
    let [ours, _] = topics.map(|(name, of)| writer.add_topic(topic(name, of)).unwrap());
    let map = LatticeMap {
        sequence: 7,
        ..LatticeMap::default()
    };
    let bytes = cdr::to_vec(&map).unwrap();
    writer.write(ours, 1, &bytes).unwrap();
    writer.finish().unwrap();

    let domain = LoopbackDomain::take().unwrap();
    let peer = peer(&domain);
    let node = peer.node("follower").unwrap();
    let (sender, maps) = channel();
    let on_map = move |map: Arc<LatticeMap>| drop(sender.send(map));
    let shared = SubscriptionExecutor::Shared;
    let _maps = node.subscribe("voxel_map", Qos::DEFAULT, shared, on_map);
    let waited = "wait_for_subscribers:=['/map']";
    let mut player = play(&domain, &log.display().to_string(), &[waited]);
    expect(
        &mut player,
        &["/map (lattice_msgs/msg/LatticeMap) of this log is published as /voxel_map"],
    );
    assert_eq!(maps.recv_timeout(PATIENCE).unwrap().sequence, 7);
    assert!(player.wait().unwrap().success());
}

#[test]
fn a_second_parent_of_the_base_is_named_with_the_parameter() {
    let domain = LoopbackDomain::take().unwrap();
    let peer = peer(&domain);
    let node = peer.node("wheels").unwrap();
    let odom = TransformStamped {
        header: geometry::header("odom", 1),
        child_frame_id: "base_link".to_owned(),
        ..TransformStamped::default()
    };
    let tf = node.publisher("/tf", Qos::TF).unwrap();
    let poses = node.publisher("odom", Qos::DEFAULT).unwrap();
    let mut stamp_ns = 0;
    let _drive = peer.timer(Duration::from_millis(50), move || {
        stamp_ns += 50_000_000;
        let transforms = vec![odom.clone()];
        tf.publish(TFMessage { transforms }).unwrap();
        let mut pose = Odometry {
            header: geometry::header("map", stamp_ns),
            child_frame_id: "base_link".to_owned(),
            ..Odometry::default()
        };
        pose.pose.pose.orientation.w = 1.0;
        poses.publish(pose).unwrap();
    });
    let given = "node enu_transformer --ros-args -p ins.source:=odometry -p ins.topic:=odom";
    let mut transformer = start(&domain, &given.split(' ').collect::<Vec<_>>());
    expect(
        &mut transformer,
        &[
            "map -> base_link is not published: another node publishes odom -> base_link, and a frame has one parent; \
             set odom_frame: odom to publish map -> odom, or publish_tf: false",
        ],
    );
    transformer.kill().unwrap();
    transformer.wait().unwrap();
}
