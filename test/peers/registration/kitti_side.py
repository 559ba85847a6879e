"""The peers' side of the KITTI comparison: reads what `lattice evaluate kitti` wrote, prints rows as in its kitti.json."""

import argparse
import json
import math
import pathlib
import sys
import time

import kiss_matcher
import numpy as np
import small_gicp

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
sys.dont_write_bytecode = True

import ply  # noqa: E402

NEIGHBORS = 20  # as many as ours take for a covariance
GATES_M = (1.0, 2.0)
VOXELS_M = (0.3, 0.5)


def error(pose, truth):
    """Metres between the translations, degrees between the rotations."""
    # |R_a - R_b| (Frobenius) = 2 sqrt(2) sin(angle / 2), which keeps its digits for small angles.
    sine = np.linalg.norm(pose[:3, :3] - truth[:3, :3]) / math.sqrt(8)
    return float(np.linalg.norm(pose[:3, 3] - truth[:3, 3])), math.degrees(2 * math.asin(min(1.0, sine)))


def prepare(points):
    """Tree and covariances, and the processor time they took, s."""
    begin = time.process_time()
    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud, 1)
    small_gicp.estimate_covariances(cloud, tree, NEIGHBORS, 1)
    return cloud, tree, time.process_time() - begin


def gicp(target, source, start, gate_m):
    return small_gicp.align(
        target[0],
        source[0],
        target[1],
        init_T_target_source=start,
        registration_type="GICP",
        max_correspondence_distance=gate_m,
        num_threads=1,
    ).T_target_source


def kiss(source, target, voxel_m, quatro):
    """Transform of KISS-Matcher and whether it holds it for valid."""
    config = kiss_matcher.KISSMatcherConfig(voxel_m, use_quatro=quatro)
    found = kiss_matcher.KISSMatcher(config).estimate(source, target)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = found.rotation, np.ravel(found.translation)
    return pose, bool(found.valid)


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
