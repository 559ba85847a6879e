"""A node of rclpy over the Fast DDS of ROS 2 Jazzy, as its tools are, against nodes of ours.

    rclpy_peer.py SCENARIO     a JSON file; prints one line of JSON with what it was answered
"""

import faulthandler
import json
import os
import sys
import time
from pathlib import Path

# Read while rclpy is loaded.
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
import yaml
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetLoggerLevels
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger
from type_description_interfaces.srv import GetTypeDescription

PATIENCE_S = 60
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Peer(Node):
    def __init__(self, node):
        super().__init__("peer", start_parameter_services=False)
        self.of, self.centers, self.events, self.asked = node, 0, [], 0
        self.client = AsyncParameterClient(self, node)
        self.create_subscription(PointCloud2, "/map_centers", self.on_centers, LATCHED)
        self.create_subscription(ParameterEvent, "/parameter_events", self.on_event, 100)
        # Answers of one and of several datagrams.
        self.create_service(Trigger, "/peer/short", lambda _, answer: self.answer(answer, 10))
        self.create_service(Trigger, "/peer/long", lambda _, answer: self.answer(answer, 5000))

    def on_centers(self, _message):
        self.centers += 1

    def on_event(self, event):
        changed = {one.name: parameter_value_to_python(one.value) for one in event.changed_parameters}
        if changed:
            self.events.append([event.node, changed])

    def answer(self, answer, length):
        self.asked += 1
        answer.success, answer.message = True, "x" * length
        return answer

    def until(self, holds, what):
        end = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end, what
            rclpy.spin_once(self, timeout_sec=0.1)

    def wait(self, future, what):
        self.until(future.done, what)
        return future.result()

    def call(self, kind, name, **fields):
        client = self.create_client(kind, f"/{self.of}/{name}")
        self.until(client.service_is_ready, name)
        return self.wait(client.call_async(kind.Request(**fields)), name)

    def set(self, name, value):
        answer = self.wait(self.client.set_parameters([Parameter(name, value=value)]), name)
        return answer.results[0].reason if not answer.results[0].successful else None

    def parameters(self):
        self.until(self.client.services_are_ready, "parameter services")
        names = self.wait(self.client.list_parameters(), "list_parameters").result.names
        described = self.wait(self.client.describe_parameters(names), "describe_parameters")
        values = self.wait(self.client.get_parameters(names), "get_parameters").values
        values = dict(zip(names, map(parameter_value_to_python, values)))
        return values, {one.name: one.read_only for one in described.descriptors}

    def load(self, values, file):
        """Loads values as `ros2 param dump` writes them; the reasons of those that are refused."""
        tree = {}
        for name, value in values.items():
            *sections, last = name.split(".")
            place = tree
            for section in sections:
                place = place.setdefault(section, {})
            place[last] = value.tolist() if hasattr(value, "tolist") else value
        file.write_text(yaml.dump({f"/{self.of}": {"ros__parameters": tree}}))
        results = self.wait(self.client.load_parameter_file(str(file)), "load").results
        assert len(results) == len(values)
        return [one.reason for one in results if not one.successful]


def main():
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    scenario = json.loads(Path(sys.argv[1]).read_text())
    rclpy.init(domain_id=scenario["domain"])
    peer = Peer(scenario["node"])
    said = {}
    said["values"], said["read_only"] = peer.parameters()
    said["not_loaded"] = peer.load(said["values"], Path(sys.argv[1]).with_name("dump.yaml"))
    # A message that overtakes discovery is lost: it is not latched.
    peer.until(lambda: peer.set("max_cloud_points", 100) or peer.events, "no event")
    said["set"] = {name: peer.set(name, value) for name, value in scenario["set"].items()}
    # Those before are of other values.
    event = [f"/{peer.of}", scenario["event"]]
    peer.until(lambda: event in peer.events, "no event")
    wanted, type_hash = scenario["type"]
    fields = {"type_name": wanted, "type_hash": type_hash, "include_type_sources": True}
    answer = peer.call(GetTypeDescription, "get_type_description", **fields)
    description = answer.type_description
    said["type"] = [answer.successful, len(description.type_description.fields)]
    said["sources"] = sum(len(one.raw_file_contents) for one in answer.type_sources)
    levels = peer.call(GetLoggerLevels, "get_logger_levels", names=[peer.of]).levels
    said["levels"] = [[one.name, one.level] for one in levels]
    said["reset"] = peer.call(Trigger, "reset").success
    peer.until(lambda: peer.centers, "no map_centers")
    peer.until(lambda: peer.asked >= scenario["asked"], "not asked")
    # The answers are on their way.
    peer.until(lambda: Path(scenario["answered"]).exists(), "no answer came back")
    found = dict(peer.get_topic_names_and_types())
    said["topics"] = {name: found.get(name) for name in ("/map_centers", "/voxel_map")}
    said["nodes"] = sorted(peer.get_node_names())
    services = peer.get_service_names_and_types_by_node(peer.of, "/")
    said["services"] = sorted(name.rsplit("/", 1)[1] for name, _ in services)
    print(json.dumps(said))


main()
