//! The logs, and what becomes of each.

use super::oddities::oddities;

/// End of a replay.
#[derive(Clone, Copy)]
pub enum Outcome {
    /// The reference map.
    Map,
    /// Exit status 1, with all of these texts on standard error.
    Refused(&'static [&'static str]),
}

/// One log, and how it is replayed.
#[derive(Clone, Copy)]
pub struct Case {
    /// Its name in the maker.
    pub log: &'static str,
    pub storage: &'static str,
    pub arguments: &'static [&'static str],
    pub outcome: Outcome,
    /// Texts on standard error beside a map.
    pub says: &'static [&'static str],
    /// True if it is also played over DDS.
    pub over_dds: bool,
}

impl Case {
    pub fn with(self, arguments: &'static [&'static str]) -> Self {
        Self { arguments, ..self }
    }

    pub fn refused(self, texts: &'static [&'static str]) -> Self {
        Self {
            outcome: Outcome::Refused(texts),
            ..self
        }
    }

    pub fn says(self, says: &'static [&'static str]) -> Self {
        Self { says, ..self }
    }

    pub fn over_dds(self) -> Self {
        Self {
            over_dds: true,
            ..self
        }
    }
}

/// A log that gives the reference map without any argument.
fn stored(storage: &'static str, log: &'static str) -> Case {
    Case {
        log,
        storage,
        arguments: &[],
        outcome: Outcome::Map,
        says: &[],
        over_dds: false,
    }
}

pub fn mcap(log: &'static str) -> Case {
    stored("mcap", log)
}

pub fn sqlite3(log: &'static str) -> Case {
    stored("sqlite3", log)
}

/// Logs of drivers as ROS 1 bags: each compression, without index, in several files.
pub fn ros1() -> Vec<Case> {
    vec![
        stored("ros1", "ouster"),
        stored("ros1_bz2", "velodyne_robot_localization"),
        stored("ros1_lz4", "livox_ros_driver"),
        stored("ros1_active", "rplidar"),
        stored("ros1_split", "urg_node_echoes"),
        stored("ros1_lz4_split", "point_cloud_1"),
        stored("ros1_bz2_active", "amcl"),
        stored("ros1_lz4_active", "clearpath_tf_alone"),
        stored("ros1_bz2", "novatel_inspvax"),
        stored("ros1_lz4", "motion_capture"),
        stored("ros1", "gps_1_hz_imu_100_hz"),
    ]
}

pub fn cases() -> Vec<Case> {
    [drivers(), oddities()].concat()
}

/// Logs of drivers and estimators as they are.
pub fn drivers() -> Vec<Case> {
    [lidars(), scans(), estimators(), positioning(), faults()].concat()
}

fn lidars() -> Vec<Case> {
    vec![
        mcap("ouster").over_dds(),
        sqlite3("velodyne_robot_localization"),
        mcap("livox").over_dds(),
        sqlite3("hesai"),
        mcap("robosense"),
        sqlite3("realsense").over_dds(),
        mcap("two_lidars").over_dds(),
    ]
}

/// Drivers that publish no PointCloud2.
fn scans() -> Vec<Case> {
    vec![
        mcap("rplidar")
            .says(&[
                "clouds: /scan (30 ",
                "time of points: field 'since_stamp_ns', in ns",
            ])
            .over_dds(),
        sqlite3("sick_scan"),
        mcap("urg_node_echoes").over_dds(),
        mcap("scan_alone").refused(&[
            "lidar odometry on /scan",
            "/scan is of a planar scanner",
            "all scans of /scan are lost",
        ]),
        mcap("scan_with_other_lidar")
            .says(&["clouds: /scan (30 messages), /velodyne_points (30 messages)"]),
        sqlite3("scan_beside_clouds")
            .says(&["not taken: /scan (of velodyne as /velodyne_points; "]),
        mcap("livox_ros_driver2").over_dds(),
        sqlite3("livox_ros_driver"),
        mcap("livox_interfaces"),
        sqlite3("point_cloud_1").over_dds(),
        mcap("ouster_packets").refused(&[
            "no topic of clouds",
            "/ouster/lidar_packets has raw packets",
            "ros2 launch ouster_ros replay.launch.xml",
        ]),
        sqlite3("velodyne_packets").refused(&[
            "/velodyne_packets has raw packets",
            "ros2 launch velodyne_pointcloud velodyne_transform_node-VLP16-launch.py",
        ]),
    ]
}

