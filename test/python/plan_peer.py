"""A client of the action compute_path_to_pose, as Nav2's behaviour tree is one.

    plan_peer.py DOMAIN DISTRIBUTION SCENARIO

Its first goal is canceled while it waits. Then it prints a line of JSON, sends the goals of the scenario, a JSON file,
and prints a line with their results.
"""

import faulthandler
import json
import math
import sys
from pathlib import Path

from cyclone_peer import PATIENCE_S, Calls, Peer, header, qos
import ros_idl as ros

ACTION = "compute_path_to_pose/_action"


def uuid(n):
    return ros.UUID([n] * 16)


def pose(at, yaw=0.0, frame="map"):
    turned = ros.Quaternion(0, 0, math.sin(yaw / 2), math.cos(yaw / 2))
    return ros.PoseStamped(header(0, frame), ros.Pose(ros.Point(*at), turned))


def yaw(turned):
    return 2 * math.atan2(turned.z, turned.w)


class Client:
    def __init__(self, domain, distribution):
        self.peer, self.plans = Peer(domain), []
        self.peer.reader("rt/plan", ros.Path, qos(10), self.plans.append)
        response = ros.plan_result_response(distribution)
        send, cancel = f"{ACTION}/send_goal", f"{ACTION}/cancel_goal"
        self.send = Calls(self.peer, send, ros.PlanSendRequest, ros.PlanSendResponse)
        self.cancel = Calls(self.peer, cancel, ros.CancelGoalRequest, ros.CancelGoalResponse)
        self.result = Calls(self.peer, f"{ACTION}/get_result", ros.PlanResultRequest, response)
        self.peer.until_matched()
        self.goals = 0

    def begin(self, at, yaw=0.0, frame="map", start=None):
        self.goals += 1
        goal = ros.PlanGoal(
            pose(at, yaw, frame), pose(start or [0, 0, 0]), "GridBased", start is not None
        )
        assert self.send.call(uuid(self.goals), goal).accepted
        return uuid(self.goals)

    def ended(self, goal):
        answer = self.result.call(goal)
        result = answer.result
        poses = [stamped.pose for stamped in result.path.poses]
        time = result.planning_time
        return {
            "status": answer.status,
            "code": result.error_code,
            "text": getattr(result, "error_msg", None),
            "frame": result.path.header.frame_id,
            "seconds": time.sec + 1e-9 * time.nanosec,
            "path": [
                [p.position.x, p.position.y, p.position.z, yaw(p.orientation)] for p in poses
            ],
        }


def main():
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    client = Client(int(sys.argv[1]), sys.argv[2])
    first = client.begin([5, 1, 0])
    canceled = client.cancel.call(ros.GoalInfo(first, ros.Time(0, 0)))
    ended = client.ended(first)
    print(json.dumps([canceled.return_code, ended["status"], ended["code"]]), flush=True)
    results = [
        client.ended(client.begin(**goal)) for goal in json.loads(Path(sys.argv[3]).read_text())
    ]
    found = sum(bool(result["path"]) for result in results)
    client.peer.until(lambda: len(client.plans) >= found, lambda: "no plan")
    lengths = [len(plan.poses) for plan in client.plans]
    print(json.dumps([results, lengths]), flush=True)


main()
