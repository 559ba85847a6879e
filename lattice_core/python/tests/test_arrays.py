"""Arrays as users of NumPy have them: layouts, precisions, masks, times, shapes."""

import warnings

import numpy as np
import pytest

from lattice_core import Lattice, VoxelMap, gicp

UTM = (450_000.0, 5_400_000.0, 300.0)


@pytest.fixture
def cloud():
    return np.random.default_rng(7).uniform(-20, 20, (5000, 3))


def cells_and_counts(cells):
    """Cells with their points, in any order."""
    return {tuple(cell): count for cell, count in zip(*(a.tolist() for a in np.unique(cells, axis=0, return_counts=True)))}


def map_cells(map):
    return {tuple(cell): count for cell, count in zip(map.cells().tolist(), map.counts().tolist())}


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64, np.longdouble, ">f4", ">f8", np.int16])
@pytest.mark.parametrize("layout", ["C", "F", "reversed", "sliced", "unaligned", "list"])
def test_layouts_and_numbers_do_not_matter(cloud, dtype, layout):
    lattice = Lattice("fcc", 0.5)
    given = cloud.astype(dtype)
    expected = lattice.quantize(np.ascontiguousarray(given, np.float64))
    if layout == "F":
        given = np.asfortranarray(given)
    elif layout == "reversed":
        given = given[::-1].copy()[::-1]
    elif layout == "sliced":
        wide = np.zeros((len(cloud), 5), dtype)
        wide[:, 1:4] = given
        given = wide[:, 1:4]
    elif layout == "unaligned":
        bytes = np.zeros(given.nbytes + 1, np.uint8)
        bytes[1:] = np.frombuffer(given.tobytes(), np.uint8)
        given = np.frombuffer(bytes, dtype, given.size, 1).reshape(-1, 3)
    elif layout == "list":
        given = given.tolist()
    np.testing.assert_array_equal(lattice.quantize(given), expected)


def test_out_is_filled_in_its_own_order_or_refused(cloud):
    lattice = Lattice("mcc", 0.5)
    expected = lattice.quantize(cloud)
    right = np.full((len(cloud), 3), 7, np.int32)
    assert lattice.quantize(cloud, out=right) is right
    np.testing.assert_array_equal(right, expected)
    for wrong in [
        np.zeros((len(cloud), 3), np.int32, order="F"),
        np.zeros((len(cloud), 6), np.int32)[:, ::2],
        np.zeros((len(cloud), 3), np.int32)[::-1],
        np.zeros((len(cloud), 4), np.int32)[:, :3],
    ]:
        before = wrong.copy()
        with pytest.raises(ValueError, match="C order"):
            lattice.quantize(cloud, out=wrong)
        np.testing.assert_array_equal(wrong, before)
    shared = cloud.astype(np.float32)
    with pytest.raises(ValueError, match="shares memory"):
        lattice.quantize(shared, out=shared.view(np.int32))


@pytest.mark.parametrize("shift", [0.0, 1e4, 8e5])
@pytest.mark.parametrize("name", ["cubic", "bcc", "fcc", "mcc", "hex", "hexopt"])
def test_insert_gives_the_cells_of_quantize(cloud, name, shift):
    lattice = Lattice(name, 8.0)
    points = cloud + [shift, -0.3 * shift, 0.1 * shift]
    map = VoxelMap(lattice)
    assert map.insert(points)["inserted"] == len(points)
    assert map_cells(map) == cells_and_counts(lattice.quantize(points))
    offsets = map.means() - map.centers()
    assert np.linalg.norm(offsets, axis=1).max() <= 2.0


@pytest.mark.parametrize("name", ["cubic", "bcc", "fcc", "mcc", "hex", "hexopt"])
def test_points_of_utm_are_in_the_cells_about_the_datum(cloud, name):
    lattice = Lattice(name, 0.001)
    near, far = VoxelMap(lattice), VoxelMap(lattice, datum=UTM)
    near.insert(cloud)
    far.insert(cloud + far.datum)
    # The sum with the datum is rounded to 2^-30 m, so that few points change their cells.
    cells = set(map(tuple, near.cells().tolist())) ^ set(map(tuple, (far.cells() - datum_cell(far)).tolist()))
    assert len(cells) <= 2
    np.testing.assert_allclose(far.means().mean(axis=0) - far.datum, near.means().mean(axis=0), atol=1e-6)


