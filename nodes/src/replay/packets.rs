//! Raw packets of lidars in a log, and the ROS 2 commands that decode them.

use lattice_bag::BagReader;

/// Types of raw packets, with the command that makes PointCloud2 of them.
const PACKETS: [(&str, &str); 2] = [
    (
        "ouster_sensor_msgs/msg/PacketMsg",
        "ros2 launch ouster_ros replay.launch.xml bag_file:=LOG metadata:=METADATA.json",
    ),
    (
        "velodyne_msgs/msg/VelodyneScan",
        "ros2 launch velodyne_pointcloud velodyne_transform_node-VLP16-launch.py",
    ),
];

/// Commands for the packets of a log, as the end of an error; empty if it has none.
pub(super) fn remedy(bag: &BagReader) -> String {
    let lines = bag.topics().iter().filter_map(|topic| {
        let (_, command) = PACKETS.iter().find(|(name, _)| *name == topic.type_name)?;
        Some(format!(
            "; {} has raw packets: decode them by `{command}` (of your model) while the log is played, and record \
             its clouds",
            topic.name
        ))
    });
    lines.collect()
}
