"""A peer over Zenoh that keeps the conventions of rmw_zenoh by itself, and a router.

    zenoh_peer.py router ENDPOINT            routes until its input ends
    zenoh_peer.py meet ENDPOINT DOMAIN       speaks with the node /ours, and prints a line of JSON
"""

import json
import os
import struct
import sys
import threading
import time
import traceback

import xxhash
import zenoh
from zenoh import ext

PATIENCE_S = 60
STRING = "std_msgs::msg::dds_::String_"
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
TRIGGER = "std_srvs::srv::dds_::Trigger_"
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
RELIABLE = "::,10:,:,:,,"
LATCHED = ":1:,1:,:,:,,"


def config(mode, endpoint):
    made = zenoh.Config()
    made.insert_json5("mode", json.dumps(mode))
    made.insert_json5("scouting/multicast/enabled", "false")
    made.insert_json5("timestamping/enabled", "true")
    where = "listen" if mode == "router" else "connect"
    made.insert_json5(f"{where}/endpoints", json.dumps([endpoint]))
    if mode == "peer":
        made.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
    return made


def gid(token):
    """Low half of XXH3-128 first, each in little-endian order."""
    return xxhash.xxh3_128_intdigest(token.encode()).to_bytes(16, "little")


def attachment(number, of):
    return struct.pack("<qqB", number, time.time_ns(), 16) + of


def read_attachment(sample):
    data = bytes(sample.attachment)
    number, _, length = struct.unpack("<qqB", data[:17])
    assert len(data) == 33 and length == 16, data
    return number, data[17:]


def text(value):
    data = value.encode() + b"\0"
    return b"\0\1\0\0" + struct.pack("<I", len(data)) + data


def read_text(payload):
    data = bytes(payload)
    (length,) = struct.unpack_from("<I", data, 4)
    return data[8 : 8 + length - 1].decode()


class Peer:
    def __init__(self, endpoint, domain):
        self.session = zenoh.open(config("peer", endpoint))
        self.zid, self.domain = str(self.session.info.zid()), domain
        self.changed, self.tokens, self.kept, self.ids = threading.Condition(), set(), [], 0
        self.kept.append(
            self.session.liveliness().declare_subscriber(
                f"@ros2_lv/{domain}/**", self.on_token, history=True
            )
        )
        self.token("NN", "/peer")

    def on_token(self, sample):
        with self.changed:
            key = str(sample.key_expr)
            if sample.kind == zenoh.SampleKind.PUT:
                self.tokens.add(key)
            else:
                self.tokens.discard(key)
            self.changed.notify_all()

    def until(self, what, found):
        with self.changed:
            value = found()
            end = time.monotonic() + PATIENCE_S
            while not value:
                if not self.changed.wait(end - time.monotonic()):
                    raise SystemExit(f"{what} did not come; there are {sorted(self.tokens)}")
                value = found()
            return value

    def done(self, into, value):
        with self.changed:
            into.append(value)
            self.changed.notify_all()

    def key(self, name, of):
        return f"{self.domain}/{name.strip('/')}/{'/'.join(of)}"

    def token(self, kind, name, of=(), qos=""):
        number = self.ids
        self.ids += 1
        key = f"@ros2_lv/{self.domain}/{self.zid}/0/{number}/{kind}/%/%/peer"
        if of:
            key += "/" + "/".join([name.replace("/", "%"), *of, qos])
        self.kept.append(self.session.liveliness().declare_token(key))
        return gid(key)

    def token_of(self, node, kind, name):
        """The token of an endpoint of a node, by the parts that count."""

        def found():
            for key in self.tokens:
                parts = key.split("/")
                if parts[5:6] == [kind] and parts[8:10] == [node, name.replace("/", "%")]:
                    return key
            return None

        return self.until(f"{kind} {name}", found)


