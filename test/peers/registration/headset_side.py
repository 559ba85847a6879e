"""The peers' side of the headset comparison: reads the looks of `lattice evaluate calibration --write-looks`, prints rows."""

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
from peers import error, gicp, kiss, prepare  # noqa: E402

CELL_M = 0.05  # of the map
GATE_M = 0.5
VOXELS_M = (0.05, 0.1)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    rows = []
    for path in sorted(options.folder.glob("*.json")):
        truth = np.array(json.loads(path.read_text())["map_from_headset"])
        cloud, world = (ply.read(path.with_name(f"{path.stem}_{kind}.ply")) for kind in ("cloud", "map"))
        target = prepare(world, options.threads, time.perf_counter)

        def add(title, pose, seconds, verdict):
            metres, degrees = error(pose, truth)
            row = {"look": path.stem, "title": title, "translation_m": metres, "rotation_deg": degrees}
            rows.append(row | {"ms": 1e3 * seconds, "verdict": verdict})

        begin = time.perf_counter()
        source = prepare(small_gicp.voxelgrid_sampling(cloud, CELL_M).points()[:, :3], options.threads, time.perf_counter)
        prepared = time.perf_counter() - begin
        begin = time.perf_counter()
        pose = gicp(target, source, np.eye(4), GATE_M, options.threads)
        add(f"small_gicp GICP, {GATE_M:g} m, from the identity", pose, prepared + time.perf_counter() - begin, "OK")
        for quatro in (False, True):
            for voxel_m in VOXELS_M:
                begin = time.perf_counter()
                pose, valid = kiss(cloud.astype(np.float32), world.astype(np.float32), voxel_m, quatro)
                pose = gicp(target, source, pose, GATE_M, options.threads)
                seconds = prepared + time.perf_counter() - begin
                name = f"KISS-Matcher {voxel_m} m{', Quatro' if quatro else ''} + small_gicp GICP, {GATE_M:g} m"
                add(name, pose, seconds, "OK" if valid else "INVALID")
    # KISS-Matcher prints to the standard output too: the last line is ours.
    print("\n" + json.dumps(rows))


if __name__ == "__main__":
    main()
