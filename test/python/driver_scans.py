"""Logs of drivers that publish scans, points of their own types, or raw packets."""

import numpy

from driver_messages import header, make
from driver_recording import SENSOR
from driver_robot import LIDAR, filtered, register, velodyne
from driver_scene import COLUMNS, LASER_M, ROWS, SCAN_NS, planar_drive, transform

# The laser of planar_drive turns clockwise; upside down its angles grow.
UPRIGHT = transform(z=LASER_M)
UPSIDE_DOWN = transform(z=LASER_M, roll=numpy.pi)
RANGE_MAX = 25.0
# REP 117, older drivers, and what lies out of range.
NO_RETURNS = [numpy.inf, -numpy.inf, numpy.nan, 0.0, RANGE_MAX + 1, 0.01]


def ranges_of(scan):
    """Range of each ray; each kind of no return in its turn."""
    ranges = numpy.linalg.norm(scan.seen_from(UPRIGHT)[:, 0], axis=-1)
    missing = numpy.resize(numpy.array(NO_RETURNS), COLUMNS)
    return numpy.where(scan.returned[:, 0], ranges, missing).astype("f4")


def laser(log, topic, message, mount, sign, poses=True):
    """Scans of a type on the usual robot; `message` makes one of its ranges and the common fields."""
    log.tf_static(("base_link", "laser", mount))
    if poses:
        filtered(log)
    log.mapped = planar_drive()
    step = 2 * numpy.pi / COLUMNS
    for scan in log.mapped:
        fields = {
            "header": header("laser", scan.stamp_ns),
            "angle_min": sign * 0.13 * step,
            "angle_max": sign * (0.13 + COLUMNS - 1) * step,
            "angle_increment": sign * step,
            "time_increment": SCAN_NS / COLUMNS * 1e-9,
            "scan_time": SCAN_NS * 1e-9,
            "range_min": 0.05,
            "range_max": RANGE_MAX,
        }
        log.add(topic, scan.stamp_ns + SCAN_NS, message(ranges_of(scan), fields), SENSOR)


def laser_scan(ranges, fields):
    return make(
        "sensor_msgs/msg/LaserScan",
        ranges=ranges,
        intensities=numpy.full(len(ranges), 47, "f4"),
        **fields,
    )


@register
def rplidar(log):
    laser(log, "/scan", laser_scan, UPRIGHT, -1)


@register
def sick_scan(log):
    laser(log, "/front/scan", laser_scan, UPSIDE_DOWN, 1)


@register
def scan_alone(log):
    laser(log, "/scan", laser_scan, UPRIGHT, -1, poses=False)


@register
def scan_with_other_lidar(log):
    # A planar laser and a lidar in frames of their own: both are mapped.
    laser(log, "/scan", laser_scan, UPRIGHT, -1)
    velodyne(log)
    log.mapped = log.mapped + log.scans


@register
def urg_node_echoes(log):
    def echoes(ranges, fields):
        # Every third ray has none at all where nothing returned.
        rays = [[r] if numpy.isfinite(r) or i % 3 else [] for i, r in enumerate(ranges)]
        rays = [ray + [numpy.inf] if i % 4 == 0 else ray for i, ray in enumerate(rays)]
        rays = [
            make("sensor_msgs/msg/LaserEcho", echoes=numpy.array(ray, dtype="f4")) for ray in rays
        ]
        return make("sensor_msgs/msg/MultiEchoLaserScan", ranges=rays, **fields)

    laser(log, "/echoes", echoes, UPRIGHT, -1)


@register
def scan_beside_clouds(log):
    # velodyne_laserscan: made of the clouds of the same frame.
    velodyne(log)
    filtered(log)
    for scan in log.scans:
        message = make("sensor_msgs/msg/LaserScan", header=header("velodyne", scan.stamp_ns))
        log.add("/scan", scan.stamp_ns, message, SENSOR)


def own_points(log, frame, message):
    """Points of each scan with their times since the stamp, ns, by the maker of a message."""
    for scan in log.scans:
        points = scan.seen_from(LIDAR)[scan.returned]
        since_ns = numpy.repeat(scan.column_ns - scan.stamp_ns, ROWS)[scan.returned.reshape(-1)]
        log.add(
            *message(points, since_ns, header(frame, scan.stamp_ns), scan.stamp_ns + SCAN_NS),
            SENSOR,
        )


def livox_custom(package):
    def record(log):
        # livox_ros_driver2 with xfer_format 1.
        log.tf_static(("base_link", "livox_frame", LIDAR))
        filtered(log)

        def message(points, since_ns, head, at_ns):
            rows = [
                make(
                    f"{package}/msg/CustomPoint",
                    offset_time=int(offset),
                    x=x,
                    y=y,
                    z=z,
                    reflectivity=100,
                    tag=16,
                )
                for (x, y, z), offset in zip(points, since_ns)
            ]
            rows.insert(7, make(f"{package}/msg/CustomPoint", offset_time=7))
            fields = {"header": head, "timebase": 4_000_000_000, "point_num": len(rows)}
            return "/livox/lidar", at_ns, make(f"{package}/msg/CustomMsg", points=rows, **fields)

        own_points(log, "livox_frame", message)

    record.__name__ = package
    register(record)


for each in ["livox_ros_driver2", "livox_ros_driver", "livox_interfaces"]:
    livox_custom(each)


@register
def point_cloud_1(log):
    log.tf_static(("base_link", "lidar", LIDAR))
    filtered(log)

    def message(points, since_ns, head, at_ns):
        rows = [make("geometry_msgs/msg/Point32", x=x, y=y, z=z) for x, y, z in points]
        times = make(
            "sensor_msgs/msg/ChannelFloat32", name="time", values=(since_ns * 1e-9).astype("f4")
        )
        cloud = make("sensor_msgs/msg/PointCloud", header=head, points=rows, channels=[times])
        return "/points", at_ns, cloud

    own_points(log, "lidar", message)


@register
def ouster_packets(log):
    filtered(log)
    for at_ns in log.times(10):
        log.add("/ouster/lidar_packets", at_ns, make("ouster_sensor_msgs/msg/PacketMsg"), SENSOR)


@register
def velodyne_packets(log):
    filtered(log)
    for at_ns in log.times(10):
        message = make("velodyne_msgs/msg/VelodyneScan", header=header("velodyne", at_ns))
        log.add("/velodyne_packets", at_ns, message, SENSOR)
