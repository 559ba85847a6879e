"""Registration by small_gicp and KISS-Matcher, and how far a pose is from the truth."""

import math
import time

import kiss_matcher
import numpy as np
import small_gicp

NEIGHBORS = 20  # as many as ours take for a covariance


def error(pose, truth):
    """Metres between the translations, degrees between the rotations."""
    # |R_a - R_b| (Frobenius) = 2 sqrt(2) sin(angle / 2), which keeps its digits for small angles.
    sine = np.linalg.norm(pose[:3, :3] - truth[:3, :3]) / math.sqrt(8)
    return float(np.linalg.norm(pose[:3, 3] - truth[:3, 3])), math.degrees(2 * math.asin(min(1.0, sine)))


def prepare(points, threads=1, clock=time.process_time):
    """Tree and covariances, and the time they took, s."""
    begin = clock()
    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud, threads)
    small_gicp.estimate_covariances(cloud, tree, NEIGHBORS, threads)
    return cloud, tree, clock() - begin


def gicp(target, source, start, gate_m, threads=1):
    """Transform of small_gicp from a start."""
    return small_gicp.align(
        target[0],
        source[0],
        target[1],
        init_T_target_source=start,
        registration_type="GICP",
        max_correspondence_distance=gate_m,
        num_threads=threads,
    ).T_target_source


def kiss(source, target, voxel_m, quatro):
    """Transform of KISS-Matcher and whether it holds it for valid."""
    config = kiss_matcher.KISSMatcherConfig(voxel_m, use_quatro=quatro)
    found = kiss_matcher.KISSMatcher(config).estimate(source, target)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = found.rotation, np.ravel(found.translation)
    return pose, bool(found.valid)