def datum_cell(map):
    one = VoxelMap(map.lattice, datum=map.datum)
    one.insert([map.datum])
    return one.cells()[0]


def test_points_beyond_reach_of_the_datum_are_refused_with_one_that_is_near(cloud):
    map = VoxelMap(Lattice("fcc", 0.125))
    for points in [cloud + UTM, (cloud + UTM).astype(np.float32), np.full((9, 3), 1e300)]:
        with warnings.catch_warnings(), pytest.raises(ValueError, match=r"VoxelMap\(lattice, datum="):
            warnings.simplefilter("ignore")
            map.insert(points)
    assert len(map) == 0 == map.points
    report = map.insert(np.vstack([cloud, cloud[:3] + UTM, [[np.nan, 0, 0]]]))
    assert (report["inserted"], report["out_of_range"], report["not_finite"]) == (len(cloud), 3, 1)
    with pytest.raises(ValueError, match="2\\^31 m"):
        VoxelMap(Lattice("fcc", 0.125), datum=(1e10, 0, 0))


def test_float32_far_from_the_origin_is_warned_of(cloud):
    far = (cloud + UTM).astype(np.float32)
    map = VoxelMap(Lattice("fcc", 0.125), datum=UTM)
    with pytest.warns(UserWarning, match="float32 rounds coordinates of 54000.. m by up to 0.322 m"):
        map.insert(far)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        map.insert(far.astype(np.float64))
        map.lattice.quantize(cloud.astype(np.float32) + np.float32(3000))
        map.insert(np.full((3, 3), np.inf, np.float32))


def test_float32_and_float64_of_the_same_points_are_the_same_map(cloud):
    single = cloud.astype(np.float32)
    for datum in [(0, 0, 0), (3.3, -2.2, 1.1)]:
        maps = [VoxelMap(Lattice("bcc", 0.3), datum) for _ in range(2)]
        maps[0].insert(single)
        maps[1].insert(single.astype(np.float64))
        assert maps[0] == maps[1]


def test_masked_rows_are_left_out_and_counted(cloud):
    masked = np.ma.array(cloud, mask=np.zeros(cloud.shape, bool))
    masked[5, 1] = masked[9] = np.ma.masked
    labels = np.ma.array(np.arange(len(cloud)) % 4)
    labels[7] = np.ma.masked
    stamps = np.arange(len(cloud)).astype("datetime64[ms]")
    map = VoxelMap(Lattice("fcc", 0.5), labels=True, stamps=True)
    report = map.insert(masked, labels=labels, stamps=stamps)
    assert (report["points"], report["masked"], report["inserted"]) == (5000, 3, 4997)
    keep = np.ones(len(cloud), bool)
    keep[[5, 7, 9]] = False
    expected = VoxelMap(Lattice("fcc", 0.5), labels=True, stamps=True)
    expected.insert(cloud[keep], labels=labels.data[keep], stamps=stamps[keep])
    assert map == expected
    plain = VoxelMap(Lattice("fcc", 0.5))
    assert plain.insert(np.ma.array(cloud))["masked"] == 0
    for call in [plain.lattice.quantize, plain.query, lambda xyz: gicp(xyz, cloud)]:
        with pytest.raises(ValueError, match="row 5 is masked"):
            call(masked)
    with pytest.raises(ValueError, match="masked"):
        plain.lattice.centers(np.ma.array([[1, 2, 3]], mask=True))


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_datetimes_are_stamps(cloud, unit):
    start = np.datetime64("2024-05-06T07:08:09", unit)
    stamps = start + np.arange(len(cloud))
    map = VoxelMap(Lattice("cubic", 1e6), stamps=True)
    map.insert(cloud, stamps=stamps)
    found = map.stamps()
    assert found.dtype == np.dtype("datetime64[ns]") and found.shape == (len(map), 2)
    assert found.min() == stamps[0] and found.max() == stamps[-1]
    one = VoxelMap(Lattice("cubic", 1e6), stamps=True)
    one.insert(cloud, stamps=start)
    assert (one.stamps() == start).all()
    both = VoxelMap(Lattice("cubic", 1e6), stamps=True)
    both.insert(cloud, stamps=stamps.astype("datetime64[ns]").astype(np.int64))
    assert both == map


