"""Logs of odometry, SLAM and localization, and of robots with their names."""

import numpy

from driver_clouds import AUTOWARE, FAST_LIO, OAKD, REALSENSE, VELODYNE
from driver_messages import header, make
from driver_robot import (
    CAMERA,
    FOOTPRINT,
    LIDAR,
    MAST,
    ODOM,
    ODOM_FROM_MAP,
    OPTICAL,
    SLIPPED,
    TURNED_IMU,
    odom_from_base,
    register,
    velodyne,
)
from driver_scene import IDENTITY, pose, transform


def fast_lio(log):
    """What laserMapping publishes of the poses."""
    log.odometry("/Odometry", "camera_init", "body", 10)
    log.tf("camera_init", "body", 10)


@register
def fast_lio_all(log):
    fast_lio(log)
    log.clouds("/cloud_registered", "camera_init", FAST_LIO, in_world=True)
    log.clouds("/cloud_registered_body", "body", FAST_LIO)


@register
def fast_lio_registered(log):
    fast_lio(log)
    log.clouds("/cloud_registered", "camera_init", FAST_LIO, in_world=True)


@register
def fast_lio_raw(log):
    fast_lio(log)
    log.clouds("/cloud_registered", "camera_init", FAST_LIO, in_world=True)
    velodyne(log, "body")


@register
def fast_lio_raw_without_mount(log):
    fast_lio(log)
    velodyne(log, None)


@register
def kiss_icp(log):
    log.clouds("/velodyne_points", "velodyne", VELODYNE, LIDAR)
    log.clouds("/kiss/local_map", "odom_lidar", OAKD, in_world=True)
    log.odometry("/kiss/odometry", "odom_lidar", "velodyne", 10, mount=LIDAR)
    # invert_odom_tf.
    log.tf("velodyne", "odom_lidar", 10, lambda at_ns: numpy.linalg.inv(pose(at_ns) @ LIDAR))


@register
def zed(log):
    frame = "zed_left_camera_frame"
    log.clouds("/zed/zed_node/point_cloud/cloud_registered", frame, REALSENSE, CAMERA)
    log.tf_static(("zed_camera_link", frame, CAMERA))
    log.odometry(
        "/zed/zed_node/odom", "odom", "zed_camera_link", 30, frame_from_world=ODOM_FROM_MAP
    )
    log.poses("/zed/zed_node/pose", "map", 30)
    log.tf("odom", "zed_camera_link", 30, odom_from_base)
    log.tf("map", "odom", 30, lambda _: ODOM)


@register
def lio_sam(log):
    log.clouds("/points_raw", "velodyne", VELODYNE, LIDAR)
    log.clouds("/lio_sam/mapping/cloud_registered", "odom", OAKD, in_world=True)
    log.imu("/imu_raw", "imu_link", 100)
    log.odometry("/lio_sam/mapping/odometry", "odom", "odom_mapping", 10)
    log.odometry("/odometry/imu", "odom", "odom_imu", 100)
    log.tf("map", "odom", 100, lambda _: IDENTITY)
    log.tf("odom", "base_link", 100)
    log.tf("odom", "lidar_link", 10)
    log.tf_static(("base_link", "velodyne", LIDAR), ("base_link", "imu_link", transform(0.1)))


@register
def robot_localization_footprint(log):
    velodyne(log)
    mount = ("base_footprint", "base_link", numpy.linalg.inv(FOOTPRINT))
    log.tf_static(mount)
    log.odometry("/odometry/filtered", "odom", "base_footprint", 50, mount=FOOTPRINT)
    log.tf("odom", "base_footprint", 50, lambda at_ns: pose(at_ns) @ FOOTPRINT)


@register
def robot_localization_dual(log):
    velodyne(log)
    log.odometry("/odometry/local", "odom", "base_link", 50, frame_from_world=ODOM_FROM_MAP)
    log.odometry("/odometry/global", "map", "base_link", 20)
    log.tf("odom", "base_link", 50, odom_from_base)
    log.tf("map", "odom", 20, lambda _: ODOM)