def meet(endpoint, domain):
    peer = Peer(endpoint, domain)
    result = {}
    string, trigger = (STRING, STRING_HASH), (TRIGGER, TRIGGER_HASH)

    # A service of ours, here.
    def answer(query):
        number, client = read_attachment(query)
        peer.done(asked, [number, client.hex(), bytes(query.payload).hex()])
        reply = b"\0\1\0\0\1\0\0\0" + struct.pack("<I", 5) + b"peer\0"
        query.reply(query.key_expr, reply, attachment=attachment(number, client))

    asked = []
    peer.kept.append(
        peer.session.declare_queryable(peer.key("/peer/trigger", trigger), answer, complete=True)
    )
    peer.token("SS", "/peer/trigger", trigger, RELIABLE)

    # Latched messages, both ways.
    latched = ext.declare_advanced_publisher(
        peer.session,
        peer.key("/latched_by_peer", string),
        cache=ext.CacheConfig(max_samples=1),
        publisher_detection=True,
        sample_miss_detection=ext.MissDetectionConfig(sporadic_heartbeat=0.5),
    )
    latched_gid = gid_of = peer.token("MP", "/latched_by_peer", string, LATCHED)
    latched.put(text("old"), attachment=attachment(1, gid_of))
    latched.put(text("kept"), attachment=attachment(2, gid_of))
    heard_latched = []
    token = peer.token_of("ours", "MP", "/latched_by_ours")
    result["latched_token"] = token.split("/")[9:]
    peer.kept.append(
        ext.declare_advanced_subscriber(
            peer.session,
            peer.key("/latched_by_ours", string),
            lambda sample: peer.done(heard_latched, [read_text(sample.payload), *read_attachment(sample)]),
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=ext.RecoveryConfig(heartbeat=True),
            subscriber_detection=True,
        )
    )
    peer.token("MS", "/latched_by_ours", string, LATCHED)
    peer.until("what is latched", lambda: len(heard_latched) > 0)
    content, number, of = heard_latched[0]
    result["latched"] = [content, number, of == gid(token)]

    # Messages of ours.
    chatter = []
    token = peer.token_of("ours", "MP", "/chatter")
    result["chatter_token"] = token.split("/")[9:]
    peer.kept.append(
        peer.session.declare_subscriber(
            peer.key("/chatter", string),
            lambda sample: peer.done(chatter, [read_text(sample.payload), *read_attachment(sample)]),
        )
    )
    peer.token("MS", "/chatter", string, RELIABLE)
    peer.until("chatter", lambda: len(chatter) >= 3)
    result["chatter"] = [[content, number, of == gid(token)] for content, number, of in chatter[:3]]

    # A call of a service of ours.
    token = peer.token_of("ours", "SS", "/ours/reset")
    result["service_token"] = token.split("/")[9:]
    of = peer.token("SC", "/ours/reset", trigger, RELIABLE)
    replies = peer.session.get(
        peer.key("/ours/reset", trigger),
        payload=b"\0\1\0\0\0",
        attachment=attachment(7, of),
        target=zenoh.QueryTarget.ALL_COMPLETE,
        consolidation=zenoh.ConsolidationMode.NONE,
        timeout=PATIENCE_S,
    )
    for reply in replies:
        number, client = read_attachment(reply.ok)
        result["reply"] = [bytes(reply.ok.payload).hex(), number, client == of]

    # Messages to ours, and rubbish between them.
    peer.token_of("ours", "MS", "/heard")
    of = peer.token("MP", "/heard", string, RELIABLE)
    key = peer.key("/heard", string)
    publisher = peer.session.declare_publisher(key, congestion_control=zenoh.CongestionControl.BLOCK)
    publisher.put(text("one"), attachment=attachment(1, of))
    publisher.put(text("nameless"))
    publisher.put(text("short"), attachment=b"\0" * 32)
    publisher.put(text("no gid"), attachment=b"\0" * 33)
    publisher.put(b"\0\1\0\0" + b"x" * (2 << 20), attachment=attachment(2, of))
    publisher.put(b"", attachment=attachment(3, of))
    publisher.delete()
    publisher.put(text("two"), attachment=attachment(4, of))
    # Three are missing here, then none: one again, an older one, and the first of another publisher.
    for number, data in [(8, "eight"), (8, "again"), (2, "old"), (9, "nine")]:
        publisher.put(text(data), attachment=attachment(number, of))
    other = peer.token("MP", "/heard", string, RELIABLE)
    for number, data in [(1000, "other"), (1002, "gap")]:
        publisher.put(text(data), attachment=attachment(number, other))
    for rubbish in [
        f"@ros2_lv/{domain}/rubbish",
        f"@ros2_lv/{domain}/1/0/0/XX/%/%/rubbish",
        f"@ros2_lv/{domain}/1/0/x/MP/%/%/rubbish/%heard/a/b/::,1:,:,:,,",
        f"@ros2_lv/{domain}/1/0/1/MP/%/%/rubbish/%heard/a/b/c",
    ]:
        peer.kept.append(peer.session.liveliness().declare_token(rubbish))
    result["heard_gid"] = of.hex()
    # Requests without what names them are not answered, and do no harm.
    for rubbish in [None, b"\0" * 32]:
        replies = peer.session.get(
            peer.key("/ours/reset", trigger), payload=b"\0\1\0\0\0", attachment=rubbish, timeout=5
        )
        result.setdefault("rubbish_replies", []).append(len([r for r in replies if r.ok]))

    peer.until("the call of ours", lambda: len(asked) > 0)
    client = peer.token_of("ours", "SC", "/peer/trigger")
    number, of, payload = asked[0]
    result["asked"] = [number, of == gid(client).hex(), payload]
    result["zid"], result["latched_gid"] = peer.zid, latched_gid.hex()
    print(json.dumps(result), flush=True)
    # The tests look at the graph before this peer leaves.
    sys.stdin.read()
    peer.session.close()


def main(role, endpoint, domain="0"):
    if role == "router":
        router = zenoh.open(config("router", endpoint))
        print("ready", flush=True)
        sys.stdin.read()
        router.close()
    else:
        meet(endpoint, int(domain))


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except BaseException:
        traceback.print_exc()
        # The threads of a session that is open would go on.
        os._exit(1)
