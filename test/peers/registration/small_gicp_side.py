"""small_gicp's side of the comparison: one process, one line of JSON as `lattice bench register` prints it."""

import argparse
import json
import pathlib
import sys
import time

import numpy as np
import small_gicp

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
sys.dont_write_bytecode = True

import ply  # noqa: E402


def prepare(points, options):
    """Tree and covariances, with --cell also the thinning."""
    if options.cell:
        cloud = small_gicp.voxelgrid_sampling(points, options.cell, options.threads)
    else:
        cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud, options.threads)
    small_gicp.estimate_covariances(cloud, tree, options.neighbors, options.threads)
    return cloud, tree


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--source", required=True)
    parser.add_argument("--target", required=True)
    parser.add_argument("--gate", type=float, default=1.0)
    parser.add_argument("--neighbors", type=int, default=20)
    parser.add_argument("--cell", type=float)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    source_points, target_points = ply.read(options.source), ply.read(options.target)

    wall = {"prepare": [], "register": []}
    cpu = {"prepare": [], "register": []}
    for turn in range(options.rounds + 1):
        marks = [(time.perf_counter(), time.process_time())]
        target, tree = prepare(target_points, options)
        source, _ = prepare(source_points, options)
        marks.append((time.perf_counter(), time.process_time()))
        found = small_gicp.align(
            target,
            source,
            tree,
            registration_type="GICP",
            max_correspondence_distance=options.gate,
            num_threads=options.threads,
        )
        marks.append((time.perf_counter(), time.process_time()))
        if turn == 0:
            continue
        for part, before, after in zip(wall, marks, marks[1:]):
            wall[part].append(after[0] - before[0])
            cpu[part].append(after[1] - before[1])
    report = {
        "sys": "small_gicp",
        "threads": options.threads,
        "source_points": source.size(),
        "target_points": target.size(),
        "wall": wall,
        "cpu": cpu,
        "target_from_source": np.asarray(found.T_target_source).tolist(),
        "converged": bool(found.converged),
        "iterations": int(found.iterations) + 1,
        "inliers": int(found.num_inliers),
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main()
