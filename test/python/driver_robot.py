"""Mounts of the robot, and what most of its logs have."""

import numpy

from driver_clouds import VELODYNE
from driver_scene import AHEAD_M, MAST_M, pose, transform

# Mounts in the base frame.
LIDAR = transform(0.3, -0.1, 1.1, 0.02, -0.03, 0.1)
REAR = transform(-0.6, 0.05, 0.9, 0.0, 0.04, numpy.pi)
FOOTPRINT = transform(z=-0.1)
MAST, AHEAD = transform(*MAST_M), transform(*AHEAD_M)
TURNED_IMU = transform(1.0, 0.0, 0.2, yaw=numpy.pi / 2)
REVERSED_IMU = transform(0.1, yaw=numpy.pi)
OPTICAL = transform(roll=-numpy.pi / 2, yaw=-numpy.pi / 2)
CAMERA = transform(0.2, 0.02, 0.4, 0.0, 0.05, 0.0)
# Where odometry began in the map, and a wheel odometry that slips.
ODOM = transform(2.0, -1.0, 0.1, 0.0, 0.0, 0.4)
ODOM_FROM_MAP = numpy.linalg.inv(ODOM)
SLIPPED = transform(0.4, 0.7, yaw=0.3)

LOGS = {}


def register(function):
    """Registers what makes a log under its name."""
    LOGS[function.__name__] = function
    return function


def odom_from_base(at_ns):
    """Pose of the machine in the odometry's frame."""
    return ODOM_FROM_MAP @ pose(at_ns)


def velodyne(log, parent="base_link", **options):
    """A Velodyne and its mount on `parent`: the lidar of the logs that are about something else."""
    log.clouds("/velodyne_points", "velodyne", VELODYNE, LIDAR, **options)
    if parent:
        log.tf_static((parent, "velodyne", LIDAR))


def filtered(log, rate_hz=50, **options):
    """robot_localization's ekf_node, world_frame odom."""
    log.odometry("/odometry/filtered", "odom", "base_link", rate_hz, **options)
    log.tf("odom", "base_link", rate_hz)
