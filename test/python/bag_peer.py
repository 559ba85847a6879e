"""Writes and reads rosbag2 bags with the package rosbags, and tells what is in them as JSON.

bag_peer.py write FOLDER mcap|sqlite3 8|9 none|file|message|storage
bag_peer.py read FOLDER
"""

import json
import sys
from pathlib import Path

from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

START_NS = 1_700_000_000_000_000_000
FOREVER = QosTime(9223372036, 854775807)


def number(data):
    """The number that the bytes spell, modulo 2^61 - 1; the Rust side computes it too."""
    return int.from_bytes(b"\x01" + bytes(data), "big") % (2**61 - 1)


def qos(depth, durability):
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        QosReliability.RELIABLE,
        durability,
        FOREVER,
        FOREVER,
        QosLiveliness.AUTOMATIC,
        FOREVER,
        False,
    )


def write(folder, storage, version, compression):
    store = get_typestore(Stores.ROS2_JAZZY)
    string = store.types["std_msgs/msg/String"]
    with_custom = Writer(
        folder, version=int(version), storage_plugin=StoragePlugin[storage.upper()]
    )
    with_custom.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with_custom.set_custom_data("site", "pit")
    with with_custom as writer:
        latched = writer.add_connection(
            "/latched",
            "std_msgs/msg/String",
            typestore=store,
            offered_qos_profiles=[qos(1, QosDurability.TRANSIENT_LOCAL)] * 2,
        )
        plain = writer.add_connection(
            "/plain",
            "std_msgs/msg/String",
            typestore=store,
            offered_qos_profiles=[qos(5, QosDurability.VOLATILE)],
        )
        for i in range(300):
            # Large enough for several chunks, and not in order of time.
            text = string(data=f"{i} " + "abcdefgh" * (i * 5))
            data = bytes(store.serialize_cdr(text, "std_msgs/msg/String"))
            time_ns = START_NS + (i ^ 3) * 1_000_000
            writer.write(latched if i % 100 == 0 else plain, time_ns, data)


def read(folder):
    with Reader(folder) as reader:
        topics = [
            {
                "name": c.topic,
                "type": c.msgtype,
                "count": c.msgcount,
                "latched": [
                    q.durability == QosDurability.TRANSIENT_LOCAL
                    for q in c.ext.offered_qos_profiles
                ],
                "depths": [q.depth for q in c.ext.offered_qos_profiles],
                "definition": number(c.msgdef.data.encode()),
                "type_hash": c.digest,
            }
            for c in reader.connections
        ]
        messages = [
            [c.topic, time_ns, len(data), number(data)] for c, time_ns, data in reader.messages()
        ]
        return {
            "topics": topics,
            "messages": messages,
            "start_ns": reader.start_time,
            "end_ns": reader.end_time - 1,
            "message_count": reader.message_count,
        }


def main():
    match sys.argv[1:]:
        case ["write", folder, storage, version, compression]:
            write(Path(folder), storage, version, compression)
            told = read(Path(folder))
        case ["read", folder]:
            told = read(Path(folder))
        case _:
            sys.exit(__doc__)
    json.dump(told, sys.stdout)


if __name__ == "__main__":
    main()
