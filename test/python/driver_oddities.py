"""Logs in which clouds, clocks, poses and fixes are otherwise than messages say they should be."""

import numpy

from driver_clouds import OAKD, XYZ, Layout, since_1970_ns, since_stamp_ns, since_stamp_s
from driver_messages import STORE, header, make, pose_message, serialized
from driver_robot import LIDAR, filtered, register, velodyne
from driver_scene import GENERATOR, SECOND_NS, START_NS, map_of, pose, transform

# A lattice vector to a place in a zone of UTM.
UTM_CELLS = numpy.rint(numpy.linalg.solve(GENERATOR, [448_000.0, 5_411_000.0, 300.0])).astype(int)
TIMED = f"{XYZ}, intensity f4 12, t u4 16"


def odd_clouds(log, layout, change=lambda message: None):
    """Clouds of a layout on the usual robot, each changed before it is written."""
    log.tf_static(("base_link", "lidar", LIDAR))
    filtered(log)
    for scan in log.scans:
        message, at_ns = layout.cloud("lidar", scan, LIDAR)
        change(message)
        log.add("/points", at_ns, message)


def ouster_like():
    return Layout(TIMED, 20, ("t", since_stamp_ns))


def with_field(fields, bytes_, time=None):
    return lambda log: odd_clouds(log, Layout(fields, bytes_, time))


def since_stamp_us(at_ns, stamp_ns):
    return (at_ns - stamp_ns) / 1000


def since_stamp_ms(at_ns, stamp_ns):
    return (at_ns - stamp_ns) / 1e6


def since_1970_whole_ns(at_ns, _):
    return at_ns


def since_1970_tai_s(at_ns, _):
    return at_ns / 1e9 + 37


def named(name, function):
    function.__name__ = name
    register(function)


# Fields.
for name, fields, bytes_, time in [
    ("field_uint64", f"{XYZ}, t u4 12, id u8 16", 24, ("t", since_stamp_ns)),
    ("field_bool", f"{XYZ}, t u4 12, valid b1 16", 17, ("t", since_stamp_ns)),
    ("time_uint64", f"{XYZ}, timestamp u8 12", 20, ("timestamp", since_1970_whole_ns)),
    ("time_int64", f"{XYZ}, timestamp i8 16", 24, ("timestamp", since_1970_whole_ns)),
    ("time_int32", f"{XYZ}, t i4 12", 16, ("t", since_stamp_ns)),
    ("time_name_with_unit", f"{XYZ}, time_offset_ns i4 12", 16, ("time_offset_ns", since_stamp_ns)),
    ("time_ts", f"{XYZ}, ts f4 12", 16, ("ts", since_stamp_s)),
    ("time_us_float", f"{XYZ}, time f4 12", 16, ("time", since_stamp_us)),
    ("time_us_uint32", f"{XYZ}, t u4 12", 16, ("t", since_stamp_us)),
    ("time_ms_double", f"{XYZ}, offset_time f8 12", 20, ("offset_time", since_stamp_ms)),
    ("time_tai", f"{XYZ}, timestamp f8 12", 20, ("timestamp", since_1970_tai_s)),
    ("time_curvature", f"{XYZ}, curvature f4 12", 16, ("curvature", since_stamp_ms)),
]:
    named(name, with_field(fields, bytes_, time))


def without_times(name, fields, bytes_, fill):
    """Points that were moved to the stamp before, with a field of which nothing is known."""

    def make_log(log):
        layout = Layout(fields, bytes_)

        def change(message):
            rows = message.data.view(layout.dtype)
            for field, value in fill.items():
                rows[field] = value

        odd_clouds(log, layout, change)

    named(name, make_log)


