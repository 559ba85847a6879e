#!/usr/bin/env python3
"""Nearest cells by the Python package and by SciPy's cKDTree, in turn, on two threads.

Needs a Python with the package and scipy. Ends with 1 if the distances of the two differ.
"""

import sys
import time

import numpy as np
from lattice_core import Lattice, VoxelMap
from scipy.spatial import cKDTree

POINTS, ASKED, TURNS = 4_000_000, 100_000, 5


def site(random):
    """Ground in waves and walls, m."""
    u, v = random.uniform(-150, 150, (2, POINTS))
    points = np.c_[u, v, 3 * np.sin(u / 7) * np.cos(v / 9)]
    walls = random.integers(0, 2, POINTS).astype(bool)
    points[walls, 0] = np.round(points[walls, 0] / 30) * 30
    points[walls, 2] = random.uniform(0, 8, walls.sum())
    return points


def seconds(call):
    start = time.perf_counter()
    answer = call()
    return time.perf_counter() - start, answer


def main():
    random = np.random.default_rng(0)
    points = site(random)
    map = VoxelMap(Lattice("fcc", 0.05))
    map.insert(points)
    centers = map.centers()
    tree = cKDTree(centers)
    print(f"{len(map)} cells, {ASKED} points, {TURNS} turns, two threads")
    asked = points[random.integers(0, POINTS, ASKED)] + random.normal(0, 0.3, (ASKED, 3))
    sets = {
        "near, any order": asked,
        "near, sorted": asked[np.lexsort(np.floor(asked / 4).T)],
        "25 m away": asked[: ASKED // 5] + [0, 0, 25],
    }
    for name, xyz in sets.items():
        for k in (1, 20):
            times = {"scipy": [], "lattice": []}
            for _ in range(TURNS):
                took, (expected, _) = seconds(lambda: tree.query(xyz, k=k, workers=2))
                times["scipy"].append(took)
                took, (found, _) = seconds(lambda: map.query(xyz, k=k))
                times["lattice"].append(took)
                if not np.allclose(np.asarray(expected).reshape(found.shape), found):
                    sys.exit("the distances differ")
            per_point = {side: min(took) / len(xyz) * 1e6 for side, took in times.items()}
            ratio = per_point["lattice"] / per_point["scipy"]
            print(f"{name}, k = {k}: {per_point['scipy']:.2f} us, {per_point['lattice']:.2f} us, ratio {ratio:.2f}")


main()
