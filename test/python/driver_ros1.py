"""ROS 1 bags of messages in CDR, written by rosbags."""

from pathlib import Path

from rosbags.rosbag1 import Writer

from driver_messages import STORE

# Length of the first line and the first record of a bag.
HEADER_BYTES = 13 + 4096


def write_ros1(folder, marks, topics, messages):
    """Writes messages in order of time to bags in a folder.

    Marks: bz2 or lz4; split: a second file from the middle on; active: as a killed recorder leaves it, without index.
    """
    Path(folder).mkdir(parents=True)
    half = len(messages) // 2 if "split" in marks else len(messages)
    for number, part in enumerate([messages[:half], messages[half:]]):
        if part:
            path = Path(folder) / f"drive_{number}.bag"
            write_bag(path, marks, topics, part)
            if "active" in marks:
                cut_index(path)
                path.rename(path.with_suffix(".bag.active"))


def write_bag(path, marks, topics, messages):
    writer = Writer(path)
    for compression in {"bz2", "lz4"}.intersection(marks):
        writer.set_compression(Writer.CompressionFormat[compression.upper()])
    # Several chunks.
    writer.chunk_threshold = 1 << 17
    with writer:
        connections = {
            topic: writer.add_connection(
                topic,
                kind,
                **definition(kind),
                callerid="/driver",
                latching=int(offered.durability.name == "TRANSIENT_LOCAL"),
            )
            for topic, (kind, offered) in topics.items()
        }
        for at_ns, topic, data in messages:
            kind = topics[topic][0]
            writer.write(connections[topic], at_ns, STORE.cdr_to_ros1(data, kind))


def definition(kind):
    """Definition of ROS 1, whose header has a number; serialization by rosbags has it as well."""
    text, md5sum = STORE.generate_msgdef(kind)
    mark = "MSG: std_msgs/Header\n"
    return {"msgdef": text.replace(mark, f"{mark}uint32 seq\n"), "md5sum": md5sum}


def cut_index(path):
    """Removes the index and what the first record says of it."""
    whole = bytearray(path.read_bytes())
    at = whole.index(b"index_pos=") + len(b"index_pos=")
    index = int.from_bytes(whole[at : at + 8], "little")
    assert HEADER_BYTES < index < len(whole)
    whole[at : at + 8] = bytes(8)
    for count in (b"conn_count=", b"chunk_count="):
        at = whole.index(count) + len(count)
        whole[at : at + 4] = bytes(4)
    path.write_bytes(whole[:index])
