"""Registration beside small_gicp, near the origin and far from it."""

from pathlib import Path

import numpy as np
import pytest

from lattice_core import gicp

PAIR = Path(__file__).parents[4] / "shared" / "data" / "pairs" / "small_gicp"
SHIFTS = {"0": (0, 0, 0), "10 km": (1e4, -1e4, 0), "1000 km": (1e6, 1e6, 0), "utm": (450_000, 5_400_000, 300)}
TRUTH = np.array(
    [
        [0.999925, 0.0121483, -0.00177009, 0.488882],
        [-0.0121523, 0.999924, -0.00228657, 0.121214],
        [0.00174218, 0.00230791, 0.999996, -0.0253342],
        [0, 0, 0, 1],
    ]
)


def walls(seed=1):
    """The example of the page."""
    random = np.random.default_rng(seed)
    target = random.uniform(0, 20, (60_000, 3)) * [1, 1, 0] + random.normal(0, 0.01, (60_000, 3))
    target[:20_000, 2] = random.uniform(0, 4, 20_000)
    target[:10_000, 0] = 0
    target[10_000:20_000, 1] = 0
    return target[::2] - [0.2, -0.1, 0.05], target


def points_of(path):
    with open(path, "rb") as file:
        header = file.read(2000).split(b"end_header\n")[0]
    count = int(header.split(b"element vertex ")[1].split()[0])
    return np.fromfile(path, np.float32, count * 4, offset=len(header) + 11).reshape(-1, 4)[:, :3].astype(float)


@pytest.fixture(scope="module")
def pair():
    if not PAIR.exists():
        pytest.skip("the pair of small_gicp is not in ../shared/data")
    return points_of(PAIR / "source.ply"), points_of(PAIR / "target.ply")


def about(pose, shift):
    """The same motion of points that are `shift` away."""
    moved = pose.copy()
    moved[:3, 3] += shift - pose[:3, :3] @ shift
    return moved


def distance(pose, other, at):
    """Metres between where two poses take a point, and degrees between them."""
    metres = np.linalg.norm((pose @ [*at, 1] - other @ [*at, 1])[:3])
    turn = np.clip((np.trace(pose[:3, :3].T @ other[:3, :3]) - 1) / 2, -1, 1)
    return metres, np.degrees(np.arccos(turn))


@pytest.mark.parametrize("settings", [{}, {"num_neighbors": 20}, {"max_iterations": 3}, {"num_threads": 2}])
def test_it_is_small_gicp_at_equal_settings(settings):
    small_gicp = pytest.importorskip("small_gicp")
    source, target = walls()
    found = gicp(source, target, cell=0.25, **settings)
    if "num_neighbors" in settings:
        prepared = [small_gicp.preprocess_points(points, 0.25, settings["num_neighbors"]) for points in (target, source)]
        (target_points, tree), (source_points, _) = prepared
        result = small_gicp.align(target_points, source_points, tree)
    else:
        options = {name: value for name, value in settings.items() if name == "max_iterations"}
        result = small_gicp.align(target, source, downsampling_resolution=0.25, **options)
    metres, degrees = distance(found.target_from_source, result.T_target_source, (10, 10, 0))
    assert metres < 2e-5 and degrees < 5e-4, (metres, degrees)
    assert abs(found.inliers / result.num_inliers - 1) < 0.005
    # Its Hessian is in rotation and translation.
    order = [3, 4, 5, 0, 1, 2]
    np.testing.assert_allclose(found.hessian, result.H[np.ix_(order, order)], rtol=2e-3, atol=1e-3 * np.abs(result.H).max())


