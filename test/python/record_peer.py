"""Publishers of a recording, and a reader of it by the package rosbags.

    record_peer.py talk DOMAIN     publishes once all topics are heard, and prints what it said
    record_peer.py read FOLDER     prints what the bag holds; the types are those that the bag defines
"""

import json
import sys
from pathlib import Path

COUNT = 300


def talk(domain):
    from cyclone_peer import Peer, qos
    from cyclonedds.idl.types import float64, sequence, uint16
    from cyclonedds.util import duration
    import ros_idl as ros

    String = ros.ros("std_msgs/msg/String", data=str)
    Load = ros.ros("pit/msg/Load", name=str, mass_kg=float64, marks=sequence[uint16])
    peer, said = Peer(int(domain)), {"/said": [], "/pit/load": [], "/latched": []}
    latched = peer.writer("rt/latched", String, qos(1, latched=True))
    latched.write(String("kept"))
    said["/latched"].append(["kept"])
    strings = peer.writer("rt/said", String, qos(COUNT))
    loads = peer.writer("rt/pit/load", Load, qos(COUNT))
    peer.until_matched()
    # The test says when the recorder is ready, too.
    print("matched", flush=True)
    sys.stdin.readline()
    for number in range(COUNT):
        text, marks = "x" * (number % 50) + str(number), list(range(number % 7))
        strings.write(String(text))
        said["/said"].append([text])
        loads.write(Load(f"truck {number}", number / 3, marks))
        said["/pit/load"].append([f"truck {number}", number / 3, marks])
    for writer in (strings, loads):
        assert writer.wait_for_acks(duration(seconds=60)), "not acknowledged"
    return said


def read(folder):
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store, found = get_typestore(Stores.EMPTY), {}

    def plain(value):
        return value.tolist() if hasattr(value, "tolist") else value

    with Reader(Path(folder)) as reader:
        for connection in reader.connections:
            for name, types in get_types_from_msg(
                connection.msgdef.data, connection.msgtype
            ).items():
                if name not in store.types:
                    store.register({name: types})
            found[connection.topic] = []
        for connection, _, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            fields = vars(message).items()
            values = [plain(value) for name, value in fields if not name.startswith("__")]
            found[connection.topic].append(values)
    return found


print(json.dumps({"talk": talk, "read": read}[sys.argv[1]](sys.argv[2])), flush=True)
