"""Peer of segmenter.rs: a depth camera and a headset whose nodes label images of colours themselves.

    onnx_inside_peer.py DIRECTORY     reads DIRECTORY/scenario.json, prints one line of JSON
"""

import faulthandler
import json
import sys
from pathlib import Path

import numpy as np
from cyclone_peer import PATIENCE_S, Peer, header, qos
from headset_peer import FRAME, grid, surface
import ros_idl as ros

WIDTH, HEIGHT, SECOND_NS = 160, 120, 10**9
# The picture of the headset: red to the left, blue to the right.
JPEG_WIDTH, JPEG_HEIGHT = 16, 8


def camera_info(width, height):
    f = 0.9 * width
    k = [f, 0.0, (width - 1) / 2, 0.0, f, (height - 1) / 2, 0.0, 0.0, 1.0]
    roi = ros.RegionOfInterest(0, 0, 0, 0, False)
    info = (height, width, "plumb_bob", [0.0] * 5, k, [0.0] * 9, [0.0] * 12, 0, 0, roi)
    return ros.CameraInfo(header(0, "camera"), *info)


def stamp_of(message):
    return message.header.stamp.sec * SECOND_NS + message.header.stamp.nanosec


class Node:
    """What a node says on its diagnostics and in its clouds."""

    def __init__(self, domain, name, points, label_info):
        self.peer, self.name, self.tasks, self.clouds, self.names = Peer(domain), name, {}, {}, []
        keep = lambda cloud: self.clouds.update({stamp_of(cloud): cloud})
        self.peer.reader(points, ros.PointCloud2, qos(20), keep)
        self.peer.reader(label_info, ros.LabelInfo, qos(1, latched=True), self.on_names)
        self.peer.reader("rt/diagnostics", ros.DiagnosticArray, qos(10), self.on_diagnostics)

    def on_names(self, info):
        self.names = [[c.class_id, c.class_name] for c in info.class_map]

    def on_diagnostics(self, message):
        for status in message.status:
            self.tasks[status.name] = {v.key: v.value for v in status.values}

    def until(self, task, key, value):
        values = lambda: self.tasks.get(f"{self.name}: {task}", {})
        self.peer.until(lambda: values().get(key) == str(value), lambda: f"{key} {value}: {self.tasks}")
        return values()

    def cloud(self, stamp_ns, again):
        """The cloud of a time; `again` sends what makes it, as the node may not know all yet."""
        known = {"tasks": len(self.tasks)}

        def there():
            # Diagnostics come twice a second.
            if stamp_ns not in self.clouds and self.tasks and known.get("seen") != str(self.tasks):
                known["seen"] = str(self.tasks)
                again()
            return stamp_ns in self.clouds

        self.peer.until(there, lambda: f"no cloud of {stamp_ns} among {sorted(self.clouds)}: {self.tasks}")
        return self.clouds[stamp_ns]


def columns(cloud):
    """Fields of a cloud by name; lists have a second axis."""
    kinds = {7: "<f4", 4: "<u2"}
    kind = {
        "names": [f.name for f in cloud.fields],
        "formats": [(kinds[f.datatype], (f.count,)) if f.count > 1 else kinds[f.datatype] for f in cloud.fields],
        "offsets": [f.offset for f in cloud.fields],
        "itemsize": cloud.point_step,
    }
    return np.frombuffer(bytes(cloud.data), kind)


def summary(cloud, is_red):
    """Fields, and how labels, colours and probabilities fit the columns that should be red."""
    rows = columns(cloud)
    packed = rows["rgb"].copy().view("u4")
    probs = rows["label_probs"]
    return {
        "fields": [f.name for f in cloud.fields],
        "points": len(rows),
        "wrong": int((rows["label"] != is_red(rows)).sum()),
        "wrong_color": int(((packed >> 16 & 255 > 128) != is_red(rows)).sum()),
        "wrong_probs": int((probs.argmax(axis=1) != rows["label"]).sum()),
        "far_from_one": float(abs(probs.sum(axis=1) - 1).max()),
    }