@register
def navsat_transform(log):
    velodyne(log)
    log.tf_static(("base_link", "gps", MAST), ("base_link", "imu_link", IDENTITY))
    log.fixes("/gps/fix", "gps", 5, MAST)
    log.begins_at_m = (0.0, 0.0, 0.0)
    log.imu("/imu/data", "imu_link", 100)
    log.odometry("/odometry/filtered", "map", "base_link", 30)
    # Positions without an attitude, of no frame.
    for at_ns in log.times(5):
        message = make("nav_msgs/msg/Odometry", header=header("map", at_ns))
        x, y, z = pose(at_ns)[:3, 3]
        message.pose.pose.position = make("geometry_msgs/msg/Point", x=x, y=y, z=z)
        message.pose.pose.orientation.w = 1.0
        log.add("/odometry/gps", at_ns, message)


@register
def wheel_odometry_beside(log):
    velodyne(log)
    slip(log, 20)
    log.odometry("/odometry/filtered", "odom", "base_link", 50)
    log.tf("odom", "base_link", 50)


@register
def wheel_odometry_faster(log):
    velodyne(log)
    slip(log, 100)
    log.odometry("/odometry/filtered", "odom", "base_link", 50)
    log.tf("odom", "base_link", 50)


def slip(log, rate_hz):
    """A wheel odometry that slips aside in the middle of the drive."""
    for span_s, slipped in [((-1, 0.9), IDENTITY), ((1, 4), SLIPPED)]:
        options = {"frame_from_world": slipped, "span_s": span_s}
        log.odometry("/odom", "odom", "base_link", rate_hz, **options)


@register
def amcl(log):
    velodyne(log)
    amcl_alone(log)
    moved = {"mount": FOOTPRINT, "frame_from_world": ODOM_FROM_MAP}
    log.odometry("/odom", "odom", "base_footprint", 20, **moved)


@register
def amcl_without_odometry(log):
    velodyne(log)
    amcl_alone(log)


def amcl_alone(log):
    """AMCL's sparse poses and the transforms of a robot on its wheels."""
    log.tf_static(("base_footprint", "base_link", numpy.linalg.inv(FOOTPRINT)))
    log.poses("/amcl_pose", "map", 2, covariance=True, mount=FOOTPRINT)
    log.tf("odom", "base_footprint", 20, lambda at_ns: odom_from_base(at_ns) @ FOOTPRINT)
    log.tf("map", "odom", 10, lambda _: ODOM)


@register
def amcl_pose_alone(log):
    velodyne(log)
    log.poses("/amcl_pose", "map", 10, covariance=True)


@register
def amcl_pose_sparse(log):
    velodyne(log)
    log.poses("/amcl_pose", "map", 1, covariance=True)


@register
def ndt(log):
    log.clouds("/sensing/lidar/concatenated/pointcloud", "base_link", AUTOWARE)
    log.poses("/ndt_pose", "map", 10)
    log.poses("/ndt_pose_with_covariance", "map", 10, covariance=True)
    log.tf("map", "base_link", 10)


@register
def autoware(log):
    log.clouds("/sensing/lidar/concatenated/pointcloud", "base_link", AUTOWARE)
    log.odometry("/localization/kinematic_state", "map", "base_link", 50)
    log.poses("/localization/pose_estimator/pose", "map", 10)
    log.tf("map", "base_link", 50)


@register
def mavros(log):
    velodyne(log)
    log.poses("/mavros/local_position/pose", "map", 30)
    log.imu("/mavros/imu/data", "base_link", 50)


@register
def mavros_odometry(log):
    velodyne(log)
    log.poses("/mavros/local_position/pose", "map", 30)
    log.odometry("/mavros/local_position/odom", "map", "base_link", 30)


@register
def tf_alone(log):
    velodyne(log)
    log.tf("odom", "base_link", 50, odom_from_base)
    log.tf("map", "odom", 20, lambda _: ODOM)


@register
def tf_alone_without_map(log):
    velodyne(log)
    log.tf("odom", "base_link", 50)


def clearpath(log):
    """Sensors of a Clearpath robot in its namespace."""
    log.clouds("/a200_0001/sensors/lidar3d_0/points", "lidar3d_0_laser", VELODYNE, LIDAR)
    log.tf_static(("base_link", "lidar3d_0_laser", LIDAR), topic="/a200_0001/tf_static")
    log.tf("odom", "base_link", 50, topic="/a200_0001/tf")


