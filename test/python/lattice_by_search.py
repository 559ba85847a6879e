"""The face-centred cubic lattice by exhaustive search, and keys of voxels, apart from our code."""

import itertools

import numpy

# Nearer to the border of a cell than this, rounding may decide, m.
BORDER_M = 1e-5


def fcc(cell_volume_m3):
    """Generator, columns are the basis: Ryde & Bruenig eq. (10), scaled to the volume."""
    f = numpy.cbrt(cell_volume_m3 / 2)
    return f * numpy.array([[2, 1, 0], [0, -1, 1], [0, 0, -1]], dtype=float)


def nearest(generator, points_m, border_m=BORDER_M):
    """Index of the nearest lattice point of each point, and who else is as near but for border_m.

    The second is a dictionary: number of the point -> list of other indices.
    """
    base = numpy.rint(numpy.linalg.solve(generator, points_m.T).T)
    offsets = numpy.array(list(itertools.product(range(-2, 3), repeat=3)), dtype=float)
    distances = numpy.empty((len(offsets), len(points_m)))
    from_base = points_m - base @ generator.T
    for row, offset in zip(distances, offsets):
        row[:] = ((from_base - generator @ offset) ** 2).sum(axis=1)
    best = distances.argmin(axis=0)
    # From the plane between the two centres.
    apart = numpy.linalg.norm((offsets[:, None] - offsets[None]) @ generator.T, axis=2)
    apart[apart == 0] = numpy.inf
    border = (distances - distances.min(axis=0)) / (2 * apart[:, best])
    border[best, numpy.arange(len(points_m))] = numpy.inf
    near = {}
    for other, point in zip(*numpy.nonzero(border < border_m)):
        near.setdefault(int(point), []).append(base[point] + offsets[other])
    return (base + offsets[best]).astype(numpy.int64), near


def keys_of(indices):
    """Morton keys: the bits of each index + 2^20, interleaved."""
    biased = numpy.asarray(indices, dtype=numpy.int64) + (1 << 20)
    keys = numpy.zeros(len(biased), dtype=numpy.int64)
    for bit, axis in itertools.product(range(21), range(3)):
        keys |= ((biased[:, axis] >> bit) & 1) << (3 * bit + axis)
    return keys


def indices_of(keys):
    """The indices of Morton keys."""
    keys = numpy.asarray(keys, dtype=numpy.int64)
    biased = numpy.zeros((len(keys), 3), dtype=numpy.int64)
    for bit, axis in itertools.product(range(21), range(3)):
        biased[:, axis] |= ((keys >> (3 * bit + axis)) & 1) << bit
    return biased - (1 << 20)


def decode_keys(data):
    """Keys from LEB128 differences, the first absolute."""
    keys, key, difference, shift = [], 0, 0, 0
    for byte in data:
        difference |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            key += difference
            keys.append(key)
            difference, shift = 0, 0
    assert shift == 0, "the last key is cut off"
    return keys


class Expected:
    """The voxels that points must give, with room for those on a border."""

    def __init__(self, generator):
        self.generator = generator
        self.sure = {}
        self.perhaps = {}
        self.points = 0

    def add(self, points_m):
        indices, near = nearest(self.generator, points_m)
        clear = numpy.ones(len(points_m), dtype=bool)
        clear[list(near)] = False
        keys, counts = numpy.unique(keys_of(indices[clear]), return_counts=True)
        for key, count in zip(keys.tolist(), counts.tolist()):
            self.sure[key] = self.sure.get(key, 0) + count
        for point, others in near.items():
            for key in keys_of([indices[point], *others]).tolist():
                self.perhaps[key] = self.perhaps.get(key, 0) + 1
        self.points += len(points_m)

    def differences(self, voxels):
        """What is wrong with a dictionary key -> count."""
        wrong = []
        for key in self.sure.keys() | voxels.keys():
            low, found = self.sure.get(key, 0), voxels.get(key, 0)
            if not low <= found <= low + self.perhaps.get(key, 0):
                wrong.append(f"voxel {key:#x}: {found} points, expected {low}")
        total = sum(voxels.values())
        if total != self.points:
            wrong.append(f"{total} points, expected {self.points}")
        return wrong


def exposed_faces(generator, keys):
    """Number of faces of the cells that no other cell of the set covers; FCC has 12 a cell."""
    offsets = numpy.array(list(itertools.product(range(-2, 3), repeat=3)))
    lengths = numpy.linalg.norm(offsets @ generator.T, axis=1)
    shortest = lengths[lengths > 0].min()
    faces = offsets[(lengths > 0) & (lengths < shortest * 1.001)]
    assert len(faces) == 12
    indices = indices_of(keys)
    return sum(int((~numpy.isin(keys_of(indices + face), keys)).sum()) for face in faces)
