"""The nodes in processes of their own, for hours: one log again and again, a new player each time.

    soak.py LATTICE DIRECTORY MINUTES [--hostile | --foreign | --zenoh]     ROS_DOMAIN_ID as the nodes take it

After each loop every cloud must have been counted, and the map must be that of the loop before, at last
that of `lattice replay --direct`; then the mapper is reset. Memory, descriptors and threads of each process are written to
DIRECTORY/soak.csv and must be flat from the second quarter to the last one. They are those of nodes whose maps are empty:
after the reset, when all followers have followed it.

With `--hostile` there are more nodes, and the clients of hostile_clients.py attack them in every loop but the last, after
which the maps of all nodes must be the mapper's again. With `--foreign` a viewer in each rclpy of LATTICE_ROS_PYTHON must
have the markers of every map. With `--zenoh` all of it goes through a router of Zenoh.
"""

import atexit
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import time
from pathlib import Path

from soak_observer import OverDds, OverZenoh, Router

PARAMS = Path(__file__).parents[2] / "params/bobcat.yaml"
LOG_S = 20
CLOUDS = [f"/{place}/points" for place in ("left", "right", "top")]
INS = "/novatel/oem7/inspvax"
# Topics on which nothing may be lost, with depths that hold a whole log, however long a node is kept from the processor.
RELIABLE = {topic: 2000 for topic in CLOUDS} | {INS: 2500}
NODES = {
    "enu_transformer": RELIABLE | {"/points_enu": 6000, "/tf": 2500},
    "lattice_mapper": {"/points_enu": 6000},
    "voxel_marker_publisher": {},
    "bag_player": RELIABLE,
    "semantic_icp_server": {},
    "viewer_server": {},
}
# Nodes of every soak but for the player, and those that are attacked too.
STEADY = ["enu_transformer", "lattice_mapper", "voxel_marker_publisher"]
ATTACKED = ["semantic_icp_server", "viewer_server"]
# Where followers of the map show how much of it they have.
FOLLOWED = {
    "voxel_marker_publisher": ("markers", "voxels"),
    "semantic_icp_server": ("calibration", "map_voxels"),
    "viewer_server": ("viewer", "voxels"),
}
# What shows that attacks came through, by task.
FELT = {
    "voxel_marker_publisher: markers": ["map_differences", "undecodable"],
    "semantic_icp_server: calibration": ["map_differences", "undecodable", "clouds_too_large"],
    "viewer_server: viewer": ["clients_stalled", "connections_displaced"],
    "lattice_mapper: map": ["undecodable"],
    "enu_transformer: clouds": ["undecodable"],
}
# A player of the same log on topics of its own.
HELD = "held_player"
# Growth of the resident memory that is no leak: pages that an allocator keeps, and buffers.
FLAT = 1.05
SLACK_KB = 2048


class Node:
    """A node in a process of its own."""

    def __init__(self, lattice, name, directory, program=None, remaps={}, **params):
        self.name, self.report = name, directory / f"{name}.json"
        self.log = open(directory / f"{name}.log", "a")
        program = program or name
        options = {"report_file": self.report} | params
        for topic, depth in NODES[program].items():
            options |= {f"qos.{topic}.reliability": "reliable", f"qos.{topic}.depth": depth}
        arguments = [lattice, "node", program, "--ros-args", "--params-file", PARAMS]
        arguments += ["-r", f"__node:={name}"]
        for option in options.items():
            arguments += ["-p", "{}:={}".format(*option)]
        for remap in remaps.items():
            arguments += ["-r", "{}:={}".format(*remap)]
        # The configuration of the observer's Cyclone is none of theirs.
        environment = {key: os.environ[key] for key in os.environ if key != "CYCLONEDDS_URI"}
        self.process = subprocess.Popen(arguments, stderr=self.log, env=environment)
        atexit.register(self.process.kill)

    def sizes(self):
        """Resident memory in kB, threads, descriptors."""
        root = Path(f"/proc/{self.process.pid}")
        lines = (line.split(":") for line in (root / "status").read_text().splitlines())
        status = {key: value.split() for key, value in lines}
        descriptors = len(list((root / "fd").iterdir()))
        return int(status["VmRSS"][0]), int(status["Threads"][0]), descriptors

    def ended(self, sent=None):
        """Report of the node at its end."""
        if sent:
            self.process.send_signal(sent)
        code = self.process.wait(timeout=180)
        assert code == 0, f"{self.name} ended with {code}"
        return json.loads(self.report.read_text())


