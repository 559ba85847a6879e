"""Reads what it can of damaged storage files, message by message, with nothing of Lattice.

damaged_bags.py ROWS FILE...   prints for each file a list of [topic, log time, bytes, hash]
"""

import json
import sqlite3
import struct
import sys


def number(data):
    """The number that the bytes spell, modulo 2^61 - 1; the Rust side computes it too."""
    return int.from_bytes(b"\x01" + bytes(data), "big") % (2**61 - 1)


def sqlite_rows(path, rows):
    """Rows 1 to `rows` by their ids, each asked for alone."""
    found = []
    try:
        with sqlite3.connect(f"file:{path}?mode=ro&immutable=1", uri=True) as connection:
            names = {}
            for topic in range(1, 10):
                try:
                    select = "SELECT name FROM topics WHERE id = ?"
                    for (name,) in connection.execute(select, (topic,)):
                        names[topic] = name
                except sqlite3.Error:
                    pass
            for row in range(1, rows + 1):
                try:
                    select = "SELECT topic_id, timestamp, data FROM messages WHERE id = ?"
                    for topic, time, data in connection.execute(select, (row,)):
                        if topic in names:
                            found.append([names[topic], time, len(data), number(data)])
                except (sqlite3.Error, TypeError):
                    pass
    except sqlite3.Error:
        pass
    return found


def records(data, start, end):
    """Records of MCAP: place, opcode, body; ends at the first that is none."""
    at = start
    while at + 9 <= end:
        opcode, size = struct.unpack_from("<BQ", data, at)
        if not 1 <= opcode <= 15 or at + 9 + size > end:
            return
        yield at, opcode, data[at + 9 : at + 9 + size]
        at += 9 + size


def next_chunk(data, start):
    """Place of the next chunk whose lengths agree."""
    at = data.find(b"\x06", start)
    while at >= 0:
        if at + 53 <= len(data):
            (size,) = struct.unpack_from("<Q", data, at + 1)
            name, content = struct.unpack_from("<IQ", data, at + 37)
            if name == 0 and size == content + 40 and at + 9 + size <= len(data):
                return at
        at = data.find(b"\x06", at + 1)
    return None


def mcap_messages(path):
    with open(path, "rb") as file:
        data = file.read()
    channels, found = {}, []

    def take(opcode, body):
        try:
            if opcode == 4:
                channel, _, size = struct.unpack_from("<HHI", body)
                channels.setdefault(channel, body[8 : 8 + size].decode())
            elif opcode == 5:
                channel, _, time, _ = struct.unpack_from("<HIQQ", body)
                found.append([channel, time, len(body) - 22, number(body[22:])])
            elif opcode == 6:
                for _, inner, content in records(body, 40, len(body)):
                    take(inner, content)
        except (struct.error, UnicodeDecodeError):
            pass

    start = 8
    while start is not None:
        last, ended = start - 1, False
        for at, opcode, body in records(data, start, len(data)):
            take(opcode, body)
            last, ended = at, opcode == 2
        start = None if ended else next_chunk(data, max(last + 1, start + 1))
    return [[channels[m[0]], *m[1:]] for m in found if m[0] in channels]


def main():
    rows, files = int(sys.argv[1]), sys.argv[2:]
    for path in files:
        is_sqlite = path.endswith(".db3")
        print(json.dumps(sqlite_rows(path, rows) if is_sqlite else mcap_messages(path)))


main()
