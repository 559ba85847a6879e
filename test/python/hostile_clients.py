"""Hostile clients of the nodes of a domain, all at once.

    hostile_clients.py DOMAIN PORT PLAYER     port of `viewer_server`, name of a `bag_player` whose log is held

A line `attack` on standard input starts them. `rest` ends their connections and bursts, and prints one line of JSON: how
often each client has done its work so far.
"""

import base64
import itertools
import json
import os
import random
import select
import socket
import sys
import threading
import time

from cyclone_peer import Calls, Peer, qos
import ros_idl as ros
from cyclonedds.idl.types import array, uint8
from player_peer import SERVICES

# Connections at a time, of which `viewer_server` holds 16 for each address.
CONNECTIONS = 200
# Pause of a client between two attacks: the nodes have most of the processor.
PAUSE_S = 3
BURST_S = 0.5
GARBAGE_PERIOD_S = 0.1
# A keyframe of 4 MB, in messages of 60 kB as the mapper's: a voxel has a key of 1 byte, a count of 4, an offset of 6.
CHUNK_VOXELS, CHUNKS = 5000, 70
# Topics of nodes by type. No message begins with 0xffffffff as a length, or with noise.
GARBAGE = {
    "sensor_msgs/msg/PointCloud2": ["left/points", "points_enu", "headset/points"],
    "novatel_oem7_msgs/msg/INSPVAX": ["novatel/oem7/inspvax"],
    "lattice_msgs/msg/LatticeMapUpdate": ["voxel_map_updates"],
    "vision_msgs/msg/LabelInfo": ["headset/label_info"],
    "tf2_msgs/msg/TFMessage": ["tf", "tf_static"],
}
LATCHED = ["headset/label_info", "tf_static"]
GARBAGE_BYTES = 256
UPGRADE = """GET / HTTP/1.1
Host: localhost
Upgrade: websocket
Connection: Upgrade
Sec-WebSocket-Version: 13
Sec-WebSocket-Key: {}
Sec-WebSocket-Protocol: foxglove.sdk.v1

"""
# Masked with zeros, of the largest length.
PING = b"\x89\xfd\0\0\0\0" + bytes(125)


class Client(threading.Thread):
    """A client that attacks while it may, in a thread of its own."""

    def __init__(self, attack):
        super().__init__(daemon=True)
        self.attack, self.done = attack, 0
        self.may, self.rests = threading.Event(), threading.Event()
        self.rests.set()
        self.start()

    def run(self):
        while True:
            self.may.wait()
            self.rests.clear()
            while self.may.is_set():
                self.done += self.attack(self.may)
            self.rests.set()

    def rest(self):
        self.may.clear()
        assert self.rests.wait(120), f"{self.attack.__name__} does not end"


def pause(may, seconds):
    end = time.monotonic() + seconds
    while may.is_set() and time.monotonic() < end:
        time.sleep(0.05)


class Sockets:
    """Connections to `viewer_server`."""

    def __init__(self, port):
        self.address = "127.0.0.1", port

    def pings(self, may):
        """Pings and reads nothing, until the server closes the connection."""
        request = UPGRADE.format(base64.b64encode(os.urandom(16)).decode())
        with socket.create_connection(self.address) as connection:
            try:
                connection.sendall(request.replace("\n", "\r\n").encode())
                if connection.recv(12) != b"HTTP/1.1 101":
                    return 0
            except ConnectionError:
                return 0  # Displaced before it was a client.
            connection.setblocking(False)
            end = time.monotonic() + 60
            while time.monotonic() < end:
                try:
                    if select.select([], [connection], [], 1)[1]:
                        connection.send(PING * 1000)
                except BlockingIOError:
                    pass
                except ConnectionError:
                    break
            else:
                raise AssertionError("a client that takes nothing for 60 s is not closed")
        # Once a loop: the next one would begin when the log has ended.
        pause(may, 10 * PAUSE_S)
        return 1

    def half_open(self, may):
        """Connections that ask for nothing, half of something, or another protocol."""
        said = itertools.cycle([b"", b"GET / HT", b"\x16\x03\x01\x02\x00", b"GET / HTTP/1.1\r\nHost: "])
        crowd = []
        for begin in itertools.islice(said, CONNECTIONS):
            connection = socket.create_connection(self.address)
            crowd.append(connection)
            try:
                connection.sendall(begin)
            except ConnectionError:
                pass  # Displaced already.
        pause(may, PAUSE_S)
        for connection in crowd:
            connection.close()
        return len(crowd)


