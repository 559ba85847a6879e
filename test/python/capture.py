"""Counts texts in the datagrams on loopback.

    capture.py TEXT...     prints "ready", or "refused" where it may not capture

For each line on standard input it prints the numbers of datagrams with each of the texts since the last one.
"""

import json
import select
import socket
import sys

ALL_PROTOCOLS = 3


def main():
    texts = [text.encode() for text in sys.argv[1:]]
    try:
        loopback = socket.socket(socket.AF_PACKET, socket.SOCK_DGRAM, socket.htons(ALL_PROTOCOLS))
    except PermissionError:
        print("refused", flush=True)
        return
    loopback.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 32 << 20)
    loopback.bind(("lo", 0))
    print("ready", flush=True)
    counts, asked = [0] * len(texts), False
    while True:
        # What was sent on loopback is here already.
        ready, _, _ = select.select([loopback, sys.stdin], [], [], 0 if asked else None)
        if loopback in ready:
            datagram, origin = loopback.recvfrom(1 << 16)
            # Loopback shows each datagram twice: as it goes out and as it comes in.
            if origin[2] == socket.PACKET_OUTGOING:
                continue
            for i, text in enumerate(texts):
                counts[i] += text in datagram
        elif sys.stdin in ready:
            if not sys.stdin.readline():
                return
            asked = True
        if asked and loopback not in ready:
            print(json.dumps(counts), flush=True)
            counts, asked = [0] * len(texts), False


if __name__ == "__main__":
    main()