@pytest.mark.parametrize("place", SHIFTS)
def test_the_pair_is_registered_wherever_it_is(pair, place):
    small_gicp = pytest.importorskip("small_gicp")
    source, target = pair
    shift = np.array(SHIFTS[place], float)
    found = gicp(source + shift, target + shift, cell=0.25)
    assert found.converged
    # The grid of the cells lies elsewhere in the points, so that others are thinned to one.
    result = small_gicp.align(target, source, downsampling_resolution=0.25)
    middle = source.mean(axis=0)
    metres, degrees = distance(found.target_from_source, about(result.T_target_source, shift), middle + shift)
    assert metres < 0.01 and degrees < 0.02, (metres, degrees)
    # The pose that comes with the pair is as far off as its own tests allow.
    metres, degrees = distance(found.target_from_source, about(TRUTH, shift), middle + shift)
    assert metres < 0.2 and degrees < 2.5, (metres, degrees)


def test_the_covariance_is_what_other_noise_does():
    poses, covariances = [], []
    random = np.random.default_rng(5)
    source, target = walls()
    for _ in range(25):
        noisy = source + random.normal(0, 0.02, source.shape)
        found = gicp(noisy, target + random.normal(0, 0.02, target.shape), cell=0.25)
        poses.append(found.target_from_source[:3, 3])
        covariances.append(found.covariance)
    spread = np.std(poses, axis=0)
    told = np.sqrt(np.mean(covariances, axis=0).diagonal())[:3]
    assert (told > spread / 4).all() and (told < spread * 4).all(), (told, spread)
    np.testing.assert_allclose(covariances[0], covariances[0].T)
    assert (np.linalg.eigvalsh(covariances[0]) > 0).all()


def test_a_pose_that_was_printed_is_a_pose():
    source, target = walls()
    angle = np.radians(1)
    exact = np.eye(4)
    exact[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    exact = about(exact, np.array([10.0, 10.0, 0.0]))
    expected = gicp(source, target, exact, cell=0.25).target_from_source
    for init in [np.round(exact, 6), np.round(exact, 4), exact.astype(np.float32), exact.tolist(), np.asfortranarray(exact)]:
        found = gicp(source, target, init, cell=0.25)
        assert distance(found.target_from_source, expected, (10, 10, 0))[0] < 1e-3
    assert gicp(source, target, TRUTH, cell=0.25).converged


def spoiled_poses():
    mirrored, scaled, nan, shifted, coarse = (np.eye(4) for _ in range(5))
    mirrored[0, 0] = -1
    scaled[:3, :3] *= 1.001
    nan[0, 3] = np.nan
    shifted[3, 0] = 1
    coarse[0, 1] = 0.01
    return [(mirrored, "determinant"), (scaled, "at most 1.5e-4"), (nan, "not finite"), (shifted, "last row"), (coarse, "7.0"), (np.zeros((4, 4)), "last row")]


@pytest.mark.parametrize("number", range(6))
def test_what_is_no_pose_is_refused(number):
    pose, expected = spoiled_poses()[number]
    source, target = walls()
    with pytest.raises(ValueError) as error:
        gicp(source[:100], target[:100], pose)
    assert expected in str(error.value) and "init" in str(error.value)


@pytest.mark.parametrize(
    "settings, expected",
    [
        ({"num_neighbors": 2}, "num_neighbors 2 is outside 3..=64"),
        ({"num_neighbors": 65}, "num_neighbors 65"),
        ({"num_threads": 0}, "num_threads 0"),
        ({"num_threads": -1}, "num_threads -1"),
        ({"max_iterations": 0}, "max_iterations 0"),
        ({"max_distance": 0.0}, "max_distance 0 m"),
        ({"max_distance": float("nan")}, "max_distance NaN m"),
        ({"cell": -1.0}, "cell -1 m"),
    ],
)
def test_settings_out_of_range_are_refused(settings, expected):
    source, target = walls()
    with pytest.raises(ValueError) as error:
        gicp(source, target, **settings)
    assert expected in str(error.value)


def test_points_that_are_not_finite_are_named():
    source, target = walls()
    source[8, 2] = np.nan
    for cell in [None, 0.25]:
        with pytest.raises(ValueError, match="source: row 8 is not finite"):
            gicp(source, target, cell=cell)
