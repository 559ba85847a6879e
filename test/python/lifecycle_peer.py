"""A manager of a managed `lattice_mapper`, which it takes through its states as ros2 lifecycle does.

    lifecycle_peer.py DOMAIN     prints one line of JSON: the answers, the transitions, the map's voxels
"""

import faulthandler
import json
import struct
import sys
import time

import ros_idl as ros
from cyclone_peer import PATIENCE_S, Calls, Peer, header, qos
from cyclonedds.idl.types import sequence
from cyclonedds.util import duration

NODE = "lattice_mapper"
STATES = {"available_states": sequence[ros.State]}
TRANSITIONS = {"available_transitions": sequence[ros.TransitionDescription]}
SERVICES = {
    "change_state": ("ChangeState", {"transition": ros.Transition}, {"success": bool}),
    "get_state": ("GetState", None, {"current_state": ros.State}),
    "get_available_states": ("GetAvailableStates", None, STATES),
    "get_available_transitions": ("GetAvailableTransitions", None, TRANSITIONS),
    "get_transition_graph": ("GetAvailableTransitions", None, TRANSITIONS),
}


FLOAT32 = 7
INTEGER = 2


def cloud(x):
    """One point on the x axis of the map."""
    fields = [ros.PointField(name, 4 * i, FLOAT32, 1) for i, name in enumerate("xyz")]
    data = struct.pack("<fff", x, 0.0, 0.0)
    return ros.PointCloud2(header(time.time_ns(), "map"), 1, 1, fields, False, 12, 12, data, False)


class Manager:
    def __init__(self, domain):
        self.peer, self.events, self.voxels = Peer(domain), [], None
        # Endpoints are announced in order: a node that answers a call knows this reader already.
        self.peer.reader(f"rt/{NODE}/transition_event", ros.TransitionEvent, qos(20), self.on_event)
        self.calls = {
            name: Calls(self.peer, f"{NODE}/{name}", *ros.service(f"lifecycle_msgs/srv/{kind}", *types))
            for name, (kind, *types) in SERVICES.items()
        }
        for name in ("set_parameters", "get_parameters"):
            self.calls[name] = Calls(self.peer, f"{NODE}/{name}", *ros.NODE_SERVICES[name])
        self.peer.until_matched()
        self.points = self.peer.writer("rt/points_enu", ros.PointCloud2, qos(5))
        self.peer.reader("rt/voxel_map", ros.LatticeMap, qos(500, latched=True), self.on_map)

    def on_event(self, event):
        self.events.append([event.transition.label, event.start_state.label, event.goal_state.label])

    def on_map(self, chunk):
        self.voxels, self.info = chunk.voxels_total, chunk.info

    def ask(self, name, *fields):
        """The only field of an answer."""
        answer = self.calls[name].call(*(fields or (0,)))
        return next(value for key, value in vars(answer).items() if key not in ros.ASKED)

    def change(self, label="", number=0):
        success = self.ask("change_state", ros.Transition(number, label))
        return [success, self.ask("get_state").label]

    def transitions(self, name="get_available_transitions"):
        return [[t.transition.id, t.transition.label, t.goal_state.id] for t in self.ask(name)]

    def set(self, name, integer):
        value = ros.ParameterValue(INTEGER, False, integer, 0.0, "", [], [], [], [], [])
        answer = self.ask("set_parameters", [ros.Parameter(name, value)])[0]
        return [answer.successful, answer.reason]

    def goes(self, goal):
        """Waits for the event of a transition that has ended in this state."""
        self.peer.until(
            lambda: self.events[-1:] and self.events[-1][2] == goal, lambda: f"transitions: {self.events}"
        )

    def meets_mapper(self):
        """Waits until the mapper hears our cloud topic and we its map."""
        topics = ("rt/points_enu", "rt/voxel_map", "rt/map_origin")
        self.peer.until(
            lambda: all(self.peer.matched.get(topic) for topic in topics),
            lambda: f"endpoints matched: {self.peer.matched}",
        )

    def map_of(self, voxels):
        """Sends a point for each cell until the map has so many voxels."""
        end = time.monotonic() + PATIENCE_S
        while self.voxels != voxels and time.monotonic() < end:
            # Best effort: those that the mapper did not know the writer of are lost.
            for i in range(voxels):
                self.points.write(cloud(2.0 * i))
            self.peer.waits.wait(duration(milliseconds=300))
            self.peer.turn()
        assert self.voxels == voxels, f"voxels in the map: {self.voxels}"


def main():
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    manager, said = Manager(int(sys.argv[1])), {}
    said["states"] = [[state.id, state.label] for state in manager.ask("get_available_states")]
    said["graph"] = manager.transitions("get_transition_graph")
    said["at first"] = [manager.ask("get_state").label, manager.transitions()]
    said["activate too early"] = manager.change("activate")
    said["unknown"] = manager.change("transition_success")
    assert not manager.peer.matched.get("rt/voxel_map"), "an unconfigured node has no topics"
    # Latched once, for an inactive node.
    origin = manager.peer.writer("rt/map_origin", ros.GeoPointStamped, qos(1, latched=True))
    origin.write(ros.GeoPointStamped(header(0, "earth"), ros.GeoPoint(48.1, 11.5, 515.0)))
    said["set"] = [manager.set("max_voxels", 1000), manager.set("max_map_bytes", 1)]
    said["configure"] = manager.change("configure")
    said["used"] = manager.ask("get_parameters", ["max_voxels"])[0].integer_value
    said["inactive"] = manager.transitions()
    manager.meets_mapper()
    assert origin.wait_for_acks(duration(seconds=PATIENCE_S))
    # Of a cell that the map gets anyway: should the mapper be slow, it is active when this comes.
    manager.points.write(cloud(0.0))
    manager.change()
    assert manager.voxels is None, "an inactive node publishes nothing"
    said["activate"] = manager.change("", 3)
    manager.map_of(3)
    said["origin"] = manager.info.has_origin and manager.info.origin.latitude
    said["deactivate"] = manager.change("deactivate")
    said["cleanup"] = manager.change("cleanup")
    said["set again"] = manager.set("max_voxels", 2000)
    manager.peer.until(lambda: not manager.peer.matched["rt/voxel_map"], lambda: "the map is still there")
    said["again"] = [manager.change("configure"), manager.change("activate")]
    manager.meets_mapper()
    manager.map_of(1)
    said["shutdown"] = manager.change("shutdown")
    said["at last"] = manager.transitions()
    manager.goes("finalized")
    said["events"] = manager.events
    print(json.dumps(said))


if __name__ == "__main__":
    main()
