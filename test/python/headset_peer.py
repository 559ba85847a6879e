"""Peer of headset.rs: a headset with the axes of Unity that sends its mesh in chunks, labels and poses.

    headset_peer.py DIRECTORY     reads DIRECTORY/scenario.json, prints one line of JSON
"""

import faulthandler
import json
import sys
from pathlib import Path

import numpy as np
from cyclone_peer import PATIENCE_S, Peer, header, qos
import ros_idl as ros

WIDTH, HEIGHT, F = 160, 120, 140.0
CX, CY = (WIDTH - 1) / 2, (HEIGHT - 1) / 2
FRAME, SECOND_NS = "headset_origin", 10**9
# Numbers of an array in a chunk: 48 kB.
CHUNK = 12_000
CLOUD = {
    "names": ["x", "y", "z", "label", "confidence", "vp_x", "vp_y", "vp_z"],
    "formats": ["<f4", "<f4", "<f4", "<u2", "<f4", "<f4", "<f4", "<f4"],
    "offsets": [0, 4, 8, 12, 14, 18, 22, 26],
    "itemsize": 30,
}


def grid(z_m, side_m, cells):
    """Vertices and triangles of a square that looks back along z; clockwise from there, as Unity has it."""
    at = np.linspace(-side_m / 2, side_m / 2, cells + 1)
    x, y = np.meshgrid(at, -at)
    vertices = np.stack([x, y, np.full(x.shape, 0.0)], axis=2).reshape(-1, 3)
    first = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    right, below = first + 1, first + cells + 1
    triangles = np.stack([first, right, below + 1, first, below + 1, below], axis=1)
    pose = ros.Pose(ros.Point(0.0, 0.0, z_m), ros.Quaternion(0.0, 0.0, 0.0, 1.0))
    return pose, vertices.reshape(-1), triangles.reshape(-1)


