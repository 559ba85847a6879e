"""A drive through a walled yard: the pose of the machine at any time, and the returns of each scan.

Every estimator samples the same drive, and every lidar has the same returns: every log gives the same map.
Between knots a second apart the machine moves on a straight line and turns at a constant rate, so that
interpolation between samples of any rate is exact. No return lies within BORDER_M of the border of a cell.
"""

import functools

import numpy

from lattice_by_search import fcc, indices_of, keys_of, nearest

START_NS = 1_700_000_000_000_000_000
SECOND_NS = 1_000_000_000
# Poses are known in this time, scans are taken in a part of it, s since START_NS.
DRIVE_S = (-1, 4)
SCANS = range(30)
SCAN_NS = SECOND_NS // 10
COLUMNS, ROWS = 100, 20
BORDER_M = 1e-3
GENERATOR = fcc(0.125)
# Lever arms up and ahead. They are lattice vectors, so a map that begins at an antenna has the same cells.
MAST_M = GENERATOR @ [1, -2, -2]
AHEAD_M = GENERATOR @ [1, 0, 0]

# x, y, z in m and roll, pitch, yaw in rad, one a second from the beginning of the drive.
KNOTS = numpy.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.2, 0.0, 0.02, 0.0025, -0.0025, 0.05],
        [2.6, 0.3, 0.05, 0.005, 0.004, 0.45],
        [3.7, 1.2, 0.03, -0.004, 0.005, 0.95],
        [4.2, 2.5, 0.0, 0.0025, -0.005, 1.45],
        [4.2, 3.9, -0.02, 0.0, 0.0, 1.6],
    ]
)
# The walls, from within, and boxes from without: least and greatest corner, m.
YARD = numpy.array([[-5.0, -6.0, -0.5], [11.0, 9.0, 2.5]])
BOXES = numpy.array(
    [
        [[6.0, -3.0, -0.5], [8.0, -1.0, 1.0]],
        [[-2.0, 3.0, -0.5], [0.5, 5.0, 0.7]],
        [[8.5, 4.0, -0.5], [9.5, 7.0, 2.0]],
    ]
)
# Height of the rays above the machine's origin, m.
LASER_M = 1.0


