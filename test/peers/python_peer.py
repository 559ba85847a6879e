"""Python peers: open3d (legacy voxel_down_sample, VoxelGrid) and small_gicp (voxelgrid_sampling), one run a call."""

import argparse
import json
import os
import time

parser = argparse.ArgumentParser()
parser.add_argument("--points", required=True)
parser.add_argument("--cell", type=float, required=True)
parser.add_argument("--threads", type=int, default=1)
parser.add_argument("--max-points", type=int, default=-1)
parser.add_argument("--mode", required=True, choices=["open3d-downsample", "open3d-voxelgrid", "small_gicp-python"])
arguments = parser.parse_args()
# Before the libraries start their pools.
os.environ["OMP_NUM_THREADS"] = str(arguments.threads)

import numpy  # noqa: E402

raw = numpy.fromfile(arguments.points, dtype="<f4", count=4 * arguments.max_points if arguments.max_points >= 0 else -1)
# Shifted by half a cell, as in peer.hpp.
points = raw.reshape(-1, 4)[:, :3].astype(numpy.float64) + 0.5 * arguments.cell

if arguments.mode.startswith("open3d"):
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
    if arguments.mode == "open3d-downsample":
        run = lambda: len(cloud.voxel_down_sample(arguments.cell).points)  # noqa: E731
    else:
        # Its grid starts at the least corner: whole cells from zero, as everybody else.
        low = numpy.floor(points.min(axis=0) / arguments.cell) * arguments.cell
        high = points.max(axis=0) + arguments.cell
        run = lambda: len(  # noqa: E731
            open3d.geometry.VoxelGrid.create_from_point_cloud_within_bounds(cloud, arguments.cell, low, high).get_voxels()
        )
else:
    import small_gicp

    run = lambda: small_gicp.voxelgrid_sampling(points, arguments.cell, num_threads=arguments.threads).size()  # noqa: E731

wall, cpu = time.perf_counter(), time.process_time()
voxels = run()
cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
line = {"sys": arguments.mode, "lattice": "cubic", "res": arguments.cell, "threads": arguments.threads}
line |= {"n": len(points), "wall_s": wall, "cpu_s": cpu, "voxels": voxels, "bytes": 0}
print(json.dumps(line))