class Soak:
    """What an observer hears of the nodes."""

    def __init__(self, observer):
        self.observer = observer

    def clouds(self):
        """Clouds that the mapper has counted."""
        return int(self.observer.count("lattice_mapper", "map", "clouds_in") or 0)

    def followed(self, nodes):
        """Voxels of the mapper's map, and of those that the other nodes have of it."""
        shown = self.observer.count
        followers = {node: shown(node, *FOLLOWED[node]) for node in nodes if node in FOLLOWED}
        return {"lattice_mapper": shown("lattice_mapper", "map", "voxels")} | followers

    def agree(self, nodes, voxels=None):
        """Waits until all nodes have the mapper's map, of so many voxels if given."""

        def agreed():
            found = set(self.followed(nodes).values())
            return len(found) == 1 and voxels in (None, *found)

        self.observer.until(agreed, lambda: f"the maps differ: {self.followed(nodes)}")


class Viewer:
    """A viewer in rclpy, in a process of its own."""

    def __init__(self, python):
        program = Path(__file__).with_name("soak_viewer.py")
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self.process = subprocess.Popen([python, program, os.environ["ROS_DOMAIN_ID"]], **pipes)
        atexit.register(self.process.kill)
        self.line()

    def line(self):
        line = self.process.stdout.readline()
        assert line, "a viewer has ended"
        return line

    def look(self, points):
        """Waits until it has so many points."""
        print(points, file=self.process.stdin, flush=True)
        return json.loads(self.line())


class Hostile:
    """The hostile clients, in a process of their own."""

    def __init__(self, port):
        program = Path(__file__).with_name("hostile_clients.py")
        arguments = [sys.executable, program, os.environ["ROS_DOMAIN_ID"], str(port), HELD]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self.process = subprocess.Popen(arguments, **pipes)
        atexit.register(self.process.kill)

    def attack(self):
        print("attack", file=self.process.stdin, flush=True)

    def rest(self):
        """How often each client has done its work."""
        print("rest", file=self.process.stdin, flush=True)
        line = self.process.stdout.readline()
        assert line, "the hostile clients have ended"
        return json.loads(line)


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def prepare(lattice, directory):
    """The log, and what the mapper should report of it."""
    log = directory / "log"
    simulate = [lattice, "simulate", "bobcat", "--out", log, "--duration", str(LOG_S), "--overwrite"]
    subprocess.run(simulate, check=True, stdout=subprocess.DEVNULL)
    direct = [lattice, "replay", log, "--direct", "--json", "--params", PARAMS]
    report = json.loads(subprocess.run(direct, check=True, stdout=subprocess.PIPE).stdout)
    return log, report["lattices"][0]["map"]


def grown(sizes):
    """In words, which size of a process is larger in the last quarter than in the second."""
    quarter = len(sizes) // 4
    # The middle: a map that is being saved has a thread.
    middle = lambda part: [statistics.median(column) for column in zip(*part)]
    then, last = (middle(sizes[n * quarter :][:quarter]) for n in (1, 3))
    memory = last[0] > FLAT * then[0] + SLACK_KB
    return f"{then} -> {last}" if memory or last[1:] > then[1:] else ""


def start(lattice, directory, log, kind):
    """The nodes but for the player, and the port of the viewer."""
    hostile = kind == "--hostile"
    port, options = free_port(), {"lattice_mapper": {"map_dir": directory.absolute()}}
    # Poses may come late on a machine with other work.
    options["enu_transformer"] = {"max_wait_s": 10.0}
    options["viewer_server"] = {"port": port}
    # A point for each voxel, which the viewers count.
    options["voxel_marker_publisher"] = {"style": "points"} if kind == "--foreign" else {}
    names = STEADY + (ATTACKED if hostile else [])
    nodes = [Node(lattice, name, directory, **options.get(name, {})) for name in names]
    if hostile:
        topics = CLOUDS + [INS]
        held = {"bag": log, "start_paused": True, "loop": True, "keyboard": False}
        held |= {"program": "bag_player", "topics": json.dumps(topics)}
        remaps = {topic: f"/held{topic}" for topic in topics}
        nodes.append(Node(lattice, HELD, directory, remaps=remaps, **held))
    return nodes, port


