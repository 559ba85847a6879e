"""Peer of msgs_conformance.rs: every message type as the rosbags library reads and writes it.

Reads one JSON object per line: {"type", "definition", "default"}, the last in hex.
Writes one per line, in the same order: {"type", "samples": [{"bytes", "value"}, ...],
"default": the bytes of the decoded default, "jazzy": how the fields differ from those of Jazzy}.
"""

import json
import sys

import numpy
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import Nodetype

INTEGERS = {
    # An octet in ROS 2, yet rosbags packs it as a signed number: keep to the half they share.
    "byte": (7, False),
    "int8": (8, True), "uint8": (8, False), "char": (8, False),
    "int16": (16, True), "uint16": (16, False), "int32": (32, True), "uint32": (32, False),
    "int64": (64, True), "uint64": (64, False),
}  # fmt: skip
NUMPY = {"bool": "bool", "byte": "uint8", "char": "uint8"}


class Filler:
    """Makes values of a message; each field differs from its neighbours."""

    def __init__(self, store, length):
        self.store = store
        self.length = length
        self.count = 0

    def message(self, name):
        fields = self.store.fielddefs[name][1]
        return self.store.types[name](**{field: self.value(kind) for field, kind in fields})

    def value(self, kind):
        node, detail = kind
        if node == Nodetype.NAME:
            return self.message(detail)
        if node == Nodetype.BASE:
            return self.primitive(detail[0])
        element, size = detail
        if node == Nodetype.SEQUENCE:
            size = min(size, self.length) if size else self.length
        values = [self.value(element) for _ in range(size)]
        if element[0] == Nodetype.BASE and element[1][0] != "string":
            name = element[1][0]
            return numpy.array(values, dtype=NUMPY.get(name, name))
        return values

    def primitive(self, name):
        self.count += 1
        n = self.count if self.length else 0
        if name == "bool":
            return n % 2 == 1
        if name == "string":
            return f"\u00fc {n}" if n else ""
        if name in ("float32", "float64"):
            return -n - 0.625 if n else 0.0
        bits, signed = INTEGERS[name]
        if not n:
            return 0
        # From the ends of the range inwards.
        return -(1 << (bits - 1)) + n % 100 if signed else (1 << bits) - 1 - n % 100


def plain(store, value):
    """The value as JSON has it."""
    if isinstance(value, numpy.ndarray):
        return value.tolist()
    if isinstance(value, list):
        return [plain(store, element) for element in value]
    if hasattr(value, "__msgtype__"):
        fields = store.fielddefs[value.__msgtype__][1]
        return {name: plain(store, getattr(value, name)) for name, _ in fields}
    return value


def register(store, definition, name):
    types = get_types_from_msg(definition, name)
    store.register({key: value for key, value in types.items() if key not in store.fielddefs})
    # The store itself adds the one byte of a message without fields.
    known = [key for key, value in types.items() if value[1] and store.fielddefs[key] != value]
    if known:
        raise ValueError(f"{name} brings other definitions of {known}")


def difference(jazzy, store, name):
    """Where a type of Jazzy has other fields or constants here."""
    if name not in jazzy.fielddefs or jazzy.fielddefs[name] == store.fielddefs[name]:
        return None
    if not store.fielddefs[name][0] and jazzy.fielddefs[name][1] == store.fielddefs[name][1]:
        # Its constants are not repeated here.
        return None
    return f"Jazzy: {jazzy.fielddefs[name]}; here: {store.fielddefs[name]}"


def main():
    store = get_typestore(Stores.EMPTY)
    jazzy = get_typestore(Stores.ROS2_JAZZY)
    for line in sys.stdin:
        asked = json.loads(line)
        # The library knows no services and actions: their parts are messages to it.
        name = asked["type"].replace("/srv/", "/msg/").replace("/action/", "/msg/")
        register(store, asked["definition"], name)
        samples = []
        for length in (0, 1, 2, 5):
            message = Filler(store, length).message(name)
            data = bytes(store.serialize_cdr(message, name))
            samples.append({"bytes": data.hex(), "value": plain(store, message)})
        default = store.deserialize_cdr(bytes.fromhex(asked["default"]), name)
        answer = {
            "type": asked["type"],
            "samples": samples,
            "default": bytes(store.serialize_cdr(default, name)).hex(),
            "in_jazzy": name in jazzy.fielddefs,
            "jazzy": difference(jazzy, store, name),
        }
        print(json.dumps(answer))


if __name__ == "__main__":
    main()
