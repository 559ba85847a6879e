"""The peers' side of the KITTI comparison: reads what `lattice evaluate kitti` wrote, prints rows as in its kitti.json."""

import argparse
import json
import pathlib
import sys
import time

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
sys.dont_write_bytecode = True

import ply  # noqa: E402
from peers import error, gicp, kiss, prepare  # noqa: E402

GATES_M = (1.0, 2.0)
VOXELS_M = (0.3, 0.5)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=pathlib.Path)
    folder = parser.parse_args().folder
    report = json.loads((folder / "kitti.json").read_text())
    numbers = range(len(report["scans"]))
    whole = [ply.read(folder / f"scan_{number}.ply").astype(np.float32) for number in numbers]
    prepared = [prepare(ply.read(folder / f"thinned_{number}.ply")) for number in numbers]

    rows = []
    for pair in report["pairs"]:
        source, target = prepared[pair["source"]], prepared[pair["target"]]
        truth = np.array(pair["target_from_source"])

        def add(method, title, start, pose, seconds, verdict=None):
            metres, degrees = error(pose, truth)
            row = {"method": method, "title": title, "start": start, "source": pair["source"], "target": pair["target"]}
            row |= {"translation_m": metres, "rotation_deg": degrees}
            row["right"] = metres <= report["right_m"] and degrees <= report["right_deg"]
            row |= {"prepare_ms": 1e3 * (source[2] + target[2]), "register_ms": 1e3 * seconds}
            rows.append(row | ({"verdict": verdict} if verdict else {}))

        for gate_m in GATES_M:
            for start, pose in (("heading", np.array(pair["start"])), ("none", np.eye(4))):
                begin = time.process_time()
                found = gicp(target, source, pose, gate_m)
                seconds = time.process_time() - begin
                add(f"small_gicp_{gate_m:g}", f"small_gicp GICP, {gate_m:g} m", start, found, seconds)
        for quatro in (False, True):
            for voxel_m in VOXELS_M:
                begin = time.process_time()
                pose, valid = kiss(whole[pair["source"]], whole[pair["target"]], voxel_m, quatro)
                seconds = time.process_time() - begin
                verdict = "OK" if valid else "INVALID"
                name = f"KISS-Matcher {voxel_m} m{', Quatro' if quatro else ''}"
                key = f"kiss_{voxel_m}{'_quatro' if quatro else ''}"
                add(key, name, "none", pose, seconds, verdict)
                begin = time.process_time()
                found = gicp(target, source, pose, GATES_M[0])
                seconds += time.process_time() - begin
                add(f"{key}_gicp", f"{name} + small_gicp GICP, {GATES_M[0]:g} m", "none", found, seconds, verdict)
    # KISS-Matcher prints to the standard output too: the last line is ours.
    print("\n" + json.dumps(rows))


if __name__ == "__main__":
    main()
