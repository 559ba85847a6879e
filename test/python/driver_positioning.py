"""Logs of satellite positioning and inertial systems."""

from driver_robot import AHEAD, MAST, REVERSED_IMU, register, velodyne
from driver_scene import IDENTITY, transform


@register
def novatel_inspvax(log):
    velodyne(log)
    log.tf_static(("base_link", "gps", AHEAD))
    log.novatel("INSPVAX", "/novatel/oem7/inspvax", "gps", 50, AHEAD)
    log.novatel("INSPVA", "/novatel/oem7/inspva", "gps", 50, AHEAD)


@register
def novatel_driver(log):
    # The driver's odometry is in the grid of UTM: too far away for single precision.
    novatel_inspvax(log)
    utm = transform(457_283.0, 5_428_790.0, 115.0, yaw=0.0077)
    log.odometry("/novatel/oem7/odom", "odom", "base_link", 50, frame_from_world=utm)


@register
def novatel_inspva_in_base(log):
    velodyne(log)
    log.novatel("INSPVA", "/novatel/oem7/inspva", "base_link", 100)


@register
def novatel_without_mount(log):
    velodyne(log)
    log.novatel("INSPVA", "/novatel/oem7/inspva", "gps", 50, AHEAD)


@register
def novatel_aligning(log):
    velodyne(log)
    log.novatel("INSPVAX", "/novatel/oem7/inspvax", "base_link", 50, status=1)


@register
def gps_1_hz_imu_100_hz(log):
    velodyne(log)
    log.tf_static(("base_link", "gps", MAST), ("base_link", "imu_link", transform(0.1)))
    log.fixes("/fix", "gps", 1, MAST)
    log.imu("/imu/data", "imu_link", 100)


@register
def gps_imu_reversed(log):
    velodyne(log)
    log.tf_static(("base_link", "gps", AHEAD), ("base_link", "imu_link", REVERSED_IMU))
    log.fixes("/gps/fix", "gps", 10, AHEAD)
    log.imu("/imu/data", "imu_link", 100, REVERSED_IMU)


@register
def gps_imu_reversed_antenna_without_mount(log):
    velodyne(log)
    log.tf_static(("base_link", "imu_link", REVERSED_IMU))
    log.fixes("/gps/fix", "gps", 10, AHEAD)
    log.imu("/imu/data", "imu_link", 100, REVERSED_IMU)


@register
def gps_two_imus(log):
    # That of the lidar has no attitude.
    velodyne(log)
    mounts = [(name, IDENTITY) for name in ("imu_link", "os_imu")]
    log.tf_static(("base_link", "gps", MAST), *(("base_link", *mount) for mount in mounts))
    log.imu("/a_lidar/imu", "os_imu", 100, unknown=True)
    log.imu("/imu/data", "imu_link", 50)
    log.fixes("/fix", "gps", 10, MAST)


@register
def gps_imu_without_mount(log):
    velodyne(log)
    log.tf_static(("base_link", "gps", MAST))
    log.fixes("/fix", "gps", 10, MAST)
    log.imu("/imu/data", "imu_link", 100)


@register
def gps_antenna_without_mount(log):
    velodyne(log)
    log.tf_static(("base_link", "imu_link", IDENTITY))
    log.fixes("/fix", "gps", 10, MAST)
    log.imu("/imu/data", "imu_link", 100)


@register
def gps_imu_without_orientation(log):
    velodyne(log)
    log.fixes("/fix", "base_link", 10)
    log.imu("/imu/data_raw", "base_link", 100, unknown=True)


@register
def gps_without_fix(log):
    velodyne(log)
    log.fixes("/fix", "base_link", 10, status=-1)
    log.imu("/imu/data", "base_link", 100)