class Topics:
    """Messages on the topics of the nodes: those that do not decode, and those that claim to be a mapper's."""

    def __init__(self, domain):
        # A participant has one type for each topic.
        participant, self.forger = Peer(domain), Peer(domain)
        self.writers, self.genuine = [], None
        for name, topics in GARBAGE.items():
            kind = ros.ros(name, bytes=array[uint8, GARBAGE_BYTES])
            for topic in topics:
                writer = participant.writer(f"rt/{topic}", kind, qos(10, topic in LATCHED))
                self.writers.append((writer, kind))
        self.maps = self.forger.writer("rt/voxel_map", ros.LatticeMap, qos(CHUNKS, latched=True))
        self.forger.reader("rt/voxel_map", ros.LatticeMap, qos(CHUNKS), self.hear)
        self.clouds = self.forger.writer("rt/headset/points", ros.PointCloud2, qos(10))

    def hear(self, chunk):
        # Not what it has sent itself.
        if chunk.voxels != CHUNK_VOXELS:
            self.genuine = chunk

    def garbage(self, may):
        """What does not decode, and clouds whose header says more than they have."""
        for writer, kind in self.writers:
            noise = [b"\xff" * GARBAGE_BYTES, random.randbytes(GARBAGE_BYTES)]
            writer.write(kind(list(random.choice(noise))))
        fields = [ros.PointField(name, 4 * i, 7, 1) for i, name in enumerate("xyz")]
        header = ros.Header(ros.Time(2**31 - 1, 0), "headset_origin")
        lie = ros.PointCloud2(header, 2**16, 2**31, fields, False, 12, 2**31, list(bytes(12)), True)
        self.clouds.write(lie)
        pause(may, GARBAGE_PERIOD_S)
        return len(self.writers) + 1

    def forged_maps(self, may):
        """A whole keyframe of other content in the mapper's epoch, under a number that it has not given yet."""
        self.forger.turn()
        genuine = self.genuine
        if genuine is None:
            pause(may, GARBAGE_PERIOD_S)
            return 0
        # Updates do not come to it while its chunks are sent.
        ahead, count = random.choice([100, 1 << 40]), CHUNK_VOXELS
        # Of the mapper's last point, and of a time to come.
        stamp = random.choice([genuine.header.stamp, ros.Time(2**31 - 1, 0)])
        labelled, history = len(genuine.labels) > 0, random.getrandbits(64)
        for chunk in range(CHUNKS):
            # Keys from the middle of the lattice on.
            first = (7 << 60) + chunk * count
            digits = [first >> shift & 127 | 128 for shift in range(0, 56, 7)] + [first >> 56]
            self.maps.write(
                ros.LatticeMap(
                    header=ros.Header(stamp, genuine.header.frame_id),
                    info=genuine.info,
                    sequence=min(genuine.sequence + ahead, 2**64 - 1),
                    chunk=chunk,
                    chunks=CHUNKS,
                    voxels_total=CHUNKS * count,
                    key_encoding=genuine.key_encoding,
                    voxels=count,
                    keys=digits + [1] * (count - 1),
                    counts=[1] * count,
                    offset_unit_m=genuine.offset_unit_m,
                    mean_offsets=[0] * (3 * count),
                    labels=[0] * (count * labelled),
                    label_counts=[1] * (count * labelled),
                    history_checksum=history,
                )
            )
        pause(may, PAUSE_S)
        return 1


class Player:
    """A client of a player whose log is held."""

    def __init__(self, domain, name):
        self.peer = Peer(domain)
        called = ["burst", "is_paused", "pause", "resume"]
        self.calls = {call: Calls(self.peer, f"{name}/{call}", *SERVICES[call]) for call in called}
        self.peer.until_matched()

    def bursts(self, may):
        """Three bursts without end at once, which a call of `resume` ends."""
        bursts = self.calls["burst"]
        begun = [bursts.begin(2**64 - 1) for _ in range(3)]
        pause(may, BURST_S)
        assert self.calls["is_paused"].call(0).paused, "the log is not held"
        self.calls["resume"].call(0)
        self.calls["pause"].call(0)
        answers = [bursts.wait(number).actually_burst for number in begun]
        assert sorted(answers)[:2] == [0, 0], f"bursts at a time: {answers}"
        for calls in self.calls.values():
            calls.answers.clear()
        pause(may, PAUSE_S)
        return 1


def main():
    domain, port, player = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    sockets, topics, player = Sockets(port), Topics(domain), Player(domain, player)

    def fail(error):
        sys.__excepthook__(error.exc_type, error.exc_value, error.exc_traceback)
        os._exit(1)

    threading.excepthook = fail
    attacks = [
        sockets.pings,
        sockets.half_open,
        topics.garbage,
        topics.forged_maps,
        player.bursts,
    ]
    clients = [Client(attack) for attack in attacks]
    for line in sys.stdin:
        if line == "attack\n":
            for client in clients:
                client.may.set()
        else:
            for client in clients:
                client.rest()
            print(json.dumps({client.attack.__name__: client.done for client in clients}), flush=True)


if __name__ == "__main__":
    main()
