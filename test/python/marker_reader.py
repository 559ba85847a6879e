"""A viewer of `voxel_markers` with the receive buffer of a stock kernel, over Cyclone DDS or over Fast DDS in rclpy.

    marker_reader.py cyclone|rclpy DOMAIN EXPECTED

Says `ready` once it has the publisher, and waits until its scene is EXPECTED, a file of points of 3 little-endian
doubles in ascending order. Then it prints one line of JSON: messages, their markers, and how many cleared the scene.
"""

import faulthandler
import json
import os
import sys
import time
from pathlib import Path

import numpy

PATIENCE_S = 180
# net.core.rmem_default of Linux, which Fast DDS leaves as it is.
BUFFER_BYTES = 212_992
ADD, DELETE, DELETEALL = 0, 2, 3


class Scene:
    """What the markers leave in a viewer."""

    def __init__(self, expected):
        self.expected, self.at = expected, {}
        self.found = {"messages": 0, "markers": 0, "cleared": 0}

    def __call__(self, message):
        self.found["messages"] += 1
        for marker in message.markers:
            self.found["markers"] += 1
            name = (marker.ns, marker.id)
            if marker.action == ADD:
                at = marker.pose.position
                points = [(at.x + p.x, at.y + p.y, at.z + p.z) for p in marker.points]
                self.at[name] = numpy.array(points).reshape(-1, 3)
            elif marker.action == DELETE:
                self.at.pop(name, None)
            else:
                assert marker.action == DELETEALL, marker.action
                self.at.clear()
                self.found["cleared"] += 1

    def count(self):
        return sum(map(len, self.at.values()))

    def is_whole(self):
        if self.count() != len(self.expected):
            return False
        points = numpy.concatenate(list(self.at.values()))
        return numpy.array_equal(points[numpy.lexsort(points.T[::-1])], self.expected)

    def state(self):
        return f"{self.count()} of {len(self.expected)} points, {self.found}"


def over_cyclone(domain, scene):
    # First: it sets what Cyclone reads when it is loaded.
    import cyclone_peer
    import ros_idl as ros
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.util import duration

    os.environ["CYCLONEDDS_URI"] += f""",<CycloneDDS><Domain Id="any"><Internal>
<SocketReceiveBufferSize min="default" max="{BUFFER_BYTES}B"/></Internal></Domain></CycloneDDS>"""
    peer = cyclone_peer.Peer(domain)
    qos = Qos(
        Policy.Reliability.Reliable(duration(seconds=10)),
        Policy.History.KeepAll,
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )
    peer.reader("rt/voxel_markers", ros.MarkerArray, qos, scene)
    peer.until_matched()
    print("ready", flush=True)
    peer.until(scene.is_whole, scene.state)


def over_rclpy(domain, scene):
    os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    import rclpy
    from rclpy.qos import HistoryPolicy, QoSProfile
    from visualization_msgs.msg import MarkerArray

    assert int(Path("/proc/sys/net/core/rmem_default").read_text()) == BUFFER_BYTES
    rclpy.init(domain_id=domain)
    node = rclpy.create_node("viewer", start_parameter_services=False)
    node.create_subscription(
        MarkerArray, "/voxel_markers", scene, QoSProfile(history=HistoryPolicy.KEEP_ALL))
    end = time.monotonic() + PATIENCE_S
    while not node.count_publishers("/voxel_markers"):
        assert time.monotonic() < end, "no publisher"
        rclpy.spin_once(node, timeout_sec=0.1)
    print("ready", flush=True)
    while not scene.is_whole():
        assert time.monotonic() < end, scene.state()
        rclpy.spin_once(node, timeout_sec=0.1)


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    kind, domain, expected = sys.argv[1:]
    scene = Scene(numpy.fromfile(expected, dtype="<f8").reshape(-1, 3))
    {"cyclone": over_cyclone, "rclpy": over_rclpy}[kind](int(domain), scene)
    print(json.dumps(scene.found), flush=True)
    # Samples that are not acknowledged yet would be those of a reader that has left.
    sys.stdin.read()


main()
