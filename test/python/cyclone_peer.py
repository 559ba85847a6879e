"""A CycloneDDS participant that knows of Lattice only the ROS messages, for the peers of the tests."""

import os
import sys
import time

# Loopback only and without multicast, which loopback has not on most machines.
os.environ["CYCLONEDDS_URI"] = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>20</MaxAutoParticipantIndex>
<Peers><Peer Address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""

import ros_idl as ros
from cyclonedds.core import DDSStatus, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

# A test that passes does not wait for it.
PATIENCE_S = 120
FLOAT32 = 7
CLIENT = 0x0123_4567_89AB_CDEF


def qos(depth, latched=False):
    durability = Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=10)),
        Policy.History.KeepLast(depth),
        durability,
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )


class Peer:
    """A participant that waits for what happens at its endpoints."""

    def __init__(self, domain):
        self.participant = DomainParticipant(domain)
        self.waits = WaitSet(self.participant)
        self.readers, self.writers, self.matched = {}, {}, {}

    def writer(self, topic, message, qos):
        writer = DataWriter(self.participant, Topic(self.participant, topic, message), qos)
        writer.set_status_mask(DDSStatus.PublicationMatched)
        self.waits.attach(writer)
        self.writers[topic] = writer
        return writer

    def reader(self, topic, message, qos, handler):
        reader = DataReader(self.participant, Topic(self.participant, topic, message), qos)
        return self.attach(topic, reader, handler)

    def attach(self, topic, reader, handler):
        reader.set_status_mask(DDSStatus.DataAvailable | DDSStatus.SubscriptionMatched)
        self.waits.attach(reader)
        self.readers[topic] = (reader, handler)
        return reader

    def turn(self):
        """Takes everything that is there; what was looked at no longer wakes the waitset."""
        for topic, (reader, handler) in self.readers.items():
            self.matched[topic] = reader.get_subscription_matched_status().current_count
            # Taking resets the status even where it leaves samples.
            while samples := reader.take(N=50):
                for sample in samples:
                    if sample.sample_info.valid_data:
                        handler(sample)
        for topic, writer in self.writers.items():
            self.matched[topic] = writer.get_publication_matched_status().current_count

    def until(self, reached, state):
        """Waits for events until `reached`; else dies with what `state` says."""
        end = time.monotonic() + PATIENCE_S
        self.turn()
        while not reached():
            left = end - time.monotonic()
            if left <= 0:
                sys.exit(f"{sys.argv[0]} waited {PATIENCE_S} s in vain: {state()}")
            self.waits.wait(duration(seconds=left))
            self.turn()

    def until_matched(self):
        self.until(
            lambda: len(self.matched) > 0 and all(self.matched.values()),
            lambda: f"endpoints matched: {self.matched}",
        )


class Calls:
    """Requests of one service and the answers that have come, by number."""

    def __init__(self, peer, name, request, response):
        self.peer, self.request, self.number, self.answers = peer, request, 0, {}
        self.name = name
        self.writer = peer.writer(f"rq/{name}Request", request, qos(10))
        peer.reader(f"rr/{name}Reply", response, qos(10), self.hear)

    def hear(self, answer):
        if answer.client == CLIENT:
            assert answer.number not in self.answers, f"{self.name}: answered twice"
            self.answers[answer.number] = answer

    def begin(self, *fields):
        self.number += 1
        self.writer.write(self.request(CLIENT, self.number, *fields))
        return self.number

    def wait(self, number):
        self.peer.until(lambda: number in self.answers, lambda: f"no answer of {self.name}")
        return self.answers[number]

    def call(self, *fields):
        return self.wait(self.begin(*fields))


def header(stamp_ns, frame):
    return ros.Header(ros.Time(stamp_ns // 10**9, stamp_ns % 10**9), frame)
