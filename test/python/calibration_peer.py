"""Peer of dds_calibration.rs: a headset, and a client of the service and the action `calibrate`.

    calibration_peer.py DIRECTORY     reads DIRECTORY/scenario.json, prints one line of JSON
"""

import faulthandler
import json
import sys
from pathlib import Path

from cyclone_peer import CLIENT, FLOAT32, PATIENCE_S, Calls, Peer, header, qos
import ros_idl as ros

UINT16 = 4
NONE, OK, REJECTED = 0, 1, 5
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
SERVER = "semantic_icp_server"


def cloud(stamp_ns, frame, data, labelled=True):
    """Rows of x, y, z in float32 and, if labelled, label in uint16."""
    fields = [ros.PointField(name, 4 * i, FLOAT32, 1) for i, name in enumerate("xyz")]
    step = 12
    if labelled:
        fields.append(ros.PointField("label", 12, UINT16, 1))
        step = 14
    width = len(data) // step
    return ros.PointCloud2(
        header(stamp_ns, frame), 1, width, fields, False, step, len(data), data, False
    )


class Headset:
    def __init__(self, domain, directory):
        self.directory, self.peer, self.stamp_s = directory, Peer(domain), 100
        self.results, self.transforms, self.tasks = {}, [], {}
        self.feedback, self.statuses = [], {}
        peer, latched, action = self.peer, qos(1, latched=True), f"{SERVER}/calibrate/_action"
        self.map = peer.writer("rt/points_enu", ros.PointCloud2, qos(5))
        self.points = peer.writer("rt/headset/points", ros.PointCloud2, qos(5))
        self.session = peer.writer("rt/headset/session", ros.String, latched)
        self.label_info = peer.writer("rt/headset/label_info", ros.LabelInfo, latched)
        peer.reader("rt/calibration", ros.CalibrationResult, latched, self.on_result)
        peer.reader("rt/tf", ros.TFMessage, qos(100), self.on_tf)
        peer.reader("rt/diagnostics", ros.DiagnosticArray, qos(10), self.on_diagnostics)
        peer.reader(f"rt/{action}/feedback", ros.FeedbackMessage, qos(10), self.on_feedback)
        peer.reader(f"rt/{action}/status", ros.GoalStatusArray, latched, self.on_status)
        self.service = Calls(
            peer, f"{SERVER}/calibrate", ros.CalibrateRequest, ros.CalibrateResponse
        )
        self.send = Calls(
            peer, f"{action}/send_goal", ros.SendGoalRequest, ros.SendGoalResponse
        )
        self.cancel = Calls(
            peer, f"{action}/cancel_goal", ros.CancelGoalRequest, ros.CancelGoalResponse
        )
        self.result = Calls(
            peer, f"{action}/get_result", ros.GetResultRequest, ros.GetResultResponse
        )
        peer.until_matched()

    def on_result(self, result):
        self.results[(result.session, result.header.stamp.sec, result.verdict)] = result

    def on_tf(self, message):
        for t in message.transforms:
            self.transforms.append((t.header.frame_id, t.child_frame_id, t.transform))

    def on_diagnostics(self, message):
        for status in message.status:
            self.tasks[status.name] = {v.key: v.value for v in status.values}

    def on_feedback(self, message):
        self.feedback.append((bytes(message.goal_id.uuid), message.feedback))

    def on_status(self, message):
        for goal in message.status_list:
            seen = self.statuses.setdefault(bytes(goal.goal_info.goal_id.uuid), [])
            if seen[-1:] != [goal.status]:
                seen.append(goal.status)

    def value(self, task, key):
        return self.tasks.get(task, {}).get(key)

    def look(self, name, verdict, session, frame="headset_origin", labelled=True):
        """Publishes a cloud and waits for the verdict on it."""
        self.stamp_s += 1
        data = (self.directory / name).read_bytes()
        self.points.write(cloud(self.stamp_s * 10**9, frame, data, labelled))
        key = (session, self.stamp_s, verdict)
        self.peer.until(
            lambda: key in self.results,
            lambda: f"{name}: expected {key}, heard {[(k, r.reason) for k, r in self.results.items()]}",
        )
        return self.results[key]

    def map_is_there(self, points):
        self.peer.until(
            lambda: self.value("lattice_mapper: map", "points_mapped") == str(points)
            and self.value("lattice_mapper: map", "voxels")
            == self.value(f"{SERVER}: calibration", "map_voxels"),
            lambda: f"{self.tasks}",
        )


def uuid(n):
    return ros.UUID([n] * 16)


def goal(session=""):
    nowhere = ros.Pose(ros.Point(0, 0, 0), ros.Quaternion(0, 0, 0, 1))
    return False, nowhere, session


