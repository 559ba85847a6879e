"""Binary little-endian PLY files of points: x, y, z among float or double properties."""

import numpy as np

TYPES = {"float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8", "ushort": "<u2", "uchar": "u1", "uint8": "u1"}


def read(path):
    """Points as n x 3 doubles."""
    with open(path, "rb") as file:
        count, fields = 0, []
        for line in iter(file.readline, b""):
            words = line.decode("ascii").split()
            if words[:2] == ["element", "vertex"]:
                count = int(words[2])
            elif words[:1] == ["property"]:
                fields.append((words[2], TYPES[words[1]]))
            elif words == ["end_header"]:
                break
        rows = np.frombuffer(file.read(), dtype=np.dtype(fields), count=count)
    return np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"])


def write(path, points):
    """Writes n x 3 doubles."""
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    with open(path, "wb") as file:
        file.write(header.encode("ascii"))
        file.write(np.ascontiguousarray(points, dtype="<f8").tobytes())
