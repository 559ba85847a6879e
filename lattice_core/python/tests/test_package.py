"""The package as its users call it; needs numpy, pyarrow, and the packages that its test names."""

import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from lattice_core import Lattice, VoxelMap, calibrate, gicp


@pytest.fixture
def cloud():
    return np.random.default_rng(7).uniform(-20, 20, (50_000, 3)).astype(np.float32)


@pytest.mark.parametrize("name", ["cubic", "bcc", "fcc", "mcc", "hex", "hexopt"])
def test_a_point_is_in_the_cell_of_the_nearest_center(name, cloud):
    lattice = Lattice(name, 0.2)
    cells = lattice.quantize(cloud)
    assert cells.dtype == np.int32 and cells.shape == cloud.shape
    own = np.linalg.norm(lattice.centers(cells) - cloud, axis=1)
    for neighbor in np.vstack([np.eye(3, dtype=int), -np.eye(3, dtype=int)]):
        other = np.linalg.norm(lattice.centers(cells + neighbor) - cloud, axis=1)
        assert (own <= other + 1e-9).all()
    np.testing.assert_allclose(lattice.centers(np.eye(3, dtype=np.int64)), lattice.generator.T)
    np.testing.assert_array_equal(lattice.quantize(cloud.astype(np.float64)), cells)
    given = np.full(cloud.shape, 7, np.int32)
    assert lattice.quantize(cloud, out=given) is given
    np.testing.assert_array_equal(given, cells)


