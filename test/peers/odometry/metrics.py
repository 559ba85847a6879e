"""Errors of a trajectory as `lattice evaluate odometry` measures them: since the first pose, and over segments of 10 m."""

import numpy as np

SEGMENT_M = 10.0


def read_tum(path):
    """Times in ns, and 4 x 4 poses."""
    lines = [line.split() for line in path.read_text().splitlines() if line and not line.startswith("#")]
    seconds, ns = zip(*(line[0].split(".") for line in lines))
    times = np.array(seconds, np.int64) * 10**9 + np.array([part.ljust(9, "0") for part in ns], np.int64)
    numbers = np.array([line[1:] for line in lines], float)
    return times, np.array([matrix(row[:3], row[3:]) for row in numbers])


def matrix(place, quaternion):
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = place
    return pose


def quaternion(rotation):
    """x, y, z, w: the eigenvector of the largest eigenvalue (Bar-Itzhack 2000)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    k = np.array([
        [a - e - i, d + b, g + c, h - f],
        [d + b, e - a - i, h + f, c - g],
        [g + c, h + f, i - a - e, d - b],
        [h - f, c - g, d - b, a + e + i],
    ])
    return np.linalg.eigh(k)[1][:, -1]


def write_tum(path, times, poses):
    rows = [(time, *pose[:3, 3], *quaternion(pose[:3, :3])) for time, pose in zip(times, poses)]
    text = "".join(f"{t // 10**9}.{t % 10**9:09d} " + " ".join(f"{v:.9f}" for v in row) + "\n" for t, *row in rows)
    path.write_text(text)


def exp(twist):
    """The rigid transforms of twists (n x 6: velocity, rate), by Rodrigues' formula."""
    rate = twist[:, 3:]
    angle = np.linalg.norm(rate, axis=1)
    near = angle < 1e-9
    safe = np.where(near, 1.0, angle)
    a = np.where(near, 1.0, np.sin(safe) / safe)[:, None, None]
    b = np.where(near, 0.5, (1 - np.cos(safe)) / safe**2)[:, None, None]
    c = np.where(near, 1 / 6, (safe - np.sin(safe)) / safe**3)[:, None, None]
    x, y, z = rate.T
    zero = np.zeros_like(x)
    k = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    poses = np.tile(np.eye(4), (len(twist), 1, 1))
    poses[:, :3, :3] += a * k + b * (k @ k)
    poses[:, :3, 3] = ((np.eye(3) + b * k + c * (k @ k)) @ twist[:, :3, None])[:, :, 0]
    return poses


def log(pose):
    """The twist of a rigid transform that turns by less than half a turn."""
    x, y, z, w = quaternion(pose[:3, :3])
    vector = np.array([x, y, z]) * (1 if w >= 0 else -1)
    norm = np.linalg.norm(vector)
    rate = vector * (2.0 if norm < 1e-12 else 2 * np.arctan2(norm, abs(w)) / norm)
    left = exp(np.array([[1, 0, 0, *rate], [0, 1, 0, *rate], [0, 0, 1, *rate]]))[:, :3, 3].T
    return np.concatenate([np.linalg.solve(left, pose[:3, 3]), rate])


def at(times, poses, wanted):
    """Poses between those of a trajectory, of which no two are far apart."""
    after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    found = []
    for i, time in zip(after, wanted):
        part = (time - times[i - 1]) / (times[i] - times[i - 1])
        step = log(np.linalg.inv(poses[i - 1]) @ poses[i])
        found.append(poses[i - 1] @ exp(part * step[None])[0])
    return np.array(found)


def errors(found, truth):
    """ATE (m), RPE (%) and the largest error (m) of poses since the first."""
    found = np.linalg.inv(found[0]) @ found
    truth = np.linalg.inv(truth[0]) @ truth
    off = np.linalg.norm(found[:, :3, 3] - truth[:, :3, 3], axis=1)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1))])
    segments = []
    for i, j in enumerate(np.searchsorted(length, length + SEGMENT_M)):
        if j < len(found):
            moved = [(np.linalg.inv(poses[i]) @ poses[j])[:3, 3] for poses in (found, truth)]
            segments.append(np.linalg.norm(moved[0] - moved[1]))
    return {
        "ate_m": float(np.sqrt(np.mean(off**2))),
        "rpe_percent": float(100 * np.mean(segments) / SEGMENT_M) if segments else None,
        "largest_m": float(off.max()),
    }
