"""A subscriber of `projected_map`, as Nav2's static layer is one, over Cyclone DDS or over Fast DDS in rclpy.

    grid_peer.py cyclone|rclpy DOMAIN EXPECTED...

Over Cyclone it takes updates too; over rclpy grids alone, as the layer does by default. EXPECTED are files of triples of
little-endian 32-bit numbers: column, row and value of each known cell. Once its array has the known cells of the first
file and no others, it prints a line of JSON with the messages so far, and goes on to the next file.
"""

import faulthandler
import json
import os
import sys
import time

import numpy

PATIENCE_S = 180


class Layer:
    """The array that grids and updates leave."""

    def __init__(self):
        self.cells, self.corner = numpy.zeros((0, 0), numpy.int8), (0, 0)
        self.found = {"grids": 0, "updates": 0, "resolution": 0.0, "frame": ""}

    def on_grid(self, grid):
        info = grid.info
        self.cells = numpy.array(grid.data, numpy.int8).reshape(info.height, info.width)
        origin = info.origin
        at = [value / info.resolution for value in (origin.position.x, origin.position.y)]
        assert all(abs(value - round(value)) < 1e-6 for value in at), at
        assert (origin.orientation.w, origin.orientation.z) == (1.0, 0.0), origin
        self.corner = tuple(map(round, at))
        self.found["grids"] += 1
        self.found["resolution"], self.found["frame"] = info.resolution, grid.header.frame_id

    def on_update(self, update):
        values = numpy.array(update.data, numpy.int8).reshape(update.height, update.width)
        assert update.header.frame_id == self.found["frame"], update.header
        rows, columns = slice(update.y, update.y + update.height), slice(update.x, update.x + update.width)
        # It fails where the update leaves the bounds.
        self.cells[rows, columns] = values
        assert self.cells[rows, columns].shape == values.shape
        self.found["updates"] += 1

    def known(self):
        rows, columns = numpy.nonzero(self.cells != -1)
        values = self.cells[rows, columns].astype("<i4")
        found = numpy.stack([columns + self.corner[0], rows + self.corner[1], values], axis=1)
        return found[numpy.lexsort(found.T[::-1])]

    def has(self, expected):
        return numpy.array_equal(self.known(), expected)

    def state(self):
        return f"{len(self.known())} known cells, {self.found}"


def over_cyclone(domain, layer):
    # First: it sets what Cyclone reads when it is loaded.
    import cyclone_peer
    import ros_idl as ros

    peer = cyclone_peer.Peer(domain)
    latched, default = cyclone_peer.qos(1, latched=True), cyclone_peer.qos(10)
    peer.reader("rt/projected_map", ros.OccupancyGrid, latched, layer.on_grid)
    updates = "rt/projected_map_updates"
    peer.reader(updates, ros.OccupancyGridUpdate, default, layer.on_update)
    return lambda reached: peer.until(reached, layer.state)


def over_rclpy(domain, layer):
    os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    import rclpy
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    rclpy.init(domain_id=domain)
    node = rclpy.create_node("static_layer", start_parameter_services=False)
    qos = QoSProfile(
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    node.create_subscription(OccupancyGrid, "/projected_map", layer.on_grid, qos)

    def until(reached):
        end = time.monotonic() + PATIENCE_S
        while not reached():
            assert time.monotonic() < end, layer.state()
            rclpy.spin_once(node, timeout_sec=0.1)

    return until


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    kind, domain, *files = sys.argv[1:]
    layer = Layer()
    until = {"cyclone": over_cyclone, "rclpy": over_rclpy}[kind](int(domain), layer)
    for file in files:
        expected = numpy.fromfile(file, dtype="<i4").reshape(-1, 3)
        until(lambda expected=expected: layer.has(expected))
        print(json.dumps(layer.found), flush=True)


main()