def depth_camera(domain):
    node = Node(domain, "semantic_cloud", "rt/points", "rt/label_info")
    peer, labels, told = node.peer, {}, []
    depth = peer.writer("rt/depth_registered/image_rect", ros.Image, qos(20))
    color = peer.writer("rt/rgb/image_rect_color", ros.Image, qos(20))
    info = peer.writer("rt/rgb/camera_info", ros.CameraInfo, qos(5))
    peer.reader("rt/labels/image", ros.Image, qos(20), lambda m: labels.update({stamp_of(m): m}))
    names = lambda m: told.append([[c.class_id, c.class_name] for c in m.class_map])
    peer.reader("rt/labels/label_info", ros.LabelInfo, qos(1, latched=True), names)
    peer.until_matched()
    info.write(camera_info(WIDTH, HEIGHT))
    pixels = np.zeros((HEIGHT, WIDTH, 3), "u1")
    pixels[:, :, 1] = 200
    pixels[:, : WIDTH // 4] = (255, 0, 0)
    metres = np.full((HEIGHT, WIDTH), 2, "f4")
    image = lambda stamp_ns, data: ros.Image(
        header(stamp_ns, "camera"), HEIGHT, WIDTH, "rgb8", False, 3 * WIDTH, data)

    def send(stamp_ns):
        data = metres.tobytes()
        depth.write(ros.Image(header(stamp_ns, "camera"), HEIGHT, WIDTH, "32FC1", False, 4 * WIDTH, data))
        color.write(image(stamp_ns, pixels.tobytes()))

    column = lambda rows: rows["x"] / rows["z"] * 0.9 * WIDTH + (WIDTH - 1) / 2
    found = summary(
        node.cloud(SECOND_NS, lambda: send(SECOND_NS)), lambda rows: column(rows) < WIDTH / 4 - 0.5)
    # Cut: refused by name, and the next is labelled.
    color.write(image(2 * SECOND_NS, pixels.tobytes()[:1000]))
    refused = node.until("network", "malformed", 1)["last_refused"]
    later = node.cloud(3 * SECOND_NS, lambda: send(3 * SECOND_NS))
    peer.until(lambda: told and labels, lambda: f"labels {sorted(labels)}, names {told}")
    mask = labels[max(labels)]
    return found | {
        "names": node.names, "told": told[-1], "refused": refused, "later": later.width,
        "mask": [mask.encoding, mask.width, mask.height, mask.header.frame_id],
    }


def headset(domain, jpeg):
    node = Node(domain, "headset_cloud", "rt/headset/points", "rt/headset/label_info")
    peer = node.peer
    mesh = peer.writer("rt/headset/mesh", ros.HeadsetMesh, qos(100))
    color = peer.writer("rt/headset/image/compressed", ros.CompressedImage, qos(20))
    info = peer.writer("rt/headset/camera_info", ros.CameraInfo, qos(5))
    pose = peer.writer("rt/headset/pose", ros.PoseStamped, qos(100))
    peer.until_matched()
    info.write(camera_info(JPEG_WIDTH, JPEG_HEIGHT))
    for chunk in surface("one", "wall", SECOND_NS, grid(3.0, 8.0, 20)):
        mesh.write(chunk)
    node.until("clouds", "surfaces", 1)
    here = ros.Pose(ros.Point(0.0, 0.0, 0.0), ros.Quaternion(0.0, 0.0, 0.0, 1.0))
    for i in range(10, 14):
        pose.write(ros.PoseStamped(header(i * SECOND_NS // 10, FRAME), here))

    def send(data):
        color.write(ros.CompressedImage(header(12 * SECOND_NS // 10, "camera"), "rgb8; jpeg compressed bgr8", data))

    send(jpeg[:200])
    refused = node.until("network", "malformed", 1)["last_refused"]
    cloud = node.cloud(12 * SECOND_NS // 10, lambda: send(jpeg))
    # Left is +y in the axes of ROS.
    return summary(cloud, lambda rows: rows["y"] > 0) | {"names": node.names, "refused": refused}


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    directory = Path(sys.argv[1])
    scenario = json.loads((directory / "scenario.json").read_text())
    found = {"depth_camera": depth_camera(scenario["domain"])}
    found["headset"] = headset(scenario["domain"], Path(scenario["jpeg"]).read_bytes())
    print(json.dumps(found))


if __name__ == "__main__":
    main()
