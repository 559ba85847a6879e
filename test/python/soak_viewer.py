"""A viewer of `voxel_markers` in rclpy over Fast DDS, for as long as its input lasts.

    soak_viewer.py DOMAIN

A line with a number on standard input: it waits until its scene has so many points, has a parameter of the mapper
answered, and prints one line of JSON.
"""

import json
import os
import queue
import sys
import threading
import time

# Read while rclpy is loaded.
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import HistoryPolicy, QoSProfile
from visualization_msgs.msg import Marker, MarkerArray

PATIENCE_S = 120


class Viewer:
    def __init__(self, domain):
        rclpy.init(domain_id=domain)
        self.node = rclpy.create_node(f"viewer_{os.getpid()}", start_parameter_services=False)
        self.points, self.messages = {}, 0
        qos = QoSProfile(history=HistoryPolicy.KEEP_ALL)
        self.node.create_subscription(MarkerArray, "/voxel_markers", self.draw, qos)
        self.mapper = AsyncParameterClient(self.node, "lattice_mapper")
        self.until(self.mapper.services_are_ready, "parameters of the mapper")
        self.until(lambda: self.node.count_publishers("/voxel_markers"), "a publisher of markers")

    def draw(self, message):
        self.messages += 1
        for marker in message.markers:
            name = (marker.ns, marker.id)
            if marker.action == Marker.ADD:
                self.points[name] = len(marker.points)
            elif marker.action == Marker.DELETE:
                self.points.pop(name, None)
            else:
                self.points.clear()

    def count(self):
        return sum(self.points.values())

    def until(self, reached, what):
        end = time.monotonic() + PATIENCE_S
        while not reached():
            assert time.monotonic() < end, f"waited {PATIENCE_S} s in vain for {what}"
            rclpy.spin_once(self.node, timeout_sec=0.1)

    def see(self, points):
        self.until(lambda: self.count() == points, f"{points} points, there are {self.count()}")
        answer = self.mapper.get_parameters(["use_sim_time"])
        self.until(answer.done, "a parameter")
        return {"points": points, "messages": self.messages, "answers": len(answer.result().values)}


def main():
    viewer, lines = Viewer(int(sys.argv[1])), queue.SimpleQueue()
    print("ready", flush=True)
    # The node takes what comes while no line is there.
    threading.Thread(target=lambda: [*map(lines.put, sys.stdin), lines.put(None)], daemon=True).start()
    line = ""
    while line is not None:
        if line:
            print(json.dumps(viewer.see(int(line))), flush=True)
            line = ""
        try:
            line = lines.get_nowait()
        except queue.Empty:
            rclpy.spin_once(viewer.node, timeout_sec=0.1)


main()