without_times("time_pair", f"{XYZ}, sec u4 12, nsec u4 16", 20, {"sec": START_NS // SECOND_NS})
without_times("time_nan", f"{XYZ}, time f4 12", 16, {"time": numpy.nan})
without_times("time_none", f"{XYZ}, intensity f4 12, ring u2 16", 18, {})


@register
def time_us_uint32_moved(log):
    # Moved to the stamp before: read as nanoseconds, the times move no point over the border of its cell.
    layout = Layout(f"{XYZ}, t u4 12", 16)

    def change(message):
        rows = message.data.view(layout.dtype)
        rows["t"] = numpy.linspace(0, 99_000, len(rows))

    odd_clouds(log, layout, change)


@register
def time_outlier(log):
    # The first point of each cloud is one more, from nowhere, at no time.
    layout = Layout(f"{XYZ}, timestamp f8 12", 20, ("timestamp", since_1970_ns))

    def change(message):
        rows = message.data.view(layout.dtype)
        rows = numpy.concatenate([rows[:1], rows])
        rows["x"][0], rows["timestamp"][0] = 100.0, 0.0
        message.width, message.row_step = len(rows), 20 * len(rows)
        message.data = rows.view("u1")

    odd_clouds(log, layout, change)


def changed_field(log_name, /, **change):
    """The intensity, of which nothing is read, is declared otherwise."""

    def make_log(log):
        def change_it(message):
            for key, value in change.items():
                fields = [make("sensor_msgs/msg/PointField", **vars_of(f)) for f in message.fields]
                setattr(fields[3], key, value)
                message.fields = fields

        odd_clouds(log, ouster_like(), change_it)

    named(log_name, make_log)


def vars_of(field):
    return {key: getattr(field, key) for key in ("name", "offset", "datatype", "count")}


changed_field("field_unknown_type", datatype=77)
changed_field("field_beyond_point", offset=18)
changed_field("field_twice", name="x")
changed_field("field_count_zero", count=0)


# Extents.
def extent(name, **change):
    def make_log(log):
        def change_it(message):
            for key, value in change.items():
                setattr(message, key, value)

        odd_clouds(log, ouster_like(), change_it)

    named(name, make_log)


extent("row_step_zero", row_step=0)
extent("row_step_of_a_point", row_step=20)
extent("row_step_huge", row_step=2**31)
extent("height_zero", height=0)
extent("width_zero", width=0)


# Clocks.
@register
def poses_jitter(log):
    velodyne(log)
    random = numpy.random.default_rng(7)
    recorded = len(log.messages)
    log.odometry("/odom", "odom", "base_link", 100)
    late = [
        (at_ns + int(random.uniform(0, 50_000_000)), topic, data)
        for at_ns, topic, data in log.messages[recorded:]
    ]
    log.messages[recorded:] = late


@register
def poses_twice(log):
    velodyne(log)
    for _ in range(2):
        log.odometry("/odom", "odom", "base_link", 50)


@register
def poses_of_another_year(log):
    # One in fifty, as an INS gives while it starts.
    velodyne(log)
    for i, at_ns in enumerate(log.times(50)):
        odometry(log, at_ns, at_ns - (i % 50 == 25) * 31_557_600 * SECOND_NS)


def odometry(log, at_ns, stamp_ns=None, offset_m=(0.0, 0.0, 0.0), topic="/odom"):
    """One pose of the machine, which is elsewhere and stamped otherwise."""
    matrix = pose(at_ns).copy()
    matrix[:3, 3] += offset_m
    posed = make("geometry_msgs/msg/PoseWithCovariance", pose=pose_message(matrix))
    stamped = header("odom", at_ns if stamp_ns is None else stamp_ns)
    fields = {"header": stamped, "child_frame_id": "base_link", "pose": posed}
    log.add(topic, at_ns + 5_000_000, make("nav_msgs/msg/Odometry", **fields))


def clock_step(name, step_ns, poses):
    """All clocks are set back between two scans, a second and a half into the drive."""

    def make_log(log):
        velodyne(log)
        poses(log)
        set_ns = START_NS + 15 * SECOND_NS // 10
        kept = []
        for at_ns, topic, data in log.messages:
            kind, _ = log.topics[topic]
            if topic != "/tf_static" and stamp_of(kind, data) >= set_ns:
                data = stamped_by(kind, data, -step_ns)
            kept.append((at_ns, topic, data))
        log.messages = kept
        # No poses of the new time cover the sweep that ended with the step, nor the first point of the next.
        log.mapped = log.scans[:14] + log.scans[16:]

    named(name, make_log)


def stamp_of(kind, data):
    message = STORE.deserialize_cdr(data, kind)
    stamp = (message.transforms[0] if "TF" in kind else message).header.stamp
    return stamp.sec * SECOND_NS + stamp.nanosec


def stamped_by(kind, data, shift_ns):
    """A message whose stamp is moved."""
    message = STORE.deserialize_cdr(data, kind)
    of = message.transforms[0].header if "TF" in kind else message.header
    at_ns = of.stamp.sec * SECOND_NS + of.stamp.nanosec + shift_ns
    of.stamp.sec, of.stamp.nanosec = at_ns // SECOND_NS, at_ns % SECOND_NS
    message.__msgtype__ = kind
    return serialized(message)


def odometry_100_hz(log):
    log.odometry("/odom", "odom", "base_link", 100)


def tf_100_hz(log):
    log.tf("odom", "base_link", 100)


def fixes_100_hz(log):
    log.fixes("/fix", "base_link", 100)
    log.imu("/imu", "base_link", 100)


clock_step("clock_step_part", 990_000_000, odometry_100_hz)
clock_step("clock_step_small", 203_000_000, odometry_100_hz)
clock_step("clock_step_long", 1_500_000_000, odometry_100_hz)
clock_step("clock_step_tf", 990_000_000, tf_100_hz)
clock_step("clock_step_fixes", 990_000_000, fixes_100_hz)


@register
def log_twice(log):
    # Recorded from a player that loops.
    velodyne(log)
    log.odometry("/odom", "odom", "base_link", 100)
    again_ns = 6 * SECOND_NS
    log.messages += [(at_ns + again_ns, topic, data) for at_ns, topic, data in log.messages]
    log.mapped = [*log.scans, *log.scans]


# Places.
@register
def utm_odometry(log):
    # The cells are those of the drive, moved.
    velodyne(log)
    moved = transform(*(GENERATOR @ UTM_CELLS))
    log.odometry("/odom", "utm", "base_link", 50, frame_from_world=moved)
    log.expected = lambda: (numpy.array(map_of(log.mapped)) + [*UTM_CELLS, 0]).tolist()


def odd_fixes(name, change):
    """Fixes and attitudes of the machine, some fixes changed by their number."""

    def make_log(log):
        velodyne(log)
        recorded = len(log.messages)
        log.fixes("/fix", "base_link", 20)
        kind = "sensor_msgs/msg/NavSatFix"
        for i, (at_ns, topic, data) in enumerate(log.messages[recorded:]):
            message = STORE.deserialize_cdr(data, kind)
            message.__msgtype__ = kind
            change(i, message)
            log.messages[recorded + i] = (at_ns, topic, serialized(message))
        log.imu("/imu", "base_link", 100)

    named(name, make_log)


def null_island_between(i, fix):
    if i % 20 in (7, 8):
        fix.latitude = fix.longitude = 0.0


def one_fix_off(i, fix):
    # 0.0005 degrees of latitude are 56 m.
    if i == 41:
        fix.latitude += 0.0005


def heights_flip(i, fix):
    # Above the geoid for two fixes of ten.
    if i % 10 in (4, 5):
        fix.altitude -= 40.0


def no_height(_, fix):
    fix.altitude = numpy.nan


def status_unknown(_, fix):
    fix.status.status = -2


def longitude_positive(_, fix):
    fix.longitude -= 360.0


def latitude_longitude_swapped(_, fix):
    fix.latitude, fix.longitude = 100.0 + fix.latitude, fix.latitude


for change in [
    null_island_between,
    one_fix_off,
    heights_flip,
    no_height,
    status_unknown,
    longitude_positive,
    latitude_longitude_swapped,
]:
    odd_fixes(f"fixes_{change.__name__}", change)


@register
def poses_teleport(log):
    # One pose in a hundred is 30 m away.
    velodyne(log)
    for i, at_ns in enumerate(log.times(100)):
        odometry(log, at_ns, offset_m=(30.0 * (i % 100 == 50), 0.0, 0.0))


@register
def poses_elsewhere(log):
    # Two seconds into the drive the estimator finds itself 40 m away and stays there.
    velodyne(log)
    cells = numpy.array([0, 50, 0])
    since_ns = START_NS + 195 * SECOND_NS // 100
    for at_ns in log.times(100):
        odometry(log, at_ns, offset_m=GENERATOR @ cells if at_ns >= since_ns else (0.0, 0.0, 0.0))
    here = [scan for scan in log.scans if scan.stamp_ns + SECOND_NS // 10 < since_ns]
    there = [scan for scan in log.scans if scan.stamp_ns > since_ns]
    log.expected = lambda: sorted(map_of(here) + map_of(there, -GENERATOR @ cells))


@register
def mount_without_rotation(log):
    log.clouds("/points", "lidar", OAKD, LIDAR)
    filtered(log)
    fields = {"header": header("base_link", START_NS - SECOND_NS), "child_frame_id": "lidar"}
    mount = make("geometry_msgs/msg/TransformStamped", **fields)
    log.add("/tf_static", START_NS - SECOND_NS, make("tf2_msgs/msg/TFMessage", transforms=[mount]))