def observe(router):
    domain = int(os.environ["ROS_DOMAIN_ID"])
    return OverZenoh(domain, router.endpoint) if router else OverDds(domain)


def main():
    lattice, directory, minutes = sys.argv[1], Path(sys.argv[2]), float(sys.argv[3])
    kind = "".join(sys.argv[4:])
    assert kind in ("", "--hostile", "--foreign", "--zenoh"), __doc__
    hostile = kind == "--hostile"
    # The nodes end with it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    directory.mkdir(parents=True, exist_ok=True)
    log, wanted = prepare(lattice, directory)
    clouds, first = wanted["counts"]["clouds_in"], None
    router = Router(free_port()) if kind == "--zenoh" else None
    nodes, port = start(lattice, directory, log, kind)
    observer, saved = observe(router), directory / "saved.lattice"
    soak = Soak(observer)
    clients, attacks = Hostile(port) if hostile else None, {}
    pythons = os.environ["LATTICE_ROS_PYTHON"].split(":") if kind == "--foreign" else []
    viewers = [Viewer(python) for python in pythons]
    sizes, end, loops = {node.name: [] for node in nodes}, time.monotonic() + 60 * minutes, 0
    with open(directory / "soak.csv", "w") as table:
        print("loop,node,resident_kb,threads,descriptors", file=table)
        while True:
            # Quarters of a loop at least, without the last one.
            is_last = time.monotonic() > end and loops >= 4
            if clients and not is_last:
                clients.attack()
            waited = json.dumps(CLOUDS + [INS])
            player = Node(lattice, "bag_player", directory, bag=log, wait_for_subscribers=waited)
            played = player.ended()
            assert played["acknowledged"] and played["failed"] == 0, played
            loops += 1
            observer.until(
                lambda: soak.clouds() >= loops * clouds,
                lambda: f"loop {loops}: {loops * clouds} clouds went in, {observer.values}",
            )
            seen = [viewer.look(wanted["voxels"]) for viewer in viewers]
            if clients and not is_last:
                attacks = clients.rest()
            observer.save(saved.name)
            first = first or saved.read_bytes()
            assert saved.read_bytes() == first, f"loop {loops} made another map: {saved}"
            if is_last:
                break
            observer.reset()
            # A forged map of 350,000 voxels is in no node then.
            soak.agree(list(sizes), "0")
            for node in nodes:
                sizes[node.name].append(node.sizes())
                print(loops, node.name, *sizes[node.name][-1], sep=",", file=table, flush=True)
    soak.agree(list(sizes))
    if hostile:
        assert all(attacks.values()), f"clients that did nothing: {attacks}"
        for task, keys in FELT.items():
            felt = {key: observer.values[task][key] for key in keys}
            assert all(int(count) for count in felt.values()), f"{task} was not attacked: {felt}"
    reports = {node.name: node.ended(signal.SIGINT) for node in nodes}
    report = reports["lattice_mapper"]
    assert report["counts"]["clouds_in"] == loops * clouds, report
    assert [report[key] for key in ("voxels", "points", "map_checksum")] == [
        wanted[key] for key in ("voxels", "points", "map_checksum")
    ], f"{report} is not the map of the log, {wanted}"
    leaks = {name: grown(of) for name, of in sizes.items() if grown(of)}
    ends = {name: {"second loop": of[1], "last": of[-1]} for name, of in sizes.items()}
    result = {"loops": loops, "clouds": loops * clouds, "sizes": ends, "grown": leaks}
    result |= {"attacks": attacks} if hostile else {}
    result |= {"viewers": seen} if viewers else {}
    print(json.dumps(result))
    observer.close()
    sys.exit(1 if leaks else 0)


if __name__ == "__main__":
    main()
