"""A client of what every node serves: parameters, levels of loggers, descriptions of types.

    param_peer.py SCENARIO     a JSON file; prints one line of JSON with the answers

It dumps, edits and loads parameters as `ros2 param` does: `load` sets each by itself.
"""

import faulthandler
import json
import sys
from pathlib import Path

from cyclone_peer import PATIENCE_S, Calls, Peer, qos
import ros_idl as ros

NAMES = [
    None, "bool_value", "integer_value", "double_value", "string_value", "byte_array_value",
    "bool_array_value", "integer_array_value", "double_array_value", "string_array_value",
]  # fmt: skip
KINDS = {bool: 1, int: 2, float: 3, str: 4}


def message(value):
    """A value as `ros2 param` sends it; none for a parameter that is to go."""
    kind = 0 if value is None else KINDS.get(type(value))
    if kind is None:
        # An empty list is one of bools there.
        kind = 5 + KINDS[type(value[0])] if value else 6
    fields = dict(zip(NAMES[1:], [False, 0, 0.0, "", [], [], [], [], []]))
    if kind:
        fields[NAMES[kind]] = value
    return ros.ParameterValue(kind, *fields.values())


def value(message):
    found = getattr(message, NAMES[message.type]) if message.type else None
    return list(found) if message.type > 4 else found


class Node:
    def __init__(self, domain, node):
        self.peer, self.events, self.centers, self.stamps_s = Peer(domain), [], 0, []
        self.peer.reader("rt/parameter_events", ros.ParameterEvent, qos(1000), self.on_event)
        self.peer.reader("rt/map_centers", ros.PointCloud2, qos(1, latched=True), self.on_centers)
        self.calls = {
            name: Calls(self.peer, f"{node}/{name}", *types)
            for name, types in ros.NODE_SERVICES.items()
        }
        self.peer.until_matched()

    def on_event(self, event):
        def values(parameters):
            return {one.name: value(one.value) for one in parameters}

        self.stamps_s.append(event.stamp.sec)
        changed = values(event.changed_parameters)
        if changed:
            self.events.append([event.node, changed])

    def on_centers(self, _message):
        self.centers += 1

    def call(self, name, *fields):
        return self.calls[name].call(*fields)

    def set(self, parameters, atomically=False):
        wanted = [ros.Parameter(name, message(value)) for name, value in parameters]
        if atomically:
            results = [self.call("set_parameters_atomically", wanted).result]
        else:
            results = self.call("set_parameters", wanted).results
        return [one.reason if not one.successful else None for one in results]

    def stamp_s(self, parameter):
        """Stamp of the event that a change of a parameter brings."""
        self.peer.turn()
        before = len(self.stamps_s)
        assert self.set([parameter]) == [None], parameter
        self.peer.until(lambda: len(self.stamps_s) > before, lambda: f"no event of {parameter}")
        return self.stamps_s[-1]

    def simulated_time(self):
        """Stamps before /clock is heard, of its time, and of the system's time again."""
        clock = self.peer.writer("rt/clock", ros.Clock, qos(10))
        stamps = [self.stamp_s(("use_sim_time", True))]
        self.peer.until(lambda: self.peer.matched["rt/clock"], lambda: "nobody hears /clock")
        for tries in range(100):
            clock.write(ros.Clock(ros.Time(77, 0)))
            stamp_s = self.stamp_s(("max_cloud_points", 100 + tries))
            if stamp_s:
                break
        return [*stamps, stamp_s, self.stamp_s(("use_sim_time", False)) > 10**9]

    def dump(self):
        names = self.call("list_parameters", [], 0).result.names
        return dict(zip(names, map(value, self.call("get_parameters", names).values)))

    def described(self):
        names = self.call("list_parameters", [], 0).result.names
        found = {}
        for one in self.call("describe_parameters", names).descriptors:
            ranges = [*one.floating_point_range, *one.integer_range]
            found[one.name] = {
                "type": one.type,
                "description": one.description,
                "constraints": one.additional_constraints,
                "read_only": one.read_only,
                "range": [[each.from_value, each.to_value] for each in ranges],
            }
        return found


def main():
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    scenario = json.loads(Path(sys.argv[1]).read_text())
    node = Node(scenario["domain"], scenario["node"])
    said = {"described": node.described()}
    said["refused"] = [node.set(one, atomically=True) + node.set(one) for one in scenario["refused"]]
    said["centers_before"] = node.centers
    dumped = node.dump()
    loaded = dumped | scenario["edits"]
    results = dict(zip(loaded, node.set(loaded.items())))
    said["not_loaded"] = {name: reason for name, reason in results.items() if reason}
    said["changed"] = {k: v for k, v in node.dump().items() if dumped[k] != v}
    last = list(loaded)[-1]
    node.peer.until(lambda: node.centers > 0, lambda: "no centres at the new rate")
    edits = scenario["edits"]
    heard = lambda: {k for _, changed in node.events for k in changed}  # noqa: E731
    node.peer.until(lambda: heard() >= set(edits), lambda: f"events {node.events}, not {last}")
    said["events"] = [event for event in node.events if set(event[1]) & set(edits)]

    said["stamps_s"] = node.simulated_time()
    logger = scenario["node"]
    levels = [ros.LoggerLevel(logger, level) for level in (10, 15)]
    results = node.call("set_logger_levels", levels).results
    said["levels_set"] = [[one.successful, one.reason] for one in results]
    levels = node.call("get_logger_levels", [logger, "none"]).levels
    said["levels"] = [[one.name, one.level] for one in levels]
    node.call("set_logger_levels", [ros.LoggerLevel(logger, 0)])

    said["types"] = []
    for name, type_hash in scenario["types"]:
        answer = node.call("get_type_description", name, type_hash, True)
        described = answer.type_description
        fields = [[one.name, one.type.type_id] for one in described.type_description.fields]
        others = [one.type_name for one in described.referenced_type_descriptions]
        said["types"].append([answer.successful, answer.failure_reason, fields, others])
    print(json.dumps(said))


if __name__ == "__main__":
    main()
