"""Peer of dds_cyclone.rs: a CycloneDDS participant that knows of Lattice only the ROS messages.

    dds_peer.py map|graph|endpoints DIRECTORY     reads DIRECTORY/scenario.json, prints a line of JSON
"""

import faulthandler
import json
import sys
import time
from pathlib import Path

import numpy
# First: it sets what Cyclone reads when it is loaded.
from cyclone_peer import FLOAT32, PATIENCE_S, Peer, header, qos
import ros_idl as ros
from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.qos import Policy
from cyclonedds.util import duration
from lattice_by_search import Expected, decode_keys, exposed_faces, fcc, keys_of, nearest

# Poses that are sent until the first transform is heard, at most.
MOST_AHEAD = 100
TRIANGLE_LIST, ADD, DELETE, DELETEALL = 11, 0, 2, 3


def odometry(row):
    stamp_ns, x, y, z, qx, qy, qz, qw = row
    zero = ros.Vector3(0, 0, 0)
    pose = ros.Pose(ros.Point(x, y, z), ros.Quaternion(qx, qy, qz, qw))
    return ros.Odometry(
        header(stamp_ns, "map"),
        "base_link",
        ros.PoseWithCovariance(pose, [0.0] * 36),
        ros.TwistWithCovariance(ros.Twist(zero, zero), [0.0] * 36),
    )


def cloud(stamp_ns, data):
    names = ["x", "y", "z", "intensity"]
    fields = [ros.PointField(name, 4 * i, FLOAT32, 1) for i, name in enumerate(names)]
    length = len(data)
    return ros.PointCloud2(
        header(stamp_ns, "base_link"), 1, length // 16, fields, False, 16, length, data, False
    )


def in_map(row, data):
    """Finite points of a cloud, moved by the pose of a row; as float32, as they are sent on."""
    points = numpy.frombuffer(data, dtype="<f4").reshape(-1, 4)[:, :3].astype(float)
    points = points[numpy.isfinite(points).all(axis=1)]
    _, x, y, z, i, j, k, w = row
    rotation = numpy.array([
        [1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)],
        [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)],
        [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)],
    ])  # fmt: skip
    return (points @ rotation.T + [x, y, z]).astype(numpy.float32).astype(float)


class Centers:
    """The newest `map_centers` as key -> count."""

    def __init__(self, generator):
        self.generator = generator
        self.voxels, self.off_lattice_m, self.frame = {}, 0.0, None

    def __call__(self, message):
        names = [(field.name, field.offset, field.datatype) for field in message.fields]
        assert names == [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7)], names
        assert len(message.data) == 16 * message.width * message.height
        values = numpy.frombuffer(bytes(message.data), dtype="<f4").reshape(-1, 4).astype(float)
        indices = numpy.rint(numpy.linalg.solve(self.generator, values[:, :3].T).T)
        off = numpy.abs(indices @ self.generator.T - values[:, :3])
        self.off_lattice_m = float(off.max(initial=0))
        counts = values[:, 3].astype(int).tolist()
        self.voxels = dict(zip(keys_of(indices).tolist(), counts))
        assert len(self.voxels) == message.width, "a voxel is there twice"
        self.frame = message.header.frame_id


class Markers:
    """The scene that `voxel_markers` leave in a viewer."""

    def __init__(self):
        self.scene, self.kinds = {}, set()

    def __call__(self, message):
        for marker in message.markers:
            name = (marker.ns, marker.id)
            if marker.action == ADD:
                self.kinds.add((marker.header.frame_id, marker.type))
                assert len(marker.points) % 3 == 0, f"{name}: {len(marker.points)} points"
                assert len(marker.colors) in (0, len(marker.points))
                at, turn = marker.pose.position, marker.pose.orientation
                assert turn == ros.Quaternion(0, 0, 0, 1), turn
                points = [(at.x + p.x, at.y + p.y, at.z + p.z) for p in marker.points]
                self.scene[name] = points
            elif marker.action == DELETE:
                self.scene.pop(name, None)
            else:
                assert marker.action == DELETEALL, marker.action
                self.scene.clear()

    def triangles(self):
        return sum(map(len, self.scene.values())) // 3

    def wrong_triangles(self, generator, keys):
        """How many have not an occupied cell just inside and an empty one just outside."""
        points = numpy.concatenate([numpy.array(p) for p in self.scene.values() if p])
        corners = points.reshape(-1, 3, 3)
        centers = corners.mean(axis=1)
        normals = numpy.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals *= 1e-3 / numpy.linalg.norm(normals, axis=1, keepdims=True)
        inside, outside = (nearest(generator, centers + s * normals)[0] for s in (-1, 1))
        good = numpy.isin(keys_of(inside), keys) & ~numpy.isin(keys_of(outside), keys)
        return int((~good).sum())


