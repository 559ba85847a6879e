"""A client of the services of `bag_player`, whose log is held at first; it stops the player at the end.

    player_peer.py DOMAIN FIRST_NS     prints one line of JSON: what it asked, and the answers
"""

import faulthandler
import json
import sys

from cyclone_peer import PATIENCE_S, Calls, Peer, qos
import ros_idl as ros
from cyclonedds.idl.types import float64, uint64


def service(name, *fields):
    return ros.service(f"rosbag2_interfaces/srv/{name}", *fields)


SUCCESS = {"success": bool}
SERVICES = {
    "pause": service("Pause"),
    "resume": service("Resume"),
    "toggle_paused": service("TogglePaused"),
    "stop": service("Stop"),
    "is_paused": service("IsPaused", None, {"paused": bool}),
    "get_rate": service("GetRate", None, {"rate": float64}),
    "set_rate": service("SetRate", {"rate": float64}, SUCCESS),
    "play_next": service("PlayNext", None, SUCCESS),
    "burst": service("Burst", {"num_messages": uint64}, {"actually_burst": uint64}),
    "play": service(
        "Play", {"start": ros.Time, "duration": ros.Duration, "until": ros.Time}, SUCCESS
    ),
    "seek": service("Seek", {"time": ros.Time}, SUCCESS),
}


class Player:
    def __init__(self, domain):
        self.peer, self.times_ns, self.transforms = Peer(domain), [], 0
        self.peer.reader("rt/clock", ros.Clock, qos(10), self.on_clock)
        self.peer.reader("rt/tf", ros.TFMessage, qos(1000), self.on_transforms)
        self.calls = {
            name: Calls(self.peer, f"bag_player/{name}", *types)
            for name, types in SERVICES.items()
        }
        self.peer.until_matched()

    def on_clock(self, message):
        self.times_ns.append(message.clock.sec * 10**9 + message.clock.nanosec)

    def on_transforms(self, message):
        self.transforms += len(message.transforms)

    def ask(self, name, *fields):
        """The only field of an answer."""
        answer = self.calls[name].call(*(fields or (0,)))
        return next(value for key, value in vars(answer).items() if key not in ros.ASKED)

    def time_ns(self):
        """The next time on /clock, which comes while the log is held too."""
        self.times_ns.clear()
        self.peer.until(lambda: self.times_ns, lambda: "no time on /clock")
        return self.times_ns[-1]


def time(ns):
    return ros.Time(ns // 10**9, ns % 10**9)


def main():
    faulthandler.dump_traceback_later(4 * PATIENCE_S, exit=True)
    first_ns, player, said = int(sys.argv[2]), Player(int(sys.argv[1])), []

    def ask(name, *fields):
        said.append([name, player.ask(name, *fields)])

    ask("is_paused")
    # What was sent on the way to a held player is heard twice: time stands.
    assert player.time_ns() == player.time_ns() == first_ns
    for rate in (0.0, 1e9, 2.0):
        ask("set_rate", rate)
    ask("get_rate")
    ask("play_next")
    ask("burst", 500)
    later_ns = player.time_ns()
    assert first_ns < later_ns == player.time_ns() < first_ns + 2 * 10**9
    player.peer.until(lambda: player.transforms > 0, lambda: "nothing was played")
    for place_ns in (first_ns - 1, first_ns + 3600 * 10**9, first_ns + 2 * 10**9):
        ask("seek", time(place_ns))
    assert player.time_ns() == first_ns + 2 * 10**9
    ask("toggle_paused")
    ask("play_next")
    ask("pause")
    ask("is_paused")
    held_ns = player.time_ns()
    assert first_ns + 2 * 10**9 < held_ns == player.time_ns()
    ask("resume")
    ask("is_paused")
    player.peer.until(lambda: player.times_ns[-1] > held_ns, lambda: "time stands")
    ask("play", time(0), ros.Duration(0, 0), time(0))
    ask("pause")
    ask("play", time(3600 * 10**9), ros.Duration(0, 0), time(0))
    ask("play", time(10**9), ros.Duration(2, 0), time(0))
    player.peer.until(
        lambda: player.times_ns[-1] < first_ns + 2 * 10**9, lambda: "time does not go back"
    )
    ask("pause")
    ask("stop")
    print(json.dumps(said))


if __name__ == "__main__":
    main()
