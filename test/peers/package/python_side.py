"""One measurement of the Python package on raw f32 `x y z i` points: one line of JSON."""

import argparse
import json
import os
import time

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("operation", choices=("quantize", "quantize-out", "insert"))
parser.add_argument("--points", required=True)
parser.add_argument("--volume", type=float, required=True)
parser.add_argument("--threads", required=True)
parser.add_argument("--map-out")
options = parser.parse_args()
# Before the package makes its pool, and NumPy its own, whose idle threads spin for a while.
os.environ["RAYON_NUM_THREADS"] = options.threads
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import numpy as np  # noqa: E402
from lattice_core import Lattice, VoxelMap  # noqa: E402

xyz = np.ascontiguousarray(np.fromfile(options.points, dtype="<f4").reshape(-1, 4)[:, :3])
lattice = Lattice("fcc", options.volume)
voxels = VoxelMap(lattice)
if options.operation == "quantize-out":
    cells = np.ones(xyz.shape, np.int32)
runs = {
    "quantize": lattice.quantize,
    "quantize-out": lambda xyz: lattice.quantize(xyz, out=cells),
    "insert": voxels.insert,
}
run = runs[options.operation]
# Threads start and find their cores, and NumPy is asked for its version, before the clock runs.
lattice.quantize(xyz[:2_000_000])
begin, begin_cpu = time.perf_counter(), time.process_time()
result = run(xyz)
spent = {"wall_s": time.perf_counter() - begin, "cpu_s": time.process_time() - begin_cpu}
if options.map_out:
    voxels.save(options.map_out)
print(json.dumps({"n": len(xyz), "voxels": len(voxels), **spent}))
