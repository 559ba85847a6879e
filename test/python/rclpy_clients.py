"""Fresh clients of one service in rclpy over Fast DDS, each a participant of its own.

    rclpy_clients.py DOMAIN SERVICE COUNT [--at-once]     prints one line of JSON

Each asks for answers of several lengths, and checks them by the CRC that comes with them. The first request goes out
as soon as the client knows the server, which may not know the client yet; with `--at-once`, as soon as it is made.
"""

import json
import os
import statistics
import sys
import time
import zlib

# Read while rclpy is loaded.
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor

# For a match, and for an answer: one that takes longer is lost.
PATIENCE_S = 10

LENGTHS = [1, 1000, 60_000, 300_000, 10]


class Asking:
    def __init__(self, domain, service, number):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        options = {"context": self.context, "start_parameter_services": False}
        self.node = rclpy.create_node(f"asking_{number}", **options)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.client = self.node.create_client(GetParameters, service)

    def call(self, length):
        """Time to the answer, s; none if there was none."""
        start = time.monotonic()
        future = self.client.call_async(GetParameters.Request(names=[str(length)]))
        self.executor.spin_until_future_complete(future, timeout_sec=PATIENCE_S)
        taken = time.monotonic() - start
        if not future.done():
            return None
        text, crc = [value.string_value for value in future.result().values]
        if len(text) != length or zlib.crc32(text.encode()) != int(crc):
            sys.exit(f"the answer of {length} bytes is another")
        return taken

    def end(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def calls(domain, service, number, at_once):
    asking = Asking(domain, service, number)
    if not at_once and not asking.client.wait_for_service(timeout_sec=PATIENCE_S):
        sys.exit(f"client {number} does not find the server")
    first = LENGTHS[number % len(LENGTHS)]
    times = [asking.call(length) for length in [first, *LENGTHS]]
    asking.end()
    return times


def main():
    domain, service, count = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    at_once = "--at-once" in sys.argv
    times = [calls(domain, service, number, at_once) for number in range(count)]
    first = [each[0] for each in times]
    later = [taken for each in times for taken in each[1:]]

    def median(times):
        return statistics.median([taken for taken in times if taken is not None] or [PATIENCE_S])

    print(json.dumps({
        "calls": len(first) + len(later),
        "lost_first": first.count(None),
        "lost": later.count(None),
        "first_s": median(first),
        "median_s": median(later),
        "max_s": max([taken for taken in first + later if taken is not None], default=PATIENCE_S),
    }))


main()
