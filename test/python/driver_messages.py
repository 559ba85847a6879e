"""Messages of ROS 2 and of drivers, by the types of rosbags."""

from pathlib import Path

import numpy
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from driver_scene import SECOND_NS, quaternion

DEFINITIONS = Path(__file__).parents[2] / "msgs/definitions/novatel_oem7_msgs"
LIVOX = {
    "CustomPoint": "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\n"
    "uint8 reflectivity\nuint8 tag\nuint8 line\n",
    "CustomMsg": "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\n"
    "uint8[3] rsvd\nCustomPoint[] points\n",
}


LIVOX_PACKAGES = ["livox_ros_driver2", "livox_ros_driver", "livox_interfaces"]
# Raw packets, whose layout is of no concern.
PACKETS = {
    "ouster_sensor_msgs/msg/PacketMsg": "uint8[] buf\n",
    "velodyne_msgs/msg/VelodynePacket": "builtin_interfaces/Time stamp\nuint8[1206] data\n",
    "velodyne_msgs/msg/VelodyneScan": "std_msgs/Header header\nVelodynePacket[] packets\n",
}


def store_with_drivers():
    """Types of ROS 2 Jazzy and of the drivers of NovAtel, Livox, Ouster and Velodyne."""
    store = get_typestore(Stores.ROS2_JAZZY)
    texts = {
        f"novatel_oem7_msgs/msg/{path.stem}": path.read_text() for path in DEFINITIONS.glob("*")
    }
    for package in LIVOX_PACKAGES:
        texts |= {f"{package}/msg/{name}": text for name, text in LIVOX.items()}
    texts |= PACKETS
    for name, text in texts.items():
        store.register(get_types_from_msg(text, name))
    return store


STORE = store_with_drivers()


def make(name, /, **fields):
    """A message with zeros where no field is given."""
    kind = STORE.types[name]
    for field, node in STORE.fielddefs[name][1]:
        if field not in fields:
            fields[field] = zero(*node)
    return kind(**fields)


def zero(kind, what):
    """The empty value of a field."""
    match kind.name:
        case "NAME":
            return make(what)
        case "BASE" if what[0] == "string":
            return ""
        case "BASE":
            return {"bool": bool, "float32": float, "float64": float}.get(what[0], int)()
        case "ARRAY":
            return numpy.zeros(what[1], dtype=what[0][1][0])
        case _:
            (kind, item), _ = what
            return numpy.zeros(0, dtype=item[0]) if kind.name == "BASE" else []


def stamp(at_ns):
    return make("builtin_interfaces/msg/Time", sec=at_ns // SECOND_NS, nanosec=at_ns % SECOND_NS)


def header(frame, at_ns):
    return make("std_msgs/msg/Header", stamp=stamp(at_ns), frame_id=frame)


def orientation(matrix):
    x, y, z, w = quaternion(matrix)
    return make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)


def pose_message(matrix):
    x, y, z = matrix[:3, 3]
    position = make("geometry_msgs/msg/Point", x=x, y=y, z=z)
    return make("geometry_msgs/msg/Pose", position=position, orientation=orientation(matrix))


def transform_message(parent, child, matrix, at_ns):
    x, y, z = matrix[:3, 3]
    return make(
        "geometry_msgs/msg/TransformStamped",
        header=header(parent, at_ns),
        child_frame_id=child,
        transform=make(
            "geometry_msgs/msg/Transform",
            translation=make("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=orientation(matrix),
        ),
    )


def serialized(message):
    return bytes(STORE.serialize_cdr(message, message.__msgtype__))