def rotation(roll, pitch, yaw):
    """Fixed-axis roll, pitch, yaw as a matrix."""
    (a, b, c), (x, y, z) = numpy.cos([roll, pitch, yaw]), numpy.sin([roll, pitch, yaw])
    about_x = numpy.array([[1, 0, 0], [0, a, -x], [0, x, a]])
    about_y = numpy.array([[b, 0, y], [0, 1, 0], [-y, 0, b]])
    about_z = numpy.array([[c, -z, 0], [z, c, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def transform(x=0.0, y=0.0, z=0.0, roll=0.0, pitch=0.0, yaw=0.0):
    """A rigid transform as a 4x4 matrix."""
    matrix = numpy.eye(4)
    matrix[:3, :3] = rotation(roll, pitch, yaw)
    matrix[:3, 3] = x, y, z
    return matrix


IDENTITY = transform()


def quaternion(matrix):
    """x, y, z, w of the rotation of a transform."""
    r = matrix[:3, :3]
    # Squares of x, y, z, w times four; the greatest one gives the others without cancellation.
    squares = 1 + numpy.array(
        [
            r[0, 0] - r[1, 1] - r[2, 2],
            r[1, 1] - r[0, 0] - r[2, 2],
            r[2, 2] - r[0, 0] - r[1, 1],
            r[0, 0] + r[1, 1] + r[2, 2],
        ]
    )
    d = [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]
    s = [r[2, 1] + r[1, 2], r[0, 2] + r[2, 0], r[1, 0] + r[0, 1]]
    rows = [
        [squares[0], s[2], s[1], d[0]],
        [s[2], squares[1], s[0], d[1]],
        [s[1], s[0], squares[2], d[2]],
        [*d, squares[3]],
    ]
    row = numpy.array(rows[int(squares.argmax())])
    return row / numpy.linalg.norm(row)


def _turn(matrix):
    """Axis and angle of a rotation below half a turn."""
    x, y, z, w = quaternion(matrix) * numpy.sign(quaternion(matrix)[3])
    sine = numpy.linalg.norm([x, y, z])
    axis = numpy.array([x, y, z]) / sine if sine > 0 else numpy.array([0.0, 0.0, 1.0])
    return axis, 2 * numpy.arctan2(sine, w)


_AT_KNOTS = [rotation(*knot[3:]) for knot in KNOTS]
_TURNS = [_turn(a.T @ b) for a, b in zip(_AT_KNOTS, _AT_KNOTS[1:])]


@functools.cache
def pose(at_ns):
    """world_from_base at a time since the epoch, ns."""
    since_ns = at_ns - START_NS - DRIVE_S[0] * SECOND_NS
    knot = min(since_ns // SECOND_NS, len(_TURNS) - 1)
    part = since_ns / SECOND_NS - knot
    axis, angle = _TURNS[knot]
    x, y, z = axis
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = numpy.sin(part * angle) * cross + (1 - numpy.cos(part * angle)) * cross @ cross
    matrix = numpy.eye(4)
    matrix[:3, :3] = _AT_KNOTS[knot] @ (numpy.eye(3) + turn)
    matrix[:3, 3] = (1 - part) * KNOTS[knot, :3] + part * KNOTS[knot + 1, :3]
    return matrix


def ranges(origins, directions):
    """Distance along each ray to the wall, the ground or a box; infinite above the walls."""
    with numpy.errstate(divide="ignore", invalid="ignore"):
        far = (YARD - origins[:, None]) / directions[:, None]
        found = far.max(axis=1).min(axis=1)
        height = origins[:, 2] + found * directions[:, 2]
        found[height > YARD[1, 2] - 1e-6] = numpy.inf
        for box in BOXES:
            sides = (box - origins[:, None]) / directions[:, None]
            near, far = sides.min(axis=1).max(axis=1), sides.max(axis=1).min(axis=1)
            hit = (near > 0) & (near < far)
            found[hit] = numpy.minimum(found[hit], near[hit])
    return found


class Scan:
    """One sweep: columns a millisecond apart, each seen from where the machine was then."""

    def __init__(self, number, elevations=numpy.radians(numpy.linspace(-22, 14, ROWS))):
        self.stamp_ns = START_NS + number * SCAN_NS
        self.column_ns = self.stamp_ns + numpy.arange(COLUMNS) * (SCAN_NS // COLUMNS)
        self.poses = numpy.array([pose(int(at_ns)) for at_ns in self.column_ns])
        azimuth, elevation = numpy.meshgrid(
            -2 * numpy.pi * (numpy.arange(COLUMNS) + 0.13) / COLUMNS,
            elevations,
            indexing="ij",
        )
        level = numpy.cos(elevation)
        rays = numpy.stack(
            [level * numpy.cos(azimuth), level * numpy.sin(azimuth), numpy.sin(elevation)], axis=-1
        )
        directions = numpy.einsum("cij,crj->cri", self.poses[:, :3, :3], rays).reshape(-1, 3)
        laser = self.poses[:, :3, 3] + self.poses[:, :3, 2] * LASER_M
        rows = len(elevations)
        origins = numpy.repeat(laser, rows, axis=0)
        found = ranges(origins, directions)
        returned = numpy.isfinite(found)
        points = origins + numpy.where(returned, found, 0)[:, None] * directions
        self.cells, near = nearest(GENERATOR, points, BORDER_M)
        returned[list(near)] = False
        # By column and row.
        self.world_m = points.reshape(COLUMNS, rows, 3)
        self.returned = returned.reshape(COLUMNS, rows)
        self.cells = self.cells.reshape(COLUMNS, rows, 3)

    def seen_from(self, base_from_sensor, stamp_ns=None):
        """Points in the axes of a sensor at their own times, or all at one time."""
        poses = self.poses if stamp_ns is None else pose(stamp_ns)[None]
        from_world = numpy.linalg.inv(poses @ base_from_sensor)
        turned = numpy.einsum("cij,crj->cri", from_world[:, :3, :3], self.world_m)
        return turned + from_world[:, None, :3, 3]


def drive():
    """All scans."""
    return [Scan(number) for number in SCANS]


@functools.cache
def planar_drive():
    """All scans of a planar laser."""
    return [Scan(number, numpy.zeros(1)) for number in SCANS]


def map_of(scans, begins_at_m=(0.0, 0.0, 0.0)):
    """Cells of the returns as rows of three indices and a count; the map may begin at a lattice point."""
    shift = numpy.rint(numpy.linalg.solve(GENERATOR, begins_at_m)).astype(int)
    cells = numpy.concatenate([scan.cells[scan.returned] for scan in scans]) - shift
    keys, counts = numpy.unique(keys_of(cells), return_counts=True)
    return numpy.column_stack([indices_of(keys), counts]).tolist()