class Map:
    """Chunks of `voxel_map`, by the state that they belong to."""

    def __init__(self):
        self.states, self.newest_ns = {}, 0

    def __call__(self, message):
        self.newest_ns = max(self.newest_ns, message.sample_info.source_timestamp)
        assert message.key_encoding == "morton21_delta_leb128"
        assert len(message.counts) == message.voxels
        assert len(message.mean_offsets) == 3 * message.voxels
        state = (message.info.epoch, message.sequence)
        self.states.setdefault(state, {})[message.chunk] = message

    def whole(self):
        """Chunks of the newest state that is complete, in order."""
        for state in sorted(self.states, reverse=True):
            chunks = self.states[state]
            if len(chunks) == chunks[next(iter(chunks))].chunks:
                return [chunks[i] for i in range(len(chunks))]
        return []

    def points(self):
        return sum(sum(chunk.counts) for chunk in self.whole())

    def rebuilt(self):
        chunks = self.whole()
        keys = [key for chunk in chunks for key in decode_keys(chunk.keys)]
        assert keys == sorted(set(keys)), "keys are not ascending over the chunks"
        assert len(keys) == chunks[0].voxels_total == sum(chunk.voxels for chunk in chunks)
        return {
            "keys": keys,
            "counts": [count for chunk in chunks for count in chunk.counts],
            "mean_offsets": [offset for chunk in chunks for offset in chunk.mean_offsets],
        }


def run_map(scenario, directory):
    generator = fcc(scenario["cell_volume_m3"])
    expected, rows = Expected(generator), scenario["odometry"]
    clouds = {row: (directory / name).read_bytes() for row, name in scenario["clouds"]}
    for row, data in clouds.items():
        expected.add(in_map(rows[row], data))

    peer = Peer(scenario["domain"])
    centers, markers = Centers(generator), Markers()
    poses = peer.writer("rt/ins/odometry", ros.Odometry, qos(200))
    points = peer.writer("rt/points", ros.PointCloud2, qos(5))
    peer.reader("rt/map_centers", ros.PointCloud2, qos(1, latched=True), centers)
    peer.reader("rt/voxel_markers", ros.MarkerArray, qos(500, latched=True), markers)
    peer.until_matched()
    for number, row in enumerate(rows):
        poses.write(odometry(row))
        if number in clouds:
            points.write(cloud(row[0], clouds[number]))
    peer.until(
        lambda: sum(centers.voxels.values()) >= expected.points,
        lambda: f"{sum(centers.voxels.values())} of {expected.points} points in map_centers",
    )
    keys = numpy.array(sorted(centers.voxels))
    triangles = 2 * exposed_faces(generator, keys)
    peer.until(
        lambda: markers.triangles() == triangles,
        lambda: f"{markers.triangles()} of {triangles} triangles in voxel_markers",
    )

    late, whole = Peer(scenario["domain"]), Map()
    late.reader("rt/voxel_map", ros.LatticeMap, qos(500, latched=True), whole)
    late.until(
        lambda: whole.points() >= expected.points,
        lambda: f"{whole.points()} of {expected.points} points in map, {len(whole.states)} states",
    )
    rebuilt, info = whole.rebuilt(), whole.whole()[0].info
    (directory / "rebuilt.json").write_text(json.dumps(rebuilt))
    voxels = dict(zip(rebuilt["keys"], rebuilt["counts"]))
    position = info.map_from_lattice.position
    return {
        "points": expected.points,
        "voxels": len(voxels),
        "cloud_bytes": max(map(len, clouds.values())),
        "map_chunks": len(whole.whole()),
        "map_differences": expected.differences(voxels)[:5],
        "centers_differences": expected.differences(centers.voxels)[:5],
        "centers_equal_map": centers.voxels == voxels,
        "centers_off_lattice_m": centers.off_lattice_m,
        "centers_frame": centers.frame,
        "on_borders": len(expected.perhaps),
        "generator_error_m": float(
            numpy.abs(generator - numpy.array(info.generator).reshape(3, 3)).max()
        ),
        "lattice": info.lattice,
        "cell_volume_m3": info.cell_volume_m3,
        "datum_m": [position.x, position.y, position.z],
        "frame": whole.whole()[0].header.frame_id,
        "marker_kinds": sorted(markers.kinds),
        "triangles": markers.triangles(),
        "wrong_triangles": markers.wrong_triangles(generator, keys),
    }


