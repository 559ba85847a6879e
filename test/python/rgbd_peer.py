"""Peer of rgbd.rs: a depth camera, a segmenter and tf, and who listens to clouds and map.

    rgbd_peer.py DIRECTORY     reads DIRECTORY/scenario.json, prints one line of JSON
"""

import faulthandler
import json
import sys
from pathlib import Path

import numpy as np
from cyclone_peer import PATIENCE_S, Peer, header, qos
import ros_idl as ros

WIDTH, HEIGHT, F, CX, CY = 160, 120, 140.0, 79.3, 60.8
D = [-0.12, 0.03, 0.002, -0.001, 0.0]
# Floor, wall and panel as n p + d = 0 in the optical frame, by label; the panel's half sizes.
PLANES = {1: (0, 1, 0, -1), 2: (0.2, 0, 1, -5), 3: (0, 0, 1, -2)}
PANEL_M = (0.5, 0.4)
FRAMES, NO_LABELS, NO_DEPTH, PERIOD_NS, APART_NS = 14, 4, 7, 33_000_000, 3_000_000
# Optical axes in those of the base (x forward, z up), a metre above it; the base in the map.
BASE_FROM_CAMERA = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]])
MAP_FROM_BASE = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 0], [0, 0, 0, 1]])
CLOUD = {
    "names": ["x", "y", "z", "label", "confidence"],
    "formats": ["<f4", "<f4", "<f4", "<u2", "<f4"],
    "offsets": [0, 4, 8, 12, 14],
    "itemsize": 18,
}


