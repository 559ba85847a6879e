//! Packages whose messages the build script makes.

use crate::interface::MessageVisitor;

/// Modules of packages, and a visitor of all their messages.
macro_rules! packages {
    ($($(#[$attribute:meta])* $package:ident,)*) => {
        include_messages! { $($(#[$attribute])* $package),* }

        /// Passes the messages of all packages to the visitor.
        pub(crate) fn visit_packages(visitor: &mut impl MessageVisitor) {
            $($package::visit_messages(visitor);)*
        }
    };
}

packages! {
    /// Messages common to all actions: goals, their states, their cancellation.
    action_msgs,
    /// Time and duration.
    builtin_interfaces,
    /// States of nodes.
    diagnostic_msgs,
    /// Geographic positions and poses.
    geographic_msgs,
    /// Positions, rotations, poses, velocities and transforms.
    geometry_msgs,
    /// Maps of layers for legged robots (ROS 2 branches).
    grid_map_msgs,
    /// Messages of Lattice (package `lattice_msgs`): maps, and the calibration of a headset.
    lattice,
    /// States of managed nodes and their transitions.
    lifecycle_msgs,
    /// Messages of livox_interfaces.
    livox_interfaces,
    /// Messages of livox_ros_driver.
    livox_ros_driver,
    /// Messages of livox_ros_driver2.
    livox_ros_driver2,
    /// Updates of occupancy grids.
    map_msgs,
    /// Path planning of Nav2, in the layout of Kilted and later.
    nav2_msgs,
    /// Odometry, paths and occupancy grids.
    nav_msgs,
    /// Inertial solution of the NovAtel OEM7 driver (ROS 2 branches).
    novatel_oem7_msgs,
    /// Octrees of octomap_server, and its calls.
    octomap_msgs,
    /// Log and parameters of nodes.
    rcl_interfaces,
    /// Services of rosbag2's player and recorder.
    rosbag2_interfaces,
    /// Simulated time.
    rosgraph_msgs,
    /// Point clouds, laser scans, images, inertial and satellite measurements.
    sensor_msgs,
    /// Header, colour and plain values.
    std_msgs,
    /// Calls of common use.
    std_srvs,
    /// The frame tree.
    tf2_msgs,
    /// Descriptions of types.
    type_description_interfaces,
    /// Identifiers.
    unique_identifier_msgs,
    /// Meaning of labels.
    vision_msgs,
    /// Markers, in the layout of Humble and later.
    visualization_msgs,
}
