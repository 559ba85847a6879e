"""Peer of segmenter.rs: a camera that sends images and reads their labels.

    segmenter_peer.py DIRECTORY     reads DIRECTORY/scenario.json, prints one line of JSON
"""

import faulthandler
import json
import sys
from pathlib import Path

import numpy as np
from cyclone_peer import PATIENCE_S, Peer, header, qos
import ros_idl as ros

WIDTH, HEIGHT, SECOND_NS = 160, 120, 10**9
ENCODINGS = ["rgb8", "bgr8", "rgba8", "bgra8"] * 2


def stamp_of(message):
    return message.header.stamp.sec * SECOND_NS + message.header.stamp.nanosec


class Camera:
    def __init__(self, domain, jpeg=None):
        self.peer, self.tasks, self.labels, self.confidence, self.names = Peer(domain), {}, {}, {}, []
        self.greetings, self.jpeg = 0, jpeg and Path(jpeg).read_bytes()
        peer = self.peer
        topic = "rt/rgb/image_rect_color"
        if jpeg:
            self.images = peer.writer(f"{topic}/compressed", ros.CompressedImage, qos(20))
        else:
            self.images = peer.writer(topic, ros.Image, qos(20))
        keep = lambda kept: lambda m: kept.update({stamp_of(m): m})
        peer.reader("rt/labels/image", ros.Image, qos(20), keep(self.labels))
        peer.reader("rt/labels/confidence", ros.Image, qos(20), keep(self.confidence))
        peer.reader("rt/labels/label_info", ros.LabelInfo, qos(1, latched=True), self.on_names)
        peer.reader("rt/diagnostics", ros.DiagnosticArray, qos(10), self.on_diagnostics)
        peer.until_matched()

    def on_names(self, info):
        self.names = [[c.class_id, c.class_name] for c in info.class_map]

    def on_diagnostics(self, message):
        for status in message.status:
            self.tasks[status.name] = {v.key: v.value for v in status.values}
        # The node may not know the readers yet when they know it.
        if not (self.labels and self.confidence):
            if self.jpeg:
                self.pack(self.greetings, self.jpeg)
            else:
                self.send(self.greetings, "mono8", bytes(WIDTH * HEIGHT), WIDTH)
            self.greetings += 1

    def greet(self):
        self.peer.until(
            lambda: self.labels and self.confidence,
            lambda: f"no labels of {self.greetings} greetings: {self.tasks}",
        )
        self.until("images_in", self.greetings)

    def until(self, key, value):
        values = lambda: self.tasks.get("segmenter: labels", {})
        self.peer.until(lambda: values().get(key) == str(value), lambda: f"{key} {value}: {values()}")

    def send(self, stamp_ns, encoding, data, step):
        self.images.write(
            ros.Image(header(stamp_ns, "camera"), HEIGHT, WIDTH, encoding, False, step, data)
        )

    def pack(self, stamp_ns, data):
        self.images.write(ros.CompressedImage(header(stamp_ns, "camera"), "rgb8; jpeg compressed bgr8", data))

    def until_labelled(self, stamp_ns):
        there = lambda: stamp_ns in self.labels and stamp_ns in self.confidence
        self.peer.until(there, lambda: f"no labels of {stamp_ns}: {self.tasks}")
        found = self.labels[stamp_ns]
        return found, np.frombuffer(bytes(found.data), "u1").reshape(found.height, found.width)

    def look(self, stamp_ns, encoding, edge):
        """Sends an image that is red to the left of a column; the share of right pixels, and how sure."""
        pixels = np.zeros((HEIGHT, WIDTH, 4), "u1")
        pixels[:, :, 1] = 200
        pixels[:, :edge, :2] = (255, 0)
        order = {"r": 0, "g": 1, "b": 2, "a": 3}
        channels = [order[letter] for letter in encoding if letter in order]
        data = np.ascontiguousarray(pixels[:, :, channels]).tobytes()
        self.send(stamp_ns, encoding, data, WIDTH * len(channels))
        found, classes = self.until_labelled(stamp_ns)
        sure = self.confidence[stamp_ns]
        expected = np.arange(found.width) < edge * found.width / WIDTH
        return {
            "encoding": found.encoding,
            "frame": found.header.frame_id,
            "size": [found.width, found.height],
            "wrong": int((classes != expected).sum()),
            "sure": int(np.median(np.frombuffer(bytes(sure.data), "u1"))),
        }


def run(scenario):
    camera = Camera(scenario["domain"])
    camera.greet()
    stamp = lambda i: SECOND_NS + i * 100_000_000
    looks = [camera.look(stamp(i), e, 20 + 10 * i) for i, e in enumerate(ENCODINGS)]
    camera.send(stamp(20), "rgb8", bytes(1000), 3 * WIDTH)
    camera.until("malformed", 1)
    camera.send(stamp(21), "bayer_rggb8", bytes(WIDTH * HEIGHT), WIDTH)
    camera.until("encoding", 1)
    looks.append(camera.look(stamp(22), "rgb8", 100))
    refused = camera.tasks["segmenter: labels"]["last_refused"]
    return {"greetings": camera.greetings, "looks": looks, "names": camera.names, "refused": refused}


def run_packed(scenario):
    """JPEG files, whole and cut; shares of red in the left and the right half."""
    camera = Camera(scenario["domain"], scenario["jpeg"])
    camera.greet()
    camera.pack(SECOND_NS, camera.jpeg[:200])
    camera.until("malformed", 1)
    camera.pack(SECOND_NS, b"\x89PNG")
    camera.until("encoding", 1)
    camera.pack(2 * SECOND_NS, camera.jpeg)
    _, classes = camera.until_labelled(2 * SECOND_NS)
    halves = np.split(classes, 2, axis=1)
    refused = camera.tasks["segmenter: labels"]["last_refused"]
    return {"red": [float(half.mean()) for half in halves], "refused": refused}


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    directory = Path(sys.argv[1])
    scenario = json.loads((directory / "scenario.json").read_text())
    print(json.dumps(run_packed(scenario) if "jpeg" in scenario else run(scenario)))


if __name__ == "__main__":
    main()
