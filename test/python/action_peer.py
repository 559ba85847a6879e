"""An action client of rclpy over the Fast DDS of ROS 2 Jazzy.

    action_peer.py SCENARIO     a JSON file; prints one line of JSON with what became of its goals
"""

import faulthandler
import json
import os
import sys
import time
from pathlib import Path

# Read while rclpy is loaded.
os.environ["RMW_IMPLEMENTATION"] = "rmw_fastrtps_cpp"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from test_msgs.action import Fibonacci

PATIENCE_S = 60


class Peer(Node):
    def __init__(self):
        super().__init__("peer", start_parameter_services=False)
        self.feedback = []
        self.client = ActionClient(self, Fibonacci, "/fibonacci")

    def until(self, holds, what):
        end = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end, what
            rclpy.spin_once(self, timeout_sec=0.1)

    def wait(self, future, what):
        self.until(future.done, what)
        return future.result()

    def on_feedback(self, message):
        self.feedback.append(list(message.feedback.sequence))

    def send(self, order):
        goal = self.client.send_goal_async(Fibonacci.Goal(order=order), self.on_feedback)
        return self.wait(goal, f"goal {order}")

    def result(self, goal):
        return self.wait(goal.get_result_async(), "result")


def sequence(order):
    found = [0, 1]
    while len(found) < order:
        found.append(found[-1] + found[-2])
    return found


def main():
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    scenario = json.loads(Path(sys.argv[1]).read_text())
    rclpy.init(domain_id=scenario["domain"])
    peer = Peer()
    peer.until(peer.client.server_is_ready, "no server")
    said = {"rejected": not peer.send(1).accepted, "reached": 0}
    start = time.monotonic()
    for count in range(scenario["goals"]):
        order = 3 + count % 20
        goal = peer.send(order)
        answer = peer.result(goal)
        is_right = list(answer.result.sequence) == sequence(order)
        said["reached"] += answer.status == GoalStatus.STATUS_SUCCEEDED and is_right
    said["seconds"] = time.monotonic() - start
    said["feedback"] = len(peer.feedback)
    peer.feedback.clear()
    goal = peer.send(scenario["endless"])
    peer.until(lambda: peer.feedback, "no feedback")
    answer = peer.wait(goal.cancel_goal_async(), "cancel")
    ended = peer.result(goal)
    found = list(ended.result.sequence)
    said["canceled"] = [answer.return_code, len(answer.goals_canceling), ended.status, found]
    print(json.dumps(said))


main()
