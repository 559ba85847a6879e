"""Fresh clients of one service over CycloneDDS, each a participant of its own.

    service_clients.py DOMAIN SERVICE COUNT     prints one line of JSON

A client makes the reader of the reply once it knows the server, and asks at once: the request overtakes
the discovery of that reader.
"""

import json
import statistics
import sys
import time

from cyclone_peer import Peer, qos
import ros_idl as ros
from cyclonedds.util import duration

# For a match, and for a reply: one that takes longer is lost.
PATIENCE_S = 10


def wait(peer, reached):
    end = time.monotonic() + PATIENCE_S
    peer.turn()
    while not reached() and (left := end - time.monotonic()) > 0:
        peer.waits.wait(duration(seconds=left))
        peer.turn()
    return reached()


def call(domain, service, number):
    """Time to the reply, s; none if there was none."""
    peer, replies = Peer(domain), []
    request = f"rq/{service}Request"
    writer = peer.writer(request, ros.TriggerRequest, qos(10))
    if not wait(peer, lambda: peer.matched.get(request)):
        sys.exit(f"client {number} does not find the server")
    peer.reader(f"rr/{service}Reply", ros.TriggerResponse, qos(10), replies.append)
    start = time.monotonic()
    writer.write(ros.TriggerRequest(number, 1, 0))
    answered = wait(peer, lambda: any(reply.client == number for reply in replies))
    return time.monotonic() - start if answered else None


def main():
    domain, service, count = int(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    times = [call(domain, service, number) for number in range(1, count + 1)]
    heard = [taken for taken in times if taken is not None]
    print(json.dumps({
        "lost": len(times) - len(heard),
        "median_s": statistics.median(heard),
        "max_s": max(heard),
    }))


if __name__ == "__main__":
    main()
