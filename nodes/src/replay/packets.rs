//! Raw packets of lidars in a log, and the ROS 2 commands that decode them.

use lattice_bag::BagReader;

/// Types of raw packets, with the command that makes PointCloud2 of them.
const PACKETS: [(&str, &str); 5] = [
    ("ouster_sensor_msgs/msg/PacketMsg", OUSTER),
    ("ouster_ros/msg/PacketMsg", OUSTER),
    ("velodyne_msgs/msg/VelodyneScan", VELODYNE),
    ("velodyne_msgs/msg/VelodynePacket", VELODYNE),
    (
        "rslidar_msg/msg/RslidarPacket",
        "ros2 launch rslidar_sdk start.py with msg_source: 2",
    ),
];
const OUSTER: &str =
    "ros2 launch ouster_ros replay.launch.xml bag_file:=LOG metadata:=METADATA.json";
const VELODYNE: &str = "ros2 run velodyne_pointcloud velodyne_transform_node --ros-args -p model:=MODEL -p calibration:=CALIBRATION.yaml";

/// Commands for the packets of a log, as the end of an error; empty if it has none.
pub(super) fn remedy(bag: &BagReader) -> String {
    let lines = bag.topics().iter().filter_map(|topic| {
        let (_, command) = PACKETS.iter().find(|(name, _)| *name == topic.type_name)?;
        Some(format!(
            "; {} has raw packets: decode them by `{command}` while you record its clouds",
            topic.name
        ))
    });
    lines.collect()
}
