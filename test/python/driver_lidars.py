"""Logs of lidars and depth cameras under odometry."""

import numpy

from driver_clouds import HESAI, LIVOX, OUSTER, REALSENSE, ROBOSENSE, VELODYNE
from driver_robot import CAMERA, LIDAR, OPTICAL, REAR, filtered, register, velodyne
from driver_scene import IDENTITY, transform


@register
def ouster(log):
    inner = transform(z=0.036180, yaw=numpy.pi)
    log.clouds("/ouster/points", "os_lidar", OUSTER, LIDAR @ inner)
    log.imu("/ouster/imu", "os_imu", 100, unknown=True)
    log.tf_static(
        ("os_sensor", "os_lidar", inner), ("os_sensor", "os_imu", transform(0.006, -0.012))
    )
    log.tf_static(("base_link", "os_sensor", LIDAR))
    filtered(log)


@register
def velodyne_robot_localization(log):
    velodyne(log)
    filtered(log)


@register
def livox(log):
    log.clouds("/livox/lidar", "livox_frame", LIVOX, LIDAR)
    log.imu("/livox/imu", "livox_frame", 100, unknown=True)
    log.tf_static(("base_link", "livox_frame", LIDAR))
    filtered(log)


@register
def hesai(log):
    log.clouds("/lidar_points", "hesai_lidar", HESAI, LIDAR)
    log.tf_static(("base_link", "hesai_lidar", LIDAR))
    filtered(log)


@register
def robosense(log):
    log.clouds("/rslidar_points", "rslidar", ROBOSENSE, LIDAR)
    log.tf_static(("base_link", "rslidar", LIDAR))
    filtered(log)


@register
def realsense(log):
    log.clouds(
        "/camera/camera/depth/color/points",
        "camera_depth_optical_frame",
        REALSENSE,
        CAMERA @ OPTICAL,
    )
    log.tf_static(("base_link", "camera_link", CAMERA))
    log.tf_static(
        ("camera_link", "camera_depth_frame", IDENTITY),
        ("camera_depth_frame", "camera_depth_optical_frame", OPTICAL),
    )
    log.odometry("/odom", "odom", "base_link", 20)


@register
def two_lidars(log):
    log.clouds("/front/points", "front_lidar", HESAI, LIDAR, columns=slice(0, 50))
    log.clouds("/rear/velodyne_points", "rear_lidar", VELODYNE, REAR, columns=slice(50, None))
    log.tf_static(("base_link", "front_lidar", LIDAR), ("base_link", "rear_lidar", REAR))
    filtered(log)
