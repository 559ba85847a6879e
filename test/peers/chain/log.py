"""A rosbag2 log of `points` and `odom` for the chain's nodes and peers, from a survey of `lattice simulate site`.

    log.py SURVEY.xyzi FOLDER --clouds N --scans K --rate-hz HZ

A cloud is K consecutive scans of the survey (`x y z intensity`, float32), as a scanner at the place of the first of them sees
them; the machine turns by 0.1 rad/s. Poses come at 100 Hz, with the pose of each cloud among them. Prints the points.
"""

import argparse
import json
import math
import pathlib

import numpy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
SCAN = numpy.dtype([("place", "<f8", 3), ("points", "<u8")])
TURN_RAD_PER_S = 0.1
POSE_NS = 10_000_000
START_NS = 1_700_000_000_000_000_000
FLOAT32 = 7


def message(name, /, **fields):
    return STORE.types[name](**fields)


def header(at_ns, frame):
    stamp = message("builtin_interfaces/msg/Time", sec=at_ns // 10**9, nanosec=at_ns % 10**9)
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def odometry(at_ns, place, yaw):
    point = message("geometry_msgs/msg/Point", x=place[0], y=place[1], z=place[2])
    turned = message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    pose = message("geometry_msgs/msg/Pose", position=point, orientation=turned)
    zero = message("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    twist = message("geometry_msgs/msg/Twist", linear=zero, angular=zero)
    none = numpy.zeros(36)
    return message(
        "nav_msgs/msg/Odometry",
        header=header(at_ns, "map"),
        child_frame_id="base_link",
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=none),
        twist=message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=none),
    )


def cloud(at_ns, records):
    fields = [
        message("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=FLOAT32, count=1)
        for i, name in enumerate(("x", "y", "z", "intensity"))
    ]
    return message(
        "sensor_msgs/msg/PointCloud2",
        header=header(at_ns, "base_link"),
        height=1,
        width=len(records),
        fields=fields,
        is_bigendian=False,
        point_step=16,
        row_step=16 * len(records),
        data=numpy.frombuffer(records.tobytes(), dtype=numpy.uint8),
        is_dense=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("survey")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--clouds", type=int, required=True)
    parser.add_argument("--scans", type=int, required=True)
    parser.add_argument("--rate-hz", type=float, required=True)
    options = parser.parse_args()
    points = numpy.memmap(options.survey, dtype="<f4", mode="r").reshape(-1, 4)
    scans = numpy.fromfile(options.survey + ".scans", dtype=SCAN)
    ends = numpy.cumsum(scans["points"])
    period_ns = round(1e9 / options.rate_hz)
    names = {"points": "sensor_msgs/msg/PointCloud2", "odom": "nav_msgs/msg/Odometry"}
    total = 0
    with Writer(options.folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        made = {topic: writer.add_connection("/" + topic, kind, typestore=STORE) for topic, kind in names.items()}
        put = lambda topic, at_ns, what: writer.write(made[topic], at_ns, STORE.serialize_cdr(what, names[topic]))  # noqa: E731
        places = [scans["place"][i * options.scans] for i in range(options.clouds)]
        at_ns = START_NS
        for index in range(options.clouds):
            first = index * options.scans
            begin, end = ends[first] - scans["points"][first], ends[first + options.scans - 1]
            yaw = TURN_RAD_PER_S * 1e-9 * (at_ns - START_NS)
            back = numpy.array([[math.cos(yaw), math.sin(yaw), 0], [-math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
            records = numpy.array(points[int(begin) : int(end)])
            records[:, :3] = (records[:, :3].astype(float) - places[index]) @ back.T
            total += len(records)
            put("odom", at_ns, odometry(at_ns, places[index], yaw))
            put("points", at_ns, cloud(at_ns, records))
            after = places[min(index + 1, options.clouds - 1)]
            for step in range(POSE_NS, period_ns, POSE_NS):
                between = places[index] + (after - places[index]) * step / period_ns
                put("odom", at_ns + step, odometry(at_ns + step, between, yaw + TURN_RAD_PER_S * 1e-9 * step))
            at_ns += period_ns
        # Behind the last cloud.
        put("odom", at_ns, odometry(at_ns, places[-1], TURN_RAD_PER_S * 1e-9 * (at_ns - START_NS)))
    print(json.dumps({"clouds": options.clouds, "points": total}))


if __name__ == "__main__":
    main()