@register
def clearpath_odometry(log):
    clearpath(log)
    log.odometry("/a200_0001/platform/odom/filtered", "odom", "base_link", 50)
    log.odometry("/a200_0001/platform/odom", "odom", "base_link", 10, frame_from_world=SLIPPED)


@register
def clearpath_tf_alone(log):
    clearpath(log)


@register
def turtlebot4(log):
    frame = "oakd_rgb_camera_optical_frame"
    log.clouds("/robot1/oakd/points", frame, OAKD, CAMERA @ OPTICAL)
    log.tf_static(("base_link", "oakd_link", CAMERA), topic="/robot1/tf_static")
    log.tf_static(("oakd_link", frame, OPTICAL), topic="/robot1/tf_static")
    log.odometry("/robot1/odom", "odom", "base_link", 20)
    log.tf("odom", "base_link", 20, topic="/robot1/tf")
    for at_ns in log.times(5):
        log.add(
            "/robot1/scan",
            at_ns,
            make("sensor_msgs/msg/LaserScan", header=header("rplidar_link", at_ns)),
        )


@register
def imu_odometry(log):
    velodyne(log)
    log.tf_static(("base_link", "imu_link", TURNED_IMU))
    log.odometry("/odometry/imu", "odom", "imu_link", 100, mount=TURNED_IMU)


@register
def imu_odometry_without_mount(log):
    velodyne(log)
    log.odometry("/odometry/imu", "odom", "imu_link", 100, mount=TURNED_IMU)


@register
def odometry_of_body(log):
    velodyne(log, "body")
    log.odometry("/Odometry", "camera_init", "body", 50)


@register
def odometry_without_child(log):
    velodyne(log)
    log.odometry("/odom", "odom", "", 50)


@register
def base_footprint_alone(log):
    velodyne(log, "base_footprint")
    log.odometry("/odom", "odom", "base_footprint", 50)


@register
def odom_static_in_map(log):
    velodyne(log)
    log.tf_static(("map", "odom", ODOM))
    log.odometry("/odom", "odom", "base_link", 50, frame_from_world=ODOM_FROM_MAP)


@register
def motion_capture(log):
    velodyne(log)
    log.poses("/vrpn_mocap/robot/pose", "world", 100)


@register
def frames_with_prefix(log):
    log.clouds("/robot1/velodyne_points", "robot1/velodyne", VELODYNE, LIDAR)
    log.odometry("/robot1/odom", "robot1/odom", "robot1/base_link", 50)
    log.tf_static(("robot1/base_link", "robot1/velodyne", LIDAR))
    log.tf("robot1/odom", "robot1/base_link", 50)


@register
def map_begins_late(log):
    # Localization starts two seconds after odometry.
    velodyne(log)
    log.odometry("/odom", "odom", "base_link", 50, frame_from_world=ODOM_FROM_MAP)
    log.tf("odom", "base_link", 50, odom_from_base)
    log.tf("map", "odom", 10, lambda _: ODOM, span_s=(0.9, 4))
    log.mapped = log.scans[10:]


@register
def nav2_goal(log):
    velodyne(log)
    log.poses("/goal_pose", "map", 10, span_s=(-1, -1))
    log.poses("/initialpose", "map", 10, covariance=True, span_s=(-1, -1))
    log.poses("/amcl_pose", "map", 10, covariance=True)


@register
def wheel_odometry_under_ekf(log):
    # The filter's odometry is on tf only; that of the wheels has the same frames.
    velodyne(log)
    slip(log, 50)
    log.tf("odom", "base_link", 50)


@register
def two_robots(log):
    # The names of frames are the same, the mounts are not.
    for robot, world, mount in [("robot1", IDENTITY, LIDAR), ("robot2", SLIPPED, CAMERA)]:
        log.clouds(f"/{robot}/velodyne_points", "velodyne", VELODYNE, mount)
        log.odometry(f"/{robot}/odom", "odom", "base_link", 50, frame_from_world=world)
        log.tf_static(("base_link", "velodyne", mount), topic=f"/{robot}/tf_static")


@register
def names_with_slashes(log):
    log.clouds("/velodyne_points", "/velodyne", VELODYNE, LIDAR)
    log.tf_static(("/base_link", "/velodyne", LIDAR))
    log.odometry("/odom", "/odom", "/base_link", 50)