fn estimators() -> Vec<Case> {
    vec![
        mcap("fast_lio_all")
            .says(&[
                "clouds: /cloud_registered_body (30 ",
                "of body in camera_init",
                "not taken: /cloud_registered (in camera_init, fixed in the world",
            ])
            .over_dds(),
        sqlite3("fast_lio_registered").says(&["clouds: /cloud_registered (30 "]),
        mcap("fast_lio_raw").says(&[
            "clouds: /velodyne_points (30 ",
            "not taken: /cloud_registered (",
        ]),
        sqlite3("fast_lio_raw_without_mount").refused(&["no transform body <- velodyne"]),
        mcap("kiss_icp")
            .says(&["of velodyne in odom_lidar", "not taken: /kiss/local_map ("])
            .over_dds(),
        sqlite3("zed").says(&["of zed_camera_link in map"]),
        mcap("lio_sam").says(&["as tf, of base_link in map", "--ins odometry takes it"]),
        mcap("lio_sam")
            .with(&["--ins", "odometry"])
            .refused(&["no transform base_link <- odom_", "ins.lever_arm_m"]),
        sqlite3("robot_localization_footprint").over_dds(),
        mcap("robot_localization_dual"),
        sqlite3("navsat_transform").says(&["poses: /odometry/filtered ("]),
        mcap("wheel_odometry_beside")
            .says(&["poses: /odometry/filtered (", "--ins-topic /odom takes it"])
            .over_dds(),
        sqlite3("wheel_odometry_faster"),
        sqlite3("wheel_odometry_faster").with(&["--ins-topic", "/odometry/filtered"]),
        mcap("amcl").over_dds(),
        sqlite3("amcl_without_odometry")
            .says(&["as tf, of base_link in map", "not taken: /amcl_pose ("]),
        sqlite3("amcl_pose_alone").over_dds(),
        mcap("amcl_pose_sparse").refused(&["poses around it are 1.000 s apart", "max_pose_gap_s"]),
        mcap("amcl_pose_sparse").with(&["-p", "max_pose_gap_s:=1.0"]),
        sqlite3("ndt").over_dds(),
        mcap("autoware"),
        sqlite3("mavros"),
        mcap("mavros_odometry"),
        sqlite3("tf_alone")
            .says(&["as tf, of base_link in map"])
            .over_dds(),
        mcap("tf_alone_without_map").says(&["as tf, of base_link in odom"]),
        sqlite3("clearpath_odometry")
            .says(&[
                "poses: /a200_0001/platform/odom/filtered (",
                "/a200_0001/tf_static (",
            ])
            .over_dds(),
        mcap("clearpath_tf_alone"),
        sqlite3("turtlebot4"),
        mcap("imu_odometry").over_dds(),
        sqlite3("imu_odometry_without_mount").refused(&[
            "0 of 501 poses usable",
            "no transform base_link <- imu_link",
            "base_frame: imu_link",
            "ins.lever_arm_m",
        ]),
        sqlite3("imu_odometry_without_mount").with(&[
            "-p",
            "ins.lever_arm_m:=[1.0, 0.0, 0.2]",
            "-p",
            "ins.boresight_rpy_rad:=[0.0, 0.0, 1.5707963267948966]",
        ]),
        mcap("odometry_of_body").says(&["of body in camera_init"]),
        sqlite3("odometry_without_child"),
        mcap("base_footprint_alone").says(&["of base_footprint in odom"]),
        sqlite3("odom_static_in_map").says(&["of base_link in map"]),
        mcap("frames_with_prefix").says(&["of robot1/base_link in robot1/odom"]),
        sqlite3("map_begins_late").says(&["of base_link in map"]),
        mcap("nav2_goal").says(&["poses: /amcl_pose ("]),
        mcap("wheel_odometry_under_ekf")
            .says(&["not taken: /odom (the transforms contradict it by"]),
        mcap("wheel_odometry_under_ekf").with(&["--ins", "tf"]),
        mcap("motion_capture").says(&["of base_link in world"]),
        sqlite3("two_robots").refused(&["clouds of several robots", "--points TOPIC"]),
        sqlite3("two_robots")
            .with(&["--points", "/robot1/velodyne_points"])
            .over_dds(),
        sqlite3("names_with_slashes"),
    ]
}

