"""Sends or receives prepared buffers over Zenoh, as z_perf does, for test/peers/transport.

    zenoh_load.py pub ENDPOINT BYTES RATE_HZ COUNT     waits for the receiver, and sends
    zenoh_load.py sub ENDPOINT COUNT                   prints a line of JSON when all came, or nothing for 2 s
"""

import json
import queue
import sys
import time

import zenoh

KEY = "load"


def session(endpoint):
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    return zenoh.open(config)


def publish(endpoint, size, rate_hz, count):
    with session(endpoint) as opened:
        publisher = opened.declare_publisher(
            KEY, congestion_control=zenoh.CongestionControl.BLOCK, reliability=zenoh.Reliability.RELIABLE
        )
        while not publisher.matching_status.matching:
            time.sleep(0.01)
        rest = bytes(size - 8)
        due = time.monotonic()
        for _ in range(count):
            due += 1 / rate_hz
            time.sleep(max(0, due - time.monotonic()))
            publisher.put(time.time_ns().to_bytes(8, "little") + rest)


def subscribe(endpoint, count):
    with session(endpoint) as opened:
        heard = queue.Queue()

        def hear(sample):
            sent_ns = int.from_bytes(sample.payload.to_bytes()[:8], "little")
            heard.put((time.time_ns() - sent_ns) / 1e6)

        subscriber = opened.declare_subscriber(KEY, hear)
        times_ms = [heard.get(timeout=60)]
        while len(times_ms) < count:
            try:
                times_ms.append(heard.get(timeout=2))
            except queue.Empty:
                break
        times_ms.sort()
        told = {"heard": len(times_ms)}
        told["median_ms"], told["p99_ms"] = (times_ms[int(share * (len(times_ms) - 1))] for share in (0.5, 0.99))
        print(json.dumps(told), flush=True)
        subscriber.undeclare()


if sys.argv[1] == "pub":
    publish(sys.argv[2], int(sys.argv[3]), float(sys.argv[4]), int(sys.argv[5]))
else:
    subscribe(sys.argv[2], int(sys.argv[3]))