def surface(session, name, stamp_ns, square, removed=False):
    """Its chunks."""
    pose, vertices, triangles = square
    chunks = -(-max(len(vertices), len(triangles)) // CHUNK)
    part = lambda numbers, i: numbers[i * CHUNK : (i + 1) * CHUNK].tolist()
    return [
        ros.HeadsetMesh(
            header(stamp_ns, FRAME), session, name, removed, i, chunks, pose,
            part(vertices, i), part(triangles, i), [],
        )
        for i in range(chunks)
    ]


class Headset:
    def __init__(self, domain):
        self.peer, self.clouds, self.names, self.sessions, self.tasks = Peer(domain), {}, [], [], {}
        peer, latched = self.peer, qos(1, latched=True)
        self.mesh = peer.writer("rt/headset/mesh", ros.HeadsetMesh, qos(100))
        self.labels = peer.writer("rt/headset/labels/image", ros.Image, qos(20))
        self.info = peer.writer("rt/headset/camera_info", ros.CameraInfo, qos(5))
        self.pose = peer.writer("rt/headset/pose", ros.PoseStamped, qos(100))
        self.label_info = peer.writer("rt/headset/labels/label_info", ros.LabelInfo, latched)
        peer.reader("rt/headset/points", ros.PointCloud2, qos(20), self.on_points)
        peer.reader("rt/headset/label_info", ros.LabelInfo, latched, self.on_names)
        peer.reader("rt/headset/session", ros.String, latched, lambda m: self.sessions.append(m.data))
        peer.reader("rt/diagnostics", ros.DiagnosticArray, qos(10), self.on_diagnostics)
        peer.until_matched()

    def on_points(self, cloud):
        self.clouds[cloud.header.stamp.sec * SECOND_NS + cloud.header.stamp.nanosec] = cloud

    def on_names(self, info):
        self.names = [[c.class_id, c.class_name] for c in info.class_map]

    def on_diagnostics(self, message):
        for status in message.status:
            self.tasks[status.name] = {v.key: v.value for v in status.values}

    def until(self, key, value):
        values = lambda: self.tasks.get("headset_cloud: clouds", {})
        self.peer.until(lambda: values().get(key) == str(value), lambda: f"{key} {value}: {values()}")

    def send(self, chunks):
        for chunk in chunks:
            self.mesh.write(chunk)

    def introduce(self):
        k = [F, 0.0, CX, 0.0, F, CY, 0.0, 0.0, 1.0]
        roi = ros.RegionOfInterest(0, 0, 0, 0, False)
        info = (HEIGHT, WIDTH, "plumb_bob", [0.0] * 5, k, [0.0] * 9, [0.0] * 12, 0, 0, roi)
        self.info.write(ros.CameraInfo(header(0, "camera"), *info))
        classes = [ros.VisionClass(i, n) for i, n in enumerate(["left", "right"])]
        self.label_info.write(ros.LabelInfo(header(0, "camera"), classes, 0.0))

    def stand(self, stamp_ns):
        pose = ros.Pose(ros.Point(0.0, 0.0, 0.0), ros.Quaternion(0.0, 0.0, 0.0, 1.0))
        self.pose.write(ros.PoseStamped(header(stamp_ns, FRAME), pose))

    def look(self, stamp_ns):
        numbers = np.zeros((HEIGHT, WIDTH), "u1")
        numbers[:, WIDTH // 2 :] = 1
        data = numbers.tobytes()
        image = ros.Image(header(stamp_ns, "camera"), HEIGHT, WIDTH, "mono8", False, WIDTH, data)
        self.labels.write(image)

    def seen(self, stamp_ns):
        """Points at each distance, and the farthest of a point from its ray and the labels that are wrong."""
        self.peer.until(
            lambda: stamp_ns in self.clouds,
            lambda: f"no cloud of {stamp_ns} among {sorted(self.clouds)}: {self.tasks}",
        )
        cloud = self.clouds[stamp_ns]
        rows = np.frombuffer(bytes(cloud.data), CLOUD)
        x, y, z = (rows[name].astype(float) for name in "xyz")
        column, row = CX - y / x * F, CY - z / x * F
        off_px = np.hypot(column - column.round(), row - row.round()).max()
        wrong = int((rows["label"] != (column > CX)).sum())
        far, counts = np.unique(np.round(x, 4), return_counts=True)
        found = {f"{m:g}": int(n) for m, n in zip(far, counts)}
        viewpoint_m = [float(np.abs(rows[name]).max()) for name in ("vp_x", "vp_y", "vp_z")]
        return {
            "frame": cloud.header.frame_id,
            "at_m": found,
            "off_px": off_px,
            "wrong": wrong,
            "viewpoint_m": viewpoint_m,
        }


def run(scenario):
    headset = Headset(scenario["domain"])
    headset.introduce()
    wall, shelf = grid(3.0, 8.0, 60), grid(2.0, 0.4, 2)
    stamp = lambda i: SECOND_NS + i * 100_000_000
    looks = []

    headset.send(surface("one", "wall", stamp(0), wall)[::-1])
    headset.send(surface("one", "shelf", stamp(0), shelf))
    headset.until("surfaces", 2)
    headset.stand(stamp(0))
    # The image comes before the pose behind it.
    headset.look(stamp(1))
    headset.stand(stamp(2))
    looks.append(headset.seen(stamp(1)))
    # The shelf is gone, and a surface that cannot be used changes nothing.
    headset.send(surface("one", "shelf", stamp(2), shelf, removed=True))
    broken = surface("one", "wall", stamp(2), grid(1.0, 8.0, 2))
    broken[0].triangles[3] = 9
    headset.send(broken)
    headset.until("mesh_indices", 1)
    headset.look(stamp(2))
    looks.append(headset.seen(stamp(2)))
    # Before all poses.
    headset.look(stamp(0) - 1)
    headset.until("labels_no_pose", 1)
    # Another session, and a surface of the one before.
    headset.send(surface("two", "wall", stamp(3), grid(4.0, 8.0, 60)))
    headset.send(surface("one", "shelf", stamp(4), shelf))
    headset.until("mesh_other_session", 1)
    headset.stand(stamp(4))
    headset.look(stamp(4))
    looks.append(headset.seen(stamp(4)))
    sessions = headset.sessions
    headset.peer.until(lambda: sessions[-1:] == ["two"], lambda: f"sessions {sessions}")
    return {"looks": looks, "names": headset.names, "chunks": len(surface("", "", 0, wall))}


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    directory = Path(sys.argv[1])
    scenario = json.loads((directory / "scenario.json").read_text())
    print(json.dumps(run(scenario)))


if __name__ == "__main__":
    main()
