"""Messages of lidars and estimators on the drive, written as a rosbag2 log or a ROS 1 bag by rosbags."""

import numpy
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer

from driver_earth import UNDULATION_M, place_of
from driver_messages import (
    STORE,
    header,
    make,
    orientation,
    pose_message,
    serialized,
    transform_message,
)
from driver_ros1 import write_ros1
from driver_scene import DRIVE_S, IDENTITY, SECOND_NS, START_NS, drive, map_of, pose

# What a driver needs to hand a message on.
LATENCY_NS = 5_000_000
GPS_EPOCH_NS, LEAP_NS = 315_964_800 * SECOND_NS, 18 * SECOND_NS


def qos(reliable=True, latched=False, depth=10):
    """What a publisher offers."""
    forever = QosTime(9223372036, 854775807)
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        QosReliability.RELIABLE if reliable else QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE,
        forever,
        forever,
        QosLiveliness.AUTOMATIC,
        forever,
        False,
    )


RELIABLE, SENSOR, LATCHED = qos(), qos(reliable=False, depth=5), qos(latched=True, depth=1)


class Recording:
    """A log that grows by one sensor or estimator a call."""

    scans = drive()
    # Messages of many logs: the same lidar on the same mount.
    clouds_made = {}

    def __init__(self):
        self.topics, self.messages = {}, []
        # What the log maps: scans, and where its map begins.
        self.mapped, self.begins_at_m = list(self.scans), (0.0, 0.0, 0.0)

    def expected(self):
        """Rows of the cells that the log must give."""
        return map_of(self.mapped, self.begins_at_m)

    def add(self, topic, at_ns, message, offered=RELIABLE):
        self.add_bytes(topic, at_ns, message.__msgtype__, serialized(message), offered)

    def add_bytes(self, topic, at_ns, kind, data, offered):
        self.topics.setdefault(topic, (kind, offered))
        self.messages.append((at_ns, topic, data))

    def write(self, folder, storage):
        """Storage: mcap, sqlite3, or ros1 with a compression and other marks."""
        self.messages.sort(key=lambda message: message[0])
        if storage.startswith("ros1"):
            write_ros1(folder, storage.split("_")[1:], self.topics, self.messages)
            return
        with Writer(folder, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
            connections = {
                topic: writer.add_connection(
                    topic, kind, typestore=STORE, offered_qos_profiles=[offered]
                )
                for topic, (kind, offered) in self.topics.items()
            }
            for at_ns, topic, data in self.messages:
                writer.write(connections[topic], at_ns, data)

    def times(self, rate_hz, span_s=DRIVE_S):
        """Stamps of a rate from the beginning to the end of a span, both included."""
        first, last = (round(s * rate_hz) for s in span_s)
        return [START_NS + i * SECOND_NS // rate_hz for i in range(first, last + 1)]

    def clouds(self, topic, frame, layout, sensor=IDENTITY, **options):
        """Scans as a driver sends them; `in_world`: as an estimator registers them."""
        key = (frame, layout, sensor.tobytes(), str(options))
        if key not in self.clouds_made:
            made = [layout.cloud(frame, scan, sensor, **options) for scan in self.scans]
            self.clouds_made[key] = [(serialized(message), at_ns) for message, at_ns in made]
        for data, at_ns in self.clouds_made[key]:
            self.add_bytes(topic, at_ns + LATENCY_NS, "sensor_msgs/msg/PointCloud2", data, SENSOR)

    def odometry(
        self,
        topic,
        frame,
        child,
        rate_hz,
        mount=IDENTITY,
        frame_from_world=IDENTITY,
        latency_ns=LATENCY_NS,
        **options,
    ):
        """Poses of `child`, which `mount` has in the base frame."""
        for at_ns in self.times(rate_hz, **options):
            matrix = frame_from_world @ pose(at_ns) @ mount
            posed = make("geometry_msgs/msg/PoseWithCovariance", pose=pose_message(matrix))
            fields = {"header": header(frame, at_ns), "child_frame_id": child, "pose": posed}
            self.add(topic, at_ns + latency_ns, make("nav_msgs/msg/Odometry", **fields))

    def poses(self, topic, frame, rate_hz, covariance=False, mount=IDENTITY, **options):
        """PoseStamped, or with a covariance."""
        for at_ns in self.times(rate_hz, **options):
            posed = pose_message(pose(at_ns) @ mount)
            kind = "geometry_msgs/msg/PoseStamped"
            if covariance:
                posed = make("geometry_msgs/msg/PoseWithCovariance", pose=posed)
                kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
            self.add(topic, at_ns + LATENCY_NS, make(kind, header=header(frame, at_ns), pose=posed))

    def tf(self, parent, child, rate_hz, matrix_at=pose, topic="/tf", **options):
        """A moving transform; by default that of the machine in the world."""
        for at_ns in self.times(rate_hz, **options):
            transforms = [transform_message(parent, child, matrix_at(at_ns), at_ns)]
            self.add(
                topic, at_ns + LATENCY_NS, make("tf2_msgs/msg/TFMessage", transforms=transforms)
            )

    def tf_static(self, *mounts, topic="/tf_static"):
        """All static transforms of one publisher, as (parent, child, matrix)."""
        at_ns = START_NS + DRIVE_S[0] * SECOND_NS
        transforms = [transform_message(*mount, at_ns) for mount in mounts]
        self.add(topic, at_ns, make("tf2_msgs/msg/TFMessage", transforms=transforms), LATCHED)

    def imu(self, topic, frame, rate_hz, mount=IDENTITY, unknown=False):
        """Attitudes; `unknown` as REP 145 says that there is none."""
        for at_ns in self.times(rate_hz):
            message = make("sensor_msgs/msg/Imu", header=header(frame, at_ns))
            message.orientation = orientation(IDENTITY if unknown else pose(at_ns) @ mount)
            message.orientation_covariance[0] = -1.0 if unknown else 1e-6
            message.linear_acceleration.z = 9.81
            self.add(topic, at_ns + LATENCY_NS, message, SENSOR)

    def fixes(self, topic, frame, rate_hz, mount=IDENTITY, status=0):
        """Places of the antenna, which `mount` has in the base frame; the map begins at the first one."""
        self.begins_at_m = mount[:3, 3]
        for at_ns in self.times(rate_hz):
            latitude, longitude, altitude = place_of(
                (pose(at_ns) @ mount)[:3, 3] - self.begins_at_m
            )
            message = make("sensor_msgs/msg/NavSatFix", header=header(frame, at_ns))
            message.status.status, message.status.service = status, 1
            message.latitude, message.longitude, message.altitude = latitude, longitude, altitude
            self.add(topic, at_ns + LATENCY_NS, message, SENSOR)

    def novatel(self, kind, topic, frame, rate_hz, mount=IDENTITY, status=3):
        """INSPVA or INSPVAX of the INS, which `mount` has in the base frame; stamped when it arrives."""
        self.begins_at_m = mount[:3, 3]
        for at_ns in self.times(rate_hz):
            matrix = pose(at_ns) @ mount
            latitude, longitude, height = place_of(matrix[:3, 3] - self.begins_at_m)
            r = matrix[:3, :3]
            gps_ms = (at_ns + LEAP_NS - GPS_EPOCH_NS) // 1_000_000
            fields = {
                "header": header(frame, at_ns + LATENCY_NS),
                "nov_header": make(
                    "novatel_oem7_msgs/msg/Oem7Header",
                    message_name=kind,
                    gps_week_number=gps_ms // 604_800_000,
                    gps_week_milliseconds=gps_ms % 604_800_000,
                ),
                "latitude": latitude,
                "longitude": longitude,
                # Rz(90 - azimuth) Ry(-pitch) Rx(roll), with x forward.
                "roll": numpy.degrees(numpy.arctan2(r[2, 1], r[2, 2])),
                "pitch": numpy.degrees(numpy.arcsin(r[2, 0])),
                "azimuth": (90 - numpy.degrees(numpy.arctan2(r[1, 0], r[0, 0]))) % 360,
            }
            state = make("novatel_oem7_msgs/msg/InertialSolutionStatus", status=status)
            if kind == "INSPVAX":
                above_sea = {"height": height - UNDULATION_M, "undulation": UNDULATION_M}
                fields |= {"ins_status": state, **above_sea}
            else:
                fields |= {"status": state, "height": height}
            message = make(f"novatel_oem7_msgs/msg/{kind}", **fields)
            self.add(topic, at_ns + LATENCY_NS, message)
