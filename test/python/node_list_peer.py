"""A node of rclpy over Fast DDS that lists the nodes of its domain.

    node_list_peer.py DOMAIN NODE     says `there` once NODE is listed, and `gone` once it is not
"""

import faulthandler
import os
import sys
import time

# Read while rclpy is loaded.
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from rclpy.node import Node

PATIENCE_S = 60
# Between two looks: the list has no event of its own that rclpy shows.
PERIOD_S = 0.002


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    domain, name = sys.argv[1:]
    rclpy.init(domain_id=int(domain))
    peer = Node("peer", start_parameter_services=False)
    for said, listed in ("there", True), ("gone", False):
        while (name in peer.get_node_names()) != listed:
            time.sleep(PERIOD_S)
        print(said, flush=True)


main()