def test_labels_and_stamps_are_kept_and_maps_merge_exactly(cloud):
    labels = np.arange(len(cloud)) % 5
    stamps = np.repeat([100, 200], len(cloud) // 2)
    make = lambda: VoxelMap(Lattice("fcc", 1.0), labels=True, stamps=True)
    whole = make()
    report = whole.insert(cloud, labels=labels, stamps=stamps)
    assert report["inserted"] == len(cloud) == whole.points
    first, second = make(), make()
    first.insert(cloud[::2], labels=labels[::2], stamps=stamps[::2])
    second.insert(cloud[1::2], labels=labels[1::2], stamps=stamps[1::2])
    first.merge(second)
    assert pa.table(first.to_arrow()).equals(pa.table(whole.to_arrow()))
    rows = pa.table(whole.to_arrow()).to_pydict()
    assert sum(entry["n"] for row in rows["labels"] for entry in row) == len(cloud)
    assert set(rows["first_ns"]) <= {100, 200}


def test_a_table_in_any_order_is_the_map_again(cloud, tmp_path):
    import duckdb
    import polars

    map = VoxelMap(Lattice("mcc", 0.5), datum=(3.0, 2.0, 1.0), labels=True)
    map.insert(cloud, labels=np.full(len(cloud), 9))
    map.save(tmp_path / "map.lat")
    table = pa.table(map.to_arrow())
    shuffled = table.take(np.random.default_rng(1).permutation(len(map)))
    again = VoxelMap.from_arrow(shuffled)
    again.save(tmp_path / "again.lat")
    assert (tmp_path / "map.lat").read_bytes() == (tmp_path / "again.lat").read_bytes()
    assert len(polars.DataFrame(map.to_arrow())) == len(map)
    rows = table
    assert duckdb.sql("SELECT SUM(count) FROM rows").fetchall() == [(len(cloud),)]
    loaded = VoxelMap.load(tmp_path / "map.lat")
    assert loaded.lattice == map.lattice and len(loaded) == len(map)
    np.testing.assert_allclose(loaded.lattice.centers(loaded.cells()), loaded.centers(), atol=1e-12)


def test_the_map_file_is_that_of_the_independent_reader(cloud, tmp_path):
    text = (Path(__file__).parents[3] / "docs" / "map_file.md").read_text()
    reader = {}
    exec(text.split("```python\n")[1].split("```")[0], reader)
    map = VoxelMap(Lattice("fcc", 0.5))
    map.insert(cloud)
    map.save(tmp_path / "map.lat")
    name, volume_m3, _, datum, columns = reader["read_map"](tmp_path / "map.lat")
    assert (name, volume_m3, datum) == ("fcc", 0.5, [0, 0, 0])
    assert [count for count, in columns["count"]] == map.counts().tolist()


def test_the_nearest_cells_are_found(cloud):
    map = VoxelMap(Lattice("bcc", 2.0))
    map.insert(cloud[:500])
    distances, centers = map.query(cloud[500:600], k=3)
    all = np.linalg.norm(cloud[500:600, None] - map.centers()[None], axis=2)
    np.testing.assert_allclose(distances, np.sort(all, axis=1)[:, :3])
    assert centers.shape == (100, 3, 3)


def test_registration_finds_the_pose():
    random = np.random.default_rng(3)
    # Floor, two walls and a box.
    u, v = random.uniform(0, 6, (2, 6000))
    walls = [np.c_[u, v, 0 * u], np.c_[u, 0 * u, v / 2], np.c_[0 * u, u, v / 2], np.c_[2 + u / 6, 3 + v / 6, 1 + 0 * u]]
    target = np.vstack(walls) + random.normal(0, 0.003, (24_000, 3))
    angle = np.radians(4)
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    pose[:3, 3] = [0.1, -0.05, 0.02]
    source = (target[::2] - pose[:3, 3]) @ pose[:3, :3]
    found = gicp(source, target, cell=0.1)
    assert found.converged
    np.testing.assert_allclose(found.target_from_source, pose, atol=0.01)
    map = VoxelMap(Lattice("fcc", 0.001))
    map.insert(target)
    answer = calibrate(map, source, start=np.eye(4))
    assert answer.verdict in ("OK", "AMBIGUOUS"), answer
    assert answer.covariance.shape == (6, 6) and 0 <= answer.p_wrong <= 1


def refusals():
    fcc = Lattice("fcc", 1.0)
    nan = np.zeros((20, 3))
    nan[17, 1] = np.nan
    frozen = np.zeros((4, 3), np.int32)
    frozen.flags.writeable = False
    return [
        (lambda: Lattice("fc", 1.0), "fc"),
        (lambda: Lattice("fcc", -1.0), "-1"),
        (lambda: fcc.quantize(nan), "row 17"),
        (lambda: fcc.quantize(nan.astype(np.float32)), "row 17"),
        (lambda: fcc.quantize(np.full((1, 3), 1e9, np.float32)), "row 0"),
        (lambda: fcc.quantize(np.zeros((4, 2))), "[4, 2]"),
        (lambda: fcc.quantize(np.zeros((4, 3)), out=np.zeros((3, 3), np.int32)), "[3, 3], not (4, 3)"),
        (lambda: fcc.quantize(np.zeros((4, 3)), out=np.zeros((4, 3))), "int32"),
        (lambda: fcc.quantize(np.zeros((4, 3)), out=frozen), "out is not writable"),
        (lambda: fcc.quantize(np.zeros((4, 3)), out=np.zeros((4, 6), np.int32)[:, ::2]), "C order"),
        (lambda: fcc.quantize(np.array([["a", "b", "c"]])), "points are of <U1"),
        (lambda: VoxelMap(fcc).insert(np.zeros((4, 3)), labels=[1, 2, 3, 4]), "labels=True"),
        (lambda: VoxelMap(fcc, labels=True).insert(np.zeros((4, 3)), labels=[1, 2]), "4 points and 2 labels"),
        (lambda: VoxelMap(fcc, labels=True).insert(np.zeros((1, 3)), labels=[70_000]), "70000"),
        (lambda: VoxelMap(fcc).merge(VoxelMap(Lattice("bcc", 1.0))), "same lattice"),
        (lambda: VoxelMap.load("/nowhere/map.lat"), "/nowhere/map.lat"),
        (lambda: VoxelMap.from_arrow(pa.table({"ix": [1]})), "lattice_map"),
        (lambda: VoxelMap.from_arrow(7), "__arrow_c_stream__"),
        (lambda: gicp(np.zeros((9, 3)), np.zeros((9, 3)), np.ones((4, 4))), "rigid"),
        (lambda: calibrate(VoxelMap(fcc), np.zeros((9, 3)), profile="drone"), "drone"),
    ]


@pytest.mark.parametrize("number", range(20))
def test_what_is_refused_says_the_numbers(number):
    call, expected = refusals()[number]
    with pytest.raises((ValueError, TypeError, OSError)) as error:
        call()
    assert expected in str(error.value)


def test_the_gil_is_free_while_points_are_inserted():
    points = np.random.default_rng(5).uniform(-90, 90, (4_000_000, 3)).astype(np.float32)
    map = VoxelMap(Lattice("fcc", 0.001))
    worker = threading.Thread(target=map.insert, args=(points,))
    steps = 0
    worker.start()
    while worker.is_alive():
        steps += 1
        time.sleep(0.001)
    assert steps > 5


@pytest.mark.parametrize("page", ["README.md", "docs/python.md"])
def test_what_the_pages_say_runs(page, tmp_path):
    text = (Path(__file__).parents[3] / page).read_text()
    blocks = [rest.split("```")[0] for rest in text.split("```python\n")[1:]]
    assert blocks
    for block in blocks:
        subprocess.run([sys.executable, "-c", block], check=True, cwd=tmp_path)
