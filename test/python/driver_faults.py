"""Logs that lack something, or have it otherwise than it is taken."""

from driver_clouds import OAKD, OUSTER
from driver_messages import header, make, pose_message
from driver_robot import LIDAR, filtered, register, velodyne
from driver_scene import IDENTITY, pose


@register
def lidar_alone(log):
    velodyne(log, None)


@register
def lidar_and_imu(log):
    velodyne(log)
    log.tf_static(("base_link", "imu_link", IDENTITY))
    log.imu("/imu/data", "imu_link", 100)


@register
def gazebo_scoped_frame(log):
    log.clouds("/points", "x500/lidar_link/gpu_lidar", OAKD, LIDAR)
    log.tf_static(("base_link", "lidar_link", LIDAR))
    log.odometry("/odom", "odom", "base_link", 50)


@register
def lidar_without_mount(log):
    log.clouds("/ouster/points", "os_lidar", OUSTER, LIDAR)
    filtered(log)


@register
def lidar_on_body(log):
    log.clouds("/ouster/points", "os_lidar", OUSTER, LIDAR)
    log.tf_static(("body", "os_lidar", LIDAR))
    log.poses("/pose", "map", 50)


@register
def no_clouds(log):
    filtered(log)
    for at_ns in log.times(10):
        log.add("/range", at_ns, make("sensor_msgs/msg/Range", header=header("sonar", at_ns)))


@register
def empty_clouds(log):
    velodyne(log, returns=False)
    filtered(log)


@register
def clouds_before_and_after_poses(log):
    velodyne(log)
    log.odometry("/odometry/filtered", "odom", "base_link", 50, span_s=(0.98, 2))
    log.mapped = log.scans[10:20]


@register
def sparse_poses(log):
    velodyne(log)
    log.odometry("/odom", "odom", "base_link", 1)


@register
def late_poses(log):
    # An estimator two seconds behind.
    velodyne(log)
    log.odometry("/odom", "odom", "base_link", 50, latency_ns=2_000_000_000)


@register
def poses_without_stamps(log):
    velodyne(log)
    for at_ns in log.times(50):
        posed = make("geometry_msgs/msg/PoseWithCovariance", pose=pose_message(pose(at_ns)))
        fields = {"header": header("odom", 0), "child_frame_id": "base_link", "pose": posed}
        log.add("/odom", at_ns, make("nav_msgs/msg/Odometry", **fields))


@register
def poses_without_rotation(log):
    velodyne(log)
    for at_ns in log.times(50):
        message = make(
            "nav_msgs/msg/Odometry", header=header("odom", at_ns), child_frame_id="base_link"
        )
        log.add("/odom", at_ns, message)