@pytest.mark.parametrize(
    "stamps, expected",
    [
        (2**63, "9223372036854775808 is not below 2^63"),
        (2**70, "1180591620717411303424 is not below 2^63"),
        (np.array([0, 2**63 + 5], np.uint64), "row 1 of stamps: 9223372036854775813"),
        ([1, 2**64], "18446744073709551616"),
        (np.array(["2024-01-01", "NaT"], "datetime64[ns]"), "row 1 of stamps: NaT"),
        (np.array(["2024-01-01", "3024-01-01"], "datetime64[s]"), "row 1 of stamps: 3024-01-01T00:00:00"),
        ([1, 2, 3], "2 points and 3 stamps"),
        ([[1, 2]], "stamps of shape [1, 2]"),
    ],
)
def test_stamps_that_are_none_are_refused_by_name(stamps, expected):
    map = VoxelMap(Lattice("fcc", 1.0), stamps=True)
    with pytest.raises(ValueError) as error:
        map.insert(np.zeros((2, 3)), stamps=stamps)
    assert expected in str(error.value)


@pytest.mark.parametrize("stamps", [1.5, [0.1, 0.2], ["a", "b"], np.array([1, 2], "timedelta64[s]"), None])
def test_stamps_of_other_types_are_type_errors(stamps):
    map = VoxelMap(Lattice("fcc", 1.0), stamps=True)
    with pytest.raises((TypeError, ValueError), match="stamps"):
        map.insert(np.zeros((2, 3)), stamps=stamps)


@pytest.mark.parametrize("shape", [(3,), (6, 2), (2, 6), (1, 3, 1), (0,), (3, 4)])
def test_other_shapes_are_refused_with_the_shape(shape):
    lattice, map = Lattice("fcc", 1.0), VoxelMap(Lattice("fcc", 1.0))
    calls = [lattice.quantize, map.insert, map.query, lambda xyz: gicp(xyz, xyz), lambda w: lattice.centers(w.astype(int))]
    for call in calls:
        with pytest.raises(ValueError) as error:
            call(np.zeros(shape))
        assert str(list(shape)) in str(error.value)


@pytest.mark.parametrize("shape", [(2, 8), (8, 2), (16,), (1, 16), (3, 4), (3, 3), (4, 4, 1)])
def test_init_is_a_matrix_of_four_by_four(shape, cloud):
    with pytest.raises(ValueError) as error:
        gicp(cloud, cloud, np.eye(16)[:1].repeat(16).reshape(-1)[: int(np.prod(shape))].reshape(shape))
    assert f"init has shape {list(shape)}" in str(error.value)


@pytest.mark.parametrize(
    "xyz",
    [
        np.zeros((4, 3), complex),
        np.zeros((4, 3), bool),
        np.full((4, 3), "1"),
        np.full((4, 3), None),
        np.zeros((4, 3), "datetime64[s]"),
        [[None, 1, 2]],
    ],
)
def test_what_is_no_number_is_a_type_error(xyz):
    with pytest.raises(TypeError, match="not float32 or float64"):
        Lattice("fcc", 1.0).quantize(xyz)


def test_cells_are_integers():
    lattice = Lattice("fcc", 1.0)
    with pytest.raises(TypeError, match="float64"):
        lattice.centers(np.full((1, 3), 0.7))
    with pytest.raises(TypeError, match="uint64"):
        lattice.centers(np.zeros((1, 3), np.uint64))
    np.testing.assert_array_equal(lattice.centers(np.ones((2, 3), np.uint8)), lattice.centers([[1, 1, 1]] * 2))
