"""Observers of a soak: foreign participants that hear `/diagnostics`, save the map and reset the mapper."""

import os
import subprocess
import sys
import time
from pathlib import Path

import ros_idl as ros

PATIENCE_S = 120
DIAGNOSTICS = "/diagnostics"
SaveMapRequest = ros.ros("lattice_msgs/srv/SaveMap_Request", **ros.ASKED, path=str)
SaveMapResponse = ros.ros(
    "lattice_msgs/srv/SaveMap_Response", **ros.ASKED, success=bool, message=str, voxels=ros.uint64
)
# Encapsulation of a CDR message, and what a request over DDS has between it and its fields.
ENCAPSULATION, HEADER = 4, 16
# QoS of a token: reliable, depth 10.
RELIABLE = "::,10:,:,:,,"


class Observer:
    """The last values of all diagnostics, by task, and the two services of the mapper."""

    def __init__(self):
        self.values, self.number = {}, 0

    def diagnosed(self, message):
        for status in message.status:
            self.values[status.name] = {value.key: value.value for value in status.values}

    def count(self, node, task, key):
        """A value of the diagnostics of a node; `None` before the first ones."""
        return self.values.get(f"{node}: {task}", {}).get(key)

    def save(self, path):
        self.ask("save_map", SaveMapRequest, SaveMapResponse, path)

    def reset(self):
        self.ask("reset", ros.TriggerRequest, ros.TriggerResponse, 0)


class OverDds(Observer):
    """A participant of PyPI's Cyclone DDS."""

    def __init__(self, domain):
        super().__init__()
        # Sets what Cyclone reads when it is loaded.
        from cyclone_peer import Calls, Peer, qos

        self.peer = Peer(domain)
        self.peer.reader(f"rt{DIAGNOSTICS}", ros.DiagnosticArray, qos(100), self.diagnosed)
        self.calls = {
            name: Calls(self.peer, f"lattice_mapper/{name}", *types)
            for name, types in {
                "save_map": (SaveMapRequest, SaveMapResponse),
                "reset": (ros.TriggerRequest, ros.TriggerResponse),
            }.items()
        }
        self.peer.until_matched()

    def until(self, reached, state):
        self.peer.until(reached, state)

    def close(self):
        """Nothing: a participant ends with its process."""

    def ask(self, name, _request, _response, argument):
        answer = self.calls[name].call(argument)
        assert answer.success, answer.message


class OverZenoh(Observer):
    """A session of PyPI's Zenoh that keeps the conventions of rmw_zenoh, and a router for the nodes."""

    def __init__(self, domain, endpoint):
        super().__init__()
        from zenoh_peer import Peer

        self.peer = Peer(endpoint, domain)
        self.asked = {name: self.client(name) for name in ("save_map", "reset")}
        of = self.type_of("MP", DIAGNOSTICS)
        key = self.peer.key(DIAGNOSTICS, of)
        self.peer.kept.append(self.peer.session.declare_subscriber(key, self.heard))
        self.peer.token("MS", DIAGNOSTICS, of, RELIABLE)

    def type_of(self, kind, name):
        """Type and hash of an endpoint, as the mapper has them in its token."""
        return self.peer.token_of("lattice_mapper", kind, name).split("/")[10:12]

    def client(self, name):
        """Name and type of a service, and the gid of a client here."""
        service = f"/lattice_mapper/{name}"
        of = self.type_of("SS", service)
        return service, of, self.peer.token("SC", service, of, RELIABLE)

    def heard(self, sample):
        message = ros.DiagnosticArray.deserialize(bytes(sample.payload))
        with self.peer.changed:
            self.diagnosed(message)
            self.peer.changed.notify_all()

    def until(self, reached, state):
        end = time.monotonic() + PATIENCE_S
        with self.peer.changed:
            while not reached():
                if not self.peer.changed.wait(end - time.monotonic()):
                    sys.exit(f"waited {PATIENCE_S} s in vain: {state()}")

    def ask(self, name, request, response, argument):
        from zenoh_peer import attachment, zenoh

        self.number += 1
        service, of, gid = self.asked[name]
        # The fields alone: who asks stands in the attachment.
        payload = request(0, 0, argument).serialize(use_version_2=False)
        payload = payload[:ENCAPSULATION] + payload[ENCAPSULATION + HEADER :]
        replies = self.peer.session.get(
            self.peer.key(service, of),
            payload=payload,
            attachment=attachment(self.number, gid),
            target=zenoh.QueryTarget.ALL_COMPLETE,
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=PATIENCE_S,
        )
        answers = [bytes(reply.ok.payload) for reply in replies if reply.ok]
        assert len(answers) == 1, f"{len(answers)} answers of {service}"
        padded = answers[0][:ENCAPSULATION] + bytes(HEADER) + answers[0][ENCAPSULATION:]
        answer = response.deserialize(padded)
        assert answer.success, answer.message

    def close(self):
        """Ends the session, whose threads would go on."""
        self.peer.session.close()


class Router:
    """A router of PyPI's Zenoh in a process of its own, and the settings by which nodes use it."""

    def __init__(self, port):
        self.endpoint = f"tcp/127.0.0.1:{port}"
        program = Path(__file__).with_name("zenoh_peer.py")
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
        self.process = subprocess.Popen([sys.executable, program, "router", self.endpoint], **pipes)
        assert self.process.stdout.readline() == "ready\n", "the router did not start"
        os.environ["RMW_IMPLEMENTATION"] = "rmw_zenoh_cpp"
        os.environ["ZENOH_CONFIG_OVERRIDE"] = f'connect/endpoints=["{self.endpoint}"]'
