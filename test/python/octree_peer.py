"""Octrees of the PyPI package `pyoctomap`, OctoMap's own library, beside ours.

    octree_peer.py FOLDER

FOLDER has `scene.json`: the sensor model and scans of a map of cubic cells, and the data of its messages in hex. A tree
is built from the same scans with voxels of the cell size, shifted by half a cell, so that a voxel is a cell. Prints a
line of JSON: cells, and where the trees differ. Writes `theirs.bt` and `theirs.ot`.
"""

import json
import math
import struct
import sys
from pathlib import Path

import numpy
import pyoctomap

LEVELS = 16


def nodes_of(data, binary):
    """Number of nodes of a stream; it must end with its last one."""
    nodes, at, depths = 1, 0, [LEVELS]
    while depths:
        below = depths.pop()
        if binary:
            (pairs,) = struct.unpack_from("<H", data, at)
            at += 2
            kinds = [pairs >> (2 * child) & 3 for child in range(8)]
            nodes += sum(kind != 0 for kind in kinds)
            inner = kinds.count(3)
        else:
            inner = data[at + 4].bit_count()
            at += 5
            nodes += inner
        assert below > 0 or not inner
        depths += [below - 1] * inner
    assert at == len(data), (at, len(data))
    return nodes


def file_of(message, path):
    """A file of a message, as one that saves a message makes it."""
    data, binary = bytes.fromhex(message["data"]), message["binary"]
    kind = " binary" if binary else ""
    head = f"# Octomap OcTree{kind} file\nid {message['id']}\nsize {nodes_of(data, binary)}\n"
    path.write_bytes(f"{head}res {message['resolution']}\ndata\n".encode() + data)


def voxels_of(tree):
    """Log-odds by the indices of each smallest voxel."""
    found, resolution = {}, tree.getResolution()
    for leaf in tree.begin_leafs():
        side = round(leaf.getSize() / resolution)
        low = [round(c / resolution - side / 2) for c in leaf.getCoordinate()]
        value = leaf.current_node.getLogOdds()
        for place in numpy.ndindex(side, side, side):
            found[tuple(a + b for a, b in zip(low, place))] = value
    return found


def read(path, binary):
    if binary:
        tree = pyoctomap.OcTree(1.0)
        assert tree.readBinary(str(path)), path
        return tree
    tree = pyoctomap.OcTree(1.0).read(str(path))
    assert tree is not None, path
    return tree


def chance(log_odds):
    return 1 / (1 + math.exp(-log_odds))


def built(scene):
    tree = pyoctomap.OcTree(scene["cell_m"])
    model = scene["log_odds"]
    tree.setProbHit(chance(model["hit"]))
    tree.setProbMiss(chance(model["miss"]))
    tree.setClampingThresMin(chance(model["least"]))
    tree.setClampingThresMax(chance(model["most"]))
    shift = scene["cell_m"] / 2
    for scan in scene["scans"]:
        points, origin = numpy.array(scan["points"]) + shift, numpy.array(scan["origin"]) + shift
        tree.insertPointCloud(points, origin, discretize=True)
    return tree


def main():
    folder = Path(sys.argv[1])
    scene = json.loads((folder / "scene.json").read_text())
    theirs = built(scene)
    cells = voxels_of(theirs)
    result = {"cells": len(cells), "occupied": sum(v >= 0 for v in cells.values())}
    for name, message in scene["messages"].items():
        path = folder / f"ours_{name}"
        file_of(message, path)
        tree = read(path, message["binary"])
        ours = voxels_of(tree)
        known, wrong, difference = 0, 0, 0.0
        for voxel, value in ours.items():
            cell = tuple((v + 1) // 2 for v in voxel)
            expected = cells.get(cell)
            known += expected is not None
            if message["binary"]:
                wrong += expected is None or (value >= 0) != (expected >= 0)
            elif expected is not None:
                difference = max(difference, abs(value - expected))
        result[name] = {
            "resolution": tree.getResolution(),
            "voxels": len(ours),
            "known": known,
            "wrong": wrong,
            "difference": difference,
        }
    for name, binary in (("file.bt", True), ("file.ot", False)):
        tree = read(folder / name, binary)
        voxels = voxels_of(tree)
        result[name] = {"voxels": len(voxels), "values": sorted(set(voxels.values()))}
    theirs.write(str(folder / "theirs.ot"))
    theirs.writeBinary(str(folder / "theirs.bt"))
    occupied = [[(v + 0.5) * scene["cell_m"] for v in at] for at, value in cells.items() if value >= 0]
    result["centers"] = sorted(occupied)
    print(json.dumps(result))


main()