def run_graph(scenario, _directory):
    peer, poses_sent = Peer(scenario["domain"]), scenario["odometry"]
    heard, tasks, replies, whole = {}, {}, [], Map()

    def on_tf(message):
        for t in message.transforms:
            stamp_ns = t.header.stamp.sec * 10**9 + t.header.stamp.nanosec
            p, q = t.transform.translation, t.transform.rotation
            frames = (t.header.frame_id, t.child_frame_id)
            heard[stamp_ns] = (frames, [stamp_ns, p.x, p.y, p.z, q.x, q.y, q.z, q.w])

    def on_diagnostics(message):
        for status in message.status:
            tasks[status.name] = (status.level, {v.key: v.value for v in status.values})

    service = "lattice_mapper/request_keyframe"
    poses = peer.writer("rt/ins/odometry", ros.Odometry, qos(200))
    peer.reader("rt/tf", ros.TFMessage, qos(100), on_tf)
    peer.reader("rt/diagnostics", ros.DiagnosticArray, qos(10), on_diagnostics)
    peer.reader("rt/voxel_map", ros.LatticeMap, qos(500, latched=True), whole)
    request = peer.writer(f"rq/{service}Request", ros.TriggerRequest, qos(10))
    peer.reader(f"rr/{service}Reply", ros.TriggerResponse, qos(10), replies.append)
    peer.until_matched()
    # A writer that is matched here may not know our reader yet, and what it sends by then is for
    # nobody: poses from before the first one go ahead until a transform is heard.
    first_ns, *first = poses_sent[0]
    ahead = 0
    while not heard and ahead < MOST_AHEAD:
        poses.write(odometry([first_ns + (ahead - MOST_AHEAD) * 10**6, *first]))
        ahead += 1
        peer.waits.wait(duration(seconds=1))
        peer.turn()
    for row in poses_sent:
        poses.write(odometry(row))
    peer.until(
        lambda: all(row[0] in heard for row in poses_sent),
        lambda: f"{len(heard)} transforms for {len(poses_sent)} poses",
    )

    def poses_in():
        return tasks.get("enu_transformer: clouds", (0, {}))[1].get("poses_in")

    peer.until(
        lambda: poses_in() == str(ahead + len(poses_sent)) and "lattice_mapper: map" in tasks,
        lambda: f"diagnostics of {sorted(tasks)}, {poses_in()} poses in",
    )
    # The keyframe for the new reader of `voxel_map`, then the one asked for.
    peer.until(lambda: whole.whole(), lambda: "no map for a new reader")
    client, number, asked_ns = 0x0123_4567_89AB_CDEF, 42, time.time_ns()
    request.write(ros.TriggerRequest(client, number, 0))
    peer.until(
        lambda: replies and whole.newest_ns >= asked_ns,
        lambda: f"replies {replies}, last keyframe {whole.newest_ns - asked_ns} ns after the request",
    )
    wrong = 0.0
    for row in poses_sent:
        frames, found = heard[row[0]]
        assert frames == ("map", "base_link"), frames
        wrong = max(wrong, *(abs(a - b) for a, b in zip(row[1:], found[1:])))
    return {
        "tf_error": wrong,
        "tasks": sorted(tasks),
        "replies": [[r.client == client, r.number == number, r.success] for r in replies],
        "reply": replies[0].message,
    }


def run_endpoints(scenario, _directory):
    """Topic, type and USER_DATA of all endpoints of others."""
    peer, found = Peer(scenario["domain"]), {}

    def on_endpoint(endpoint):
        if endpoint.participant_key != peer.participant.guid:
            data = endpoint.qos[Policy.Userdata]
            text = data.data.decode() if data else ""
            found[endpoint.key] = [endpoint.topic_name, endpoint.type_name, text]

    for topic in (BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription):
        peer.attach(topic, BuiltinDataReader(peer.participant, topic), on_endpoint)
    peer.until(
        lambda: {topic for topic, _, _ in found.values()}.issuperset(scenario["topics"]),
        lambda: f"endpoints {sorted(found.values())}",
    )
    return sorted(found.values())


def main():
    # Whatever hangs, the test ends.
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    command, directory = sys.argv[1], Path(sys.argv[2])
    scenario = json.loads((directory / "scenario.json").read_text())
    run = {"map": run_map, "graph": run_graph, "endpoints": run_endpoints}[command]
    print(json.dumps(run(scenario, directory)), flush=True)


if __name__ == "__main__":
    main()