def run(scenario, directory):
    headset = Headset(scenario["domain"], directory)
    found = {"refused": {}}
    headset.session.write(ros.String("one"))
    classes = [ros.VisionClass(1, "wall"), ros.VisionClass(2, "floor")]
    headset.label_info.write(ros.LabelInfo(header(0, "headset_origin"), classes, 0.5))
    headset.peer.until(
        lambda: any(key[0] == "one" for key in headset.results), lambda: "no word on the session"
    )
    found["no_map"] = headset.look("good", REJECTED, "one").reason
    data = (directory / "map").read_bytes()
    headset.map.write(cloud(1, "map", data))
    headset.map_is_there(len(data) // 14)

    first = headset.look("good", OK, "one")
    found["duration_s"] = [first.duration_s]
    found["transform"] = transform(first.transform)
    found["covariance"] = list(first.covariance)
    found["frames"] = [first.header.frame_id, first.child_frame_id, first.session]
    for name, options in {
        "mirrored": {},
        "empty": {},
        "unlabelled": {"labelled": False},
        "nan": {},
        "large": {},
        "good": {"frame": "hololens"},
    }.items():
        refused = headset.look(name, REJECTED, "one", **options)
        found["refused"][options.get("frame", name)] = refused.reason
        found["duration_s"].append(headset.look("good", OK, "one").duration_s)
    headset.transforms.clear()
    headset.peer.until(lambda: headset.transforms, lambda: "no transform")
    parent, child, last = headset.transforms[-1]
    found["tf"] = [parent, child, transform(last)]

    answer = headset.service.call(*goal("one"))
    found["service"] = [answer.success, answer.result.verdict, transform(answer.result.transform)]
    answer = headset.service.call(*goal("two"))
    found["other_session"] = [answer.success, answer.message]

    # Two at a time: the second is refused, and its answer does not wait for that of the first.
    accepted = [headset.send.begin(uuid(n), ros.Goal(*goal())) for n in (1, 2)]
    found["accepted"] = [headset.send.wait(n).accepted for n in accepted]
    first, second = [headset.result.begin(uuid(n)) for n in (1, 2)]
    second, first = headset.result.wait(second), headset.result.wait(first)
    found["busy"] = [second.status, second.result.message]
    found["action"] = [
        first.status,
        first.result.success,
        transform(first.result.result.transform),
    ]
    found["again"] = headset.result.call(uuid(1)).status
    found["stages"] = [f.stage for id, f in headset.feedback if id == bytes([1] * 16)]
    found["fractions"] = [f.fraction for id, f in headset.feedback if id == bytes([1] * 16)]
    found["unknown"] = [
        headset.result.call(uuid(99)).status,
        headset.cancel.call(ros.GoalInfo(uuid(99), ros.Time(0, 0))).return_code,
    ]
    found["terminated"] = headset.cancel.call(ros.GoalInfo(uuid(1), ros.Time(0, 0))).return_code

    for n in range(10, 20):
        # A search may end before it is canceled; not every time.
        assert headset.send.call(uuid(n), ros.Goal(*goal())).accepted
        waiting = headset.result.begin(uuid(n))
        answer = headset.cancel.call(ros.GoalInfo(uuid(n), ros.Time(0, 0)))
        if answer.return_code == 0:
            break
        headset.result.wait(waiting)
    found["canceling"] = [bytes(g.goal_id.uuid) == bytes([n] * 16) for g in answer.goals_canceling]
    ended = headset.result.wait(waiting)
    found["canceled"] = [ended.status, ended.result.success, ended.result.result.verdict]
    headset.peer.until(
        lambda: headset.statuses.get(bytes([n] * 16), [])[-1:] == [CANCELED],
        lambda: f"{headset.statuses}",
    )
    # It still knows where the headset is.
    headset.look("mirrored", REJECTED, "one")
    headset.look("good", OK, "one")

    headset.session.write(ros.String("two"))
    headset.peer.until(
        lambda: any((k[0], k[2]) == ("two", NONE) for k in headset.results),
        lambda: "no word on the new session",
    )
    found["second_session"] = headset.look("good", OK, "two").method
    task = f"{SERVER}: calibration"
    headset.peer.until(
        lambda: headset.value(task, "sessions") == "2" and headset.value(task, "method"),
        lambda: f"{headset.tasks}",
    )
    found["diagnostics"] = headset.tasks[task]
    return found


def transform(t):
    p, q = t.translation, t.rotation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


def main():
    # Whatever hangs, the test ends.
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    directory = Path(sys.argv[1])
    scenario = json.loads((directory / "scenario.json").read_text())
    print(json.dumps(run(scenario, directory)), flush=True)


main()
