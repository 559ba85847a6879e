"""A client of octomap_server over Cyclone DDS: latched octrees, and the services of the same names.

    octomap_peer.py DOMAIN     prints one line of JSON: id, resolution and bytes of each octree, by topic and service
"""

import faulthandler
import json
import sys

import ros_idl as ros
from cyclone_peer import PATIENCE_S, Calls, Peer, qos

NAMES = ("octomap_binary", "octomap_full")


def shown(octomap):
    return [octomap.id, octomap.binary, octomap.resolution, octomap.header.frame_id, len(octomap.data)]


def main():
    faulthandler.dump_traceback_later(2 * PATIENCE_S, exit=True)
    peer, heard = Peer(int(sys.argv[1])), {}
    request, response = ros.service("octomap_msgs/srv/GetOctomap", None, {"map": ros.Octomap})
    calls = {name: Calls(peer, name, request, response) for name in NAMES}
    for name in NAMES:
        peer.reader(
            f"rt/{name}",
            ros.Octomap,
            qos(1, latched=True),
            lambda octomap, name=name: heard.update({name: octomap}),
        )
    peer.until_matched()
    peer.until(lambda: len(heard) == len(NAMES), lambda: f"octrees heard: {list(heard)}")
    result = {name: [shown(octomap)] for name, octomap in heard.items()}
    for name, call in calls.items():
        answer = call.call(0).map
        assert list(answer.data) == list(heard[name].data), name
        result[name].append(shown(answer))
    print(json.dumps(result))


main()