def distort(x, y):
    k1, k2, p1, p2, k3 = D
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def rays(shrink):
    """x / z and y / z of the pixels of an image so many times smaller, by repeated substitution."""
    at = lambda n: np.arange(n // shrink) * shrink + (shrink - 1) / 2
    column, row = np.meshgrid(at(WIDTH), at(HEIGHT))
    seen = (column - CX) / F, (row - CY) / F
    x, y = seen
    for _ in range(100):
        bent = distort(x, y)
        x, y = x + seen[0] - bent[0], y + seen[1] - bent[1]
    return x, y


def look(x, y):
    """Depths and labels of rays."""
    far = np.full(x.shape, np.inf)
    depth = {label: -d / (a * x + b * y + c + 1e-30) for label, (a, b, c, d) in PLANES.items()}
    depth[1] = np.where(y > 0, depth[1], far)
    is_panel = (abs(2 * x) < PANEL_M[0]) & (abs(2 * y) < PANEL_M[1])
    depth[3] = np.where(is_panel, depth[3], far)
    all_of_them = np.stack([depth[label] for label in sorted(depth)])
    return all_of_them.min(axis=0), all_of_them.argmin(axis=0) + 1


def image(stamp_ns, encoding, numbers, big=False, padding=0):
    kind = {"32FC1": "f4", "16UC1": "u2", "mono16": "u2", "mono8": "u1", "32SC1": "i4"}[encoding]
    numbers = numbers.astype((">" if big else "<") + kind)
    rows = [row.tobytes() + b"\xa5" * padding for row in numbers]
    height, width = numbers.shape
    data = b"".join(rows)
    return ros.Image(header(stamp_ns, "camera"), height, width, encoding, big, len(rows[0]), data)


def transform(parent, child, matrix, rotation, stamp_ns):
    place = ros.Vector3(*map(float, matrix[:3, 3]))
    return ros.TransformStamped(
        header(stamp_ns, parent), child, ros.Transform(place, ros.Quaternion(*rotation))
    )


class Camera:
    def __init__(self, domain):
        self.peer, self.clouds, self.names, self.tasks, self.centers = Peer(domain), {}, [], {}, None
        peer, latched = self.peer, qos(1, latched=True)
        self.depth = peer.writer("rt/depth_registered/image_rect", ros.Image, qos(20))
        self.labels = peer.writer("rt/labels/image", ros.Image, qos(20))
        self.info = peer.writer("rt/rgb/camera_info", ros.CameraInfo, qos(5))
        self.label_info = peer.writer("rt/labels/label_info", ros.LabelInfo, latched)
        self.tf = peer.writer("rt/tf", ros.TFMessage, qos(100))
        self.tf_static = peer.writer("rt/tf_static", ros.TFMessage, latched)
        peer.reader("rt/points", ros.PointCloud2, qos(20), self.on_points)
        peer.reader("rt/label_info", ros.LabelInfo, latched, self.on_names)
        peer.reader("rt/map_centers", ros.PointCloud2, latched, self.on_centers)
        peer.reader("rt/diagnostics", ros.DiagnosticArray, qos(10), self.on_diagnostics)
        peer.until_matched()

    def on_points(self, cloud):
        stamp_ns = cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec
        self.clouds[stamp_ns] = cloud

    def on_names(self, info):
        self.names = [[c.class_id, c.class_name] for c in info.class_map]

    def on_centers(self, cloud):
        self.centers = cloud

    def on_diagnostics(self, message):
        for status in message.status:
            self.tasks[status.name] = {v.key: v.value for v in status.values}

    def value(self, task, key):
        return self.tasks.get(task, {}).get(key)

    def until_cloud(self, stamp_ns):
        self.peer.until(
            lambda: stamp_ns in self.clouds,
            lambda: f"no cloud of {stamp_ns} among {sorted(self.clouds)}: {self.tasks}",
        )

    def introduce(self, start_ns):
        k = [F, 0.0, CX, 0.0, F, CY, 0.0, 0.0, 1.0]
        roi = ros.RegionOfInterest(0, 0, 0, 0, False)
        info = (HEIGHT, WIDTH, "plumb_bob", D, k, [0.0] * 9, [0.0] * 12, 0, 0, roi)
        self.info.write(ros.CameraInfo(header(start_ns, "camera"), *info))
        classes = [ros.VisionClass(i, n) for i, n in enumerate(["void", "floor", "wall", "panel"])]
        self.label_info.write(ros.LabelInfo(header(0, "camera"), classes, 0.0))
        mount = transform("base_link", "camera", BASE_FROM_CAMERA, (-0.5, 0.5, -0.5, 0.5), 0)
        self.tf_static.write(ros.TFMessage([mount]))

    def stand(self, stamp_ns):
        half = 0.5**0.5
        odom = transform("map", "odom", MAP_FROM_BASE, (0.0, 0.0, half, half), stamp_ns)
        base = transform("odom", "base_link", np.eye(4), (0.0, 0.0, 0.0, 1.0), stamp_ns)
        self.tf.write(ros.TFMessage([odom, base]))


def check(cloud, truth_m, labels):
    """Largest error of points beyond 1 mm and 0.1 %, wrong labels, and points."""
    points = np.frombuffer(bytes(cloud.data), CLOUD)
    place_m = np.stack([points[axis] for axis in "xyz"], axis=1).astype(float)
    x, y = distort(place_m[:, 0] / place_m[:, 2], place_m[:, 1] / place_m[:, 2])
    column = np.rint(x * F + CX).astype(int)
    row = np.rint(y * F + CY).astype(int)
    off_m = np.linalg.norm(place_m - truth_m[row, column], axis=1)
    excess_m = off_m - 1e-3 - 1e-3 * np.linalg.norm(place_m, axis=1)
    shrink = HEIGHT // labels.shape[0]
    wrong = points["label"] != labels[row // shrink, column // shrink]
    return float(excess_m.max()), int(wrong.sum()), len(points)


def run(scenario):
    camera = Camera(scenario["domain"])
    start_ns = 1_700_000_000 * 10**9
    camera.introduce(start_ns)
    camera.peer.until(lambda: len(camera.names) > 0, lambda: "no label_info")
    x, y = rays(1)
    depth_m, labels = look(x, y)
    truth_m = np.stack([x, y, np.ones_like(x)], axis=2) * depth_m[..., None]
    labels = {1: labels, 2: look(*rays(2))[1]}
    stamp = lambda i: start_ns + i * PERIOD_NS
    for i in range(-1, FRAMES + 3):
        camera.stand(stamp(i))
    # Rows that are cut off: refused, and nothing that follows is.
    broken = image(stamp(0) - 1, "32FC1", depth_m)
    broken.data = broken.data[:1000]
    camera.depth.write(broken)
    expected, used = [], {}
    for i in range(FRAMES + 2):
        if i < FRAMES and i != NO_DEPTH:
            millimetres, big = i % 2 == 1, i % 3 == 0
            encoding, unit = ("16UC1", 1e3) if millimetres else ("32FC1", 1)
            numbers = np.rint(depth_m * unit) if millimetres else depth_m
            camera.depth.write(image(stamp(i), encoding, numbers, big, padding=i))
        # Labels are two frames late and those of each two come the wrong way round.
        j = (i - 2) ^ 1
        if i < 2 or j == NO_LABELS:
            continue
        used[j] = labels[1 + j // 2 % 2]
        encoding = ["mono8", "mono16", "16UC1", "32SC1"][j % 4]
        encoding = encoding.replace("16UC1", "mono16")
        # No depth comes after the last, which could have been nearer.
        labels_ns = stamp(j) + (APART_NS if j < FRAMES - 1 else 0)
        camera.labels.write(image(labels_ns, encoding, used[j], big=j % 2 == 0, padding=j))
        if j != NO_DEPTH:
            camera.until_cloud(stamp(j))
            expected.append(j)
    found = [check(camera.clouds[stamp(j)], truth_m, used[j]) for j in expected]
    points = sum(n for _, _, n in found)
    camera.peer.until(
        lambda: camera.value("lattice_mapper: map", "points_mapped") == str(points)
        and camera.centers is not None
        and camera.value("lattice_mapper: map", "voxels") == str(camera.centers.width),
        lambda: f"{points} points: {camera.tasks}, {camera.centers and camera.centers.width}",
    )
    # Diagnostics come twice a second.
    refused = lambda: camera.value("semantic_cloud: clouds", "last_refused")
    camera.peer.until(refused, lambda: f"nothing refused: {camera.tasks}")
    return {
        "clouds": len(camera.clouds),
        "expected": len(expected),
        "excess_m": max(e for e, _, _ in found),
        "wrong_labels": sum(w for _, w, _ in found),
        "fewest_points": min(n for _, _, n in found),
        "names": camera.names,
        "frame": camera.clouds[stamp(0)].header.frame_id,
        "centers": centers(camera.centers),
        "refused": refused(),
    }


def centers(cloud):
    """Frame, voxels of each label, and the farthest of a centre from the plane of its label, m."""
    offsets = {f.name: f.offset for f in cloud.fields}
    kind = {
        "names": ["x", "y", "z", "label"],
        "formats": ["<f4", "<f4", "<f4", "<u2"],
        "offsets": [offsets[name] for name in ["x", "y", "z", "label"]],
        "itemsize": cloud.point_step,
    }
    rows = np.frombuffer(bytes(cloud.data), kind)
    place_m = np.stack([rows["x"], rows["y"], rows["z"], np.ones(len(rows))]).astype(float)
    in_camera = np.linalg.inv(MAP_FROM_BASE @ BASE_FROM_CAMERA) @ place_m
    planes = np.array([PLANES[label] for label in rows["label"]], float)
    off_m = abs((planes.T * in_camera).sum(axis=0)) / np.linalg.norm(planes[:, :3], axis=1)
    voxels = {int(label): int((rows["label"] == label).sum()) for label in set(rows["label"])}
    return {"frame": cloud.header.frame_id, "voxels": voxels, "farthest_m": float(off_m.max())}


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    directory = Path(sys.argv[1])
    scenario = json.loads((directory / "scenario.json").read_text())
    print(json.dumps(run(scenario)))


if __name__ == "__main__":
    main()
