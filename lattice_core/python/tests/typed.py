"""Calls whose types mypy checks against the stubs."""

import numpy as np
from lattice_core import Calibration, Lattice, VoxelMap, calibrate, gicp

lattice = Lattice("fcc", 0.125)
points = np.zeros((4, 3), dtype=np.float32)
map = VoxelMap(lattice, (0.0, 0.0, 0.0), labels=True)
new: int = map.insert(points, labels=np.zeros(4, dtype=np.int64))["new_voxels"]
distances, centers = map.query(points, k=2)
again: VoxelMap = VoxelMap.from_arrow(map.to_arrow(), lattice=lattice, datum=map.datum)
part: VoxelMap = map.crop((0, 0, 0), (1, 1, 1))
most: np.int32 = map.labels().max()
same: bool = map == again
pose = gicp(points, points, cell=0.1, num_neighbors=20).target_from_source
answer: Calibration = calibrate(map, points, profile="lidar")
