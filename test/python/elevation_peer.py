"""A subscriber of `elevation` over Cyclone DDS: values of its layers at positions, by the rules of grid_map.

    elevation_peer.py DOMAIN X Y [X Y...]     prints a line of JSON for each message
"""

import faulthandler
import json
import math
import sys

import numpy
import ros_idl as ros
from cyclone_peer import PATIENCE_S, Peer, qos


def matrices(message):
    """Matrices of the layers: rows along x, columns along y, from the greatest coordinates down."""
    info = message.info
    rows, columns = (round(length / info.resolution) for length in (info.length_x, info.length_y))
    found = {}
    for name, array in zip(message.layers, message.data, strict=True):
        outer, inner = array.layout.dim
        # Only this order is taken by grid_map's converter.
        assert (outer.label, inner.label) == ("column_index", "row_index"), array.layout
        assert (outer.size, outer.stride) == (columns, rows * columns), array.layout
        assert (inner.size, inner.stride, array.layout.data_offset) == (rows, rows, 0), array.layout
        matrix = numpy.array(array.data, numpy.float32).reshape((rows, columns), order="F")
        starts = (-message.outer_start_index, -message.inner_start_index)
        found[name] = numpy.roll(matrix, starts, axis=(0, 1))
    return found


def shown(message, positions):
    info, layers = message.info, matrices(message)
    center, rotation = info.pose.position, info.pose.orientation
    assert (rotation.x, rotation.y, rotation.z, rotation.w) == (0.0, 0.0, 0.0, 1.0), rotation
    values = []
    for x, y in positions:
        row = math.floor((center.x + info.length_x / 2 - x) / info.resolution)
        column = math.floor((center.y + info.length_y / 2 - y) / info.resolution)
        at = {name: float(matrix[row, column]) for name, matrix in layers.items()}
        values.append({name: None if math.isnan(value) else value for name, value in at.items()})
    return {
        "frame": message.header.frame_id,
        "resolution": info.resolution,
        "lengths": [info.length_x, info.length_y],
        "basic": list(message.basic_layers),
        "names": list(message.layers),
        "values": values,
    }


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    numbers = [float(number) for number in sys.argv[2:]]
    positions = list(zip(numbers[::2], numbers[1::2], strict=True))
    peer = Peer(int(sys.argv[1]))

    def on_map(message):
        print(json.dumps(shown(message, positions)), flush=True)

    peer.reader("rt/elevation", ros.GridMap, qos(1, latched=True), on_map)
    # Until it is ended.
    peer.until(lambda: False, lambda: "not ended")


main()
