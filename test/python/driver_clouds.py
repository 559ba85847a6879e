"""PointCloud2 as the drivers of lidars and depth cameras lay it out."""

import numpy

from driver_messages import header, make
from driver_scene import ROWS, SCAN_NS

# Those of PCL behind those of sensor_msgs.
CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
CODES |= {"i8": 9, "u8": 10, "b1": 11}
XYZ = "x f4 0, y f4 4, z f4 8"


# Times of points, since the stamp or since 1970.


def since_stamp_ns(at_ns, stamp_ns):
    return at_ns - stamp_ns


def since_stamp_s(at_ns, stamp_ns):
    return (at_ns - stamp_ns) * 1e-9


def since_1970_s(at_ns, _):
    return at_ns / 1e9


def since_1970_ns(at_ns, _):
    return at_ns.astype("f8")


class Layout:
    """Fields of a driver, their times, and what stands where nothing returned.

    `missing` is the coordinate of a ray without return in an organized cloud; None leaves it out.
    `stamped` is the beginning or the end of the sweep.
    """

    def __init__(self, fields, bytes_, time=None, missing=None, stamped="begin"):
        rows = [field.split() for field in fields.split(",")]
        self.names, formats, offsets = zip(*rows)
        offsets = [int(offset) for offset in offsets]
        self.dtype = numpy.dtype(
            {"names": self.names, "formats": formats, "offsets": offsets, "itemsize": bytes_}
        )
        self.fields = [
            make(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=offset,
                datatype=CODES[code],
                count=1,
            )
            for name, code, offset in zip(self.names, formats, offsets)
        ]
        self.time_name, self.time = time or (None, None)
        self.missing, self.stamped = missing, stamped

    def cloud(self, frame, scan, sensor, columns=slice(None), in_world=False, returns=True):
        """One message and the time at which it is whole; without `returns` nothing was met."""
        end_ns = scan.stamp_ns + SCAN_NS
        stamp_ns = end_ns if self.stamped == "end" else scan.stamp_ns
        if in_world:
            points = scan.world_m
        else:
            points = scan.seen_from(sensor, None if self.time else stamp_ns)
        points, at_ns = points[columns], numpy.repeat(scan.column_ns[columns], ROWS)
        returned = scan.returned[columns] & returns
        if self.missing is not None:
            points = numpy.where(returned[..., None], points, self.missing)
            returned = numpy.ones_like(returned)
        rows = numpy.zeros(returned.size, self.dtype)
        rows["x"], rows["y"], rows["z"] = points.reshape(-1, 3).T
        if self.time:
            rows[self.time_name] = self.time(at_ns, stamp_ns)
        if "ring" in self.names:
            rows["ring"] = numpy.tile(numpy.arange(ROWS), len(rows) // ROWS)
        if self.missing is None:
            rows = rows[returned.reshape(-1)]
            height, width = 1, len(rows)
        else:
            # Row by row, as an image.
            rows = rows.reshape(-1, ROWS).T.reshape(-1)
            height, width = ROWS, len(rows) // ROWS
        message = make(
            "sensor_msgs/msg/PointCloud2",
            header=header(frame, stamp_ns),
            height=height,
            width=width,
            fields=self.fields,
            point_step=self.dtype.itemsize,
            row_step=self.dtype.itemsize * width,
            data=rows.view("u1"),
            is_dense=bool(self.missing is None or numpy.isfinite(self.missing)),
        )
        return message, end_ns


OUSTER = Layout(
    f"{XYZ}, intensity f4 16, t u4 20, reflectivity u2 24, ring u2 26, ambient u2 28, range u4 32",
    48,
    ("t", since_stamp_ns),
    missing=0.0,
)
# Stamped by the last packet: the times are negative.
VELODYNE = Layout(
    f"{XYZ}, intensity f4 12, ring u2 16, time f4 18", 22, ("time", since_stamp_s), stamped="end"
)
LIVOX = Layout(
    f"{XYZ}, intensity f4 12, tag u1 16, line u1 17, timestamp f8 18",
    26,
    ("timestamp", since_1970_ns),
)
HESAI = Layout(
    f"{XYZ}, intensity f4 12, ring u2 16, timestamp f8 18", 26, ("timestamp", since_1970_s)
)
ROBOSENSE = Layout(
    f"{XYZ}, intensity f4 12, ring u2 16, timestamp f8 18",
    26,
    ("timestamp", since_1970_s),
    missing=numpy.nan,
    stamped="end",
)
AUTOWARE = Layout(
    f"{XYZ}, intensity u1 12, return_type u1 13, channel u2 14, azimuth f4 16, elevation f4 20, "
    "distance f4 24, time_stamp u4 28",
    32,
    ("time_stamp", since_stamp_ns),
)
REALSENSE = Layout(f"{XYZ}, rgb f4 16", 20)
OAKD = Layout(XYZ, 16, missing=numpy.nan)
# PointXYZINormal of PCL, undistorted to the end of the sweep.
FAST_LIO = Layout(
    f"{XYZ}, normal_x f4 16, normal_y f4 20, normal_z f4 24, intensity f4 32, curvature f4 36",
    48,
    stamped="end",
)