fn positioning() -> Vec<Case> {
    vec![
        mcap("novatel_inspvax").over_dds(),
        sqlite3("novatel_driver").with(&["--ins", "inspvax"]),
        sqlite3("novatel_driver")
            .says(&["not taken: /novatel/oem7/odom (its positions are over 10 km from the origin"]),
        mcap("novatel_inspva_in_base"),
        sqlite3("novatel_without_mount").refused(&["no transform base_link <- gps"]),
        sqlite3("novatel_without_mount").with(&["-p", AHEAD, "-p", STRAIGHT]),
        mcap("novatel_aligning").refused(&["0 of 251 poses usable", "INS status is 1"]),
        sqlite3("gps_1_hz_imu_100_hz").over_dds(),
        mcap("gps_imu_reversed").over_dds(),
        mcap("gps_imu_reversed_antenna_without_mount").with(&["-p", AHEAD]),
        sqlite3("gps_two_imus").over_dds(),
        sqlite3("gps_imu_without_mount").refused(&["no transform base_link <- imu_link"]),
        mcap("gps_antenna_without_mount").refused(&["no transform base_link <- gps"]),
        mcap("gps_antenna_without_mount").with(&["-p", MAST]),
        sqlite3("gps_imu_without_orientation")
            .refused(&["0 of 501 poses usable", "orientation covariance is -1"])
            .over_dds(),
        mcap("gps_without_fix").refused(&["poses usable", "fix status is -1"]),
    ]
}

/// Lever arms of an antenna ahead and of one on a mast.
const AHEAD: &str = "ins.lever_arm_m:=[0.7937005259840998, 0.0, 0.0]";
const STRAIGHT: &str = "ins.boresight_rpy_rad:=[0.0, 0.0, 0.0]";
const MAST: &str = "ins.lever_arm_m:=[0.0, 0.0, 0.7937005259840998]";

fn faults() -> Vec<Case> {
    vec![
        sqlite3("gazebo_scoped_frame").refused(&["no transform base_link <- x500/lidar_link"]),
        mcap("lidar_without_mount")
            .refused(&["no transform base_link <- os_lidar"])
            .over_dds(),
        sqlite3("lidar_on_body")
            .refused(&[
                "no transform base_link <- os_lidar",
                "body <- os_lidar",
                "-p base_frame:=body",
            ])
            .over_dds(),
        sqlite3("lidar_on_body").with(&["-p", "base_frame:=body"]),
        mcap("no_clouds").refused(&[
            "sensor_msgs/msg/LaserScan",
            "/range (sensor_msgs/msg/Range)",
        ]),
        sqlite3("empty_clouds").refused(&["nothing was mapped: 0 points in 30 clouds"]),
        mcap("clouds_before_and_after_poses").over_dds(),
        sqlite3("sparse_poses").refused(&["max_pose_gap_s"]),
        sqlite3("sparse_poses").with(&["-p", "max_pose_gap_s:=1.0"]),
        sqlite3("late_poses").refused(&["max_wait_s"]),
        sqlite3("late_poses").with(&["-p", "max_wait_s:=3.0"]),
        mcap("poses_without_stamps")
            .refused(&["/odom: its stamp 0.000 s is that of the message before"]),
        mcap("poses_without_rotation")
            .refused(&[
                "0 of 251 poses usable",
                "position is not finite, or the quaternion is zero or not finite",
            ])
            .over_dds(),
        mcap("ouster")
            .with(&["-p", "base_frame:=base_lnk"])
            .refused(&["no transform base_lnk <- ", "base_frame: base_link"]),
        mcap("ouster")
            .with(&["-p", "latice:=bcc"])
            .refused(&["latice", "'lattice'"]),
    ]
}
