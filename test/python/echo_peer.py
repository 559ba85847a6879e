"""Peer of a test that stops it: has a latched map, and repeats what it hears until it is killed.

    echo_peer.py DOMAIN
"""

import sys

from cyclone_peer import PATIENCE_S, Peer, qos
from cyclonedds.util import duration
import ros_idl as ros

String = ros.ros("std_msgs/msg/String", data=str)
peer = Peer(int(sys.argv[1]))
maps = peer.writer("rt/map", String, qos(1, latched=True))
said = peer.writer("rt/said", String, qos(10))
peer.reader("rt/heard", String, qos(10), said.write)
maps.write(String("map"))
while peer.waits.wait(duration(seconds=PATIENCE_S)):
    peer.turn()
