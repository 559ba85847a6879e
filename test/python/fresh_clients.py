"""Fresh participants of rclpy over Fast DDS that call a service of ours, or serve one.

    fresh_clients.py ask DOMAIN COUNT     COUNT participants, one after the other; prints one line of JSON
    fresh_clients.py serve DOMAIN         until it is killed

A request "NUMBER:LENGTH" is answered by a body of that length, its CRC-32 and the number. The first request of a
participant is sent as soon as it has found the server, which may not have found its reply reader yet.
"""

import faulthandler
import json
import os
import statistics
import sys
import time
import zlib

os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import GetParameters
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

LENGTHS = [1, 100, 1300, 5000, 60_000, 300_000]
# To find the server, and for a reply: one that takes longer is lost.
PATIENCE_S = 30


def ask(domain, participant):
    """Times to the replies, s; none for each that was lost or wrong."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node(
        f"client_{participant}", context=context, start_parameter_services=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    client = node.create_client(GetParameters, "/server/answer")
    end = time.monotonic() + PATIENCE_S
    while not client.service_is_ready():
        assert time.monotonic() < end, f"client {participant} does not find the server"
        executor.spin_once(timeout_sec=0.001)
    times = []
    # A different length first for each.
    for turn in range(len(LENGTHS)):
        length = LENGTHS[(participant + turn) % len(LENGTHS)]
        number = participant * len(LENGTHS) + turn
        start = time.monotonic()
        future = client.call_async(GetParameters.Request(names=[f"{number}:{length}"]))
        executor.spin_until_future_complete(future, timeout_sec=PATIENCE_S)
        took = time.monotonic() - start
        whole = future.done() and is_whole(future.result(), number, length)
        if not whole:
            print(f"client {participant}, call {turn}, {length} B: "
                  f"{'wrong' if future.done() else 'no reply'}", file=sys.stderr)
        times.append(took if whole else None)
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown(context=context)
    return times


def is_whole(answer, number, length):
    body, crc, of = answer.values
    data = body.string_value.encode()
    return (len(data), zlib.crc32(data), of.integer_value) == (length, crc.integer_value, number)


def answer(request, response):
    number, length = map(int, request.names[0].split(":"))
    data = "".join(chr(97 + (number + i * i) % 26) for i in range(min(length, 676)))
    data = (data * (length // len(data) + 1))[:length]
    response.values = [
        ParameterValue(string_value=data),
        ParameterValue(integer_value=zlib.crc32(data.encode())),
        ParameterValue(integer_value=number),
    ]
    return response


def serve(domain):
    rclpy.init(domain_id=domain)
    node = rclpy.create_node("server", start_parameter_services=False)
    node.create_service(GetParameters, "/server/answer", answer)
    rclpy.spin(node)


def main():
    mode, domain = sys.argv[1], int(sys.argv[2])
    if mode == "serve":
        return serve(domain)
    count = int(sys.argv[3])
    faulthandler.dump_traceback_later(60 + 20 * count, exit=True)
    calls = [ask(domain, participant) for participant in range(count)]
    times = [took for of_one in calls for took in of_one]
    heard = [took for took in times if took is not None]
    print(json.dumps({
        "calls": len(times),
        "lost": len(times) - len(heard),
        "median_s": statistics.median(heard),
        "first_median_s": statistics.median(one[0] for one in calls if one[0] is not None),
        "max_s": max(heard),
    }))


main()
