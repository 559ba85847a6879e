"""PLY and PCD files."""

import os
import struct
import warnings

import numpy as np
import pytest

from lattice_core import Lattice, VoxelMap, read_points, write_points

XYZ = np.array([[1.5, -2.25, 3.0], [np.nan, 0, 0], [4e5 + 0.125, 5.4e6, -0.5]])
LABELS = np.array([7, 65535, 0])


@pytest.mark.parametrize("kind", ["ply", "pcd"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("labels", [None, LABELS])
def test_what_is_written_is_read(tmp_path, kind, dtype, labels):
    path = tmp_path / f"points.{kind}"
    write_points(path, XYZ.astype(dtype), labels)
    xyz, found = read_points(path)
    np.testing.assert_array_equal(xyz, XYZ.astype(dtype).astype(float))
    if labels is None:
        assert found is None
    else:
        assert found.dtype == np.int32 and found.tolist() == [7, -1, 0]
    write_points(path, XYZ[:0], None if labels is None else labels[:0])
    xyz, found = read_points(path)
    assert xyz.shape == (0, 3) and (found is None) == (labels is None)


def test_means_of_a_map_go_there_and_back(tmp_path):
    map = VoxelMap(Lattice("fcc", 0.5), labels=True)
    map.insert(np.random.default_rng(1).uniform(-9, 9, (5000, 3)), labels=np.arange(5000) % 3 - 1)
    write_points(tmp_path / "map.ply", map.means(), map.labels())
    xyz, labels = read_points(tmp_path / "map.ply")
    np.testing.assert_array_equal(xyz, map.means())
    np.testing.assert_array_equal(labels, map.labels())


def test_pcd_is_single_where_that_keeps_a_quarter_of_a_millimetre(tmp_path):
    near = np.random.default_rng(1).uniform(-4095, 4095, (100, 3))
    for xyz, size in [(near, 4), (near + [5000, 0, 0], 8)]:
        write_points(tmp_path / "points.pcd", xyz)
        assert f"SIZE {size} {size} {size}\n".encode() in (tmp_path / "points.pcd").read_bytes()
        assert np.abs(read_points(tmp_path / "points.pcd")[0] - xyz).max() <= (0.00025 if size == 4 else 0)


def rows_of(order):
    return b"".join(struct.pack(order + "BfffH", 9, x, y, z, label) for (x, y, z), label in zip([(1, 2, 3), (-4, 5, 6)], (3, 65535)))


PLY = "ply\nformat {}\ncomment by hand\nelement camera 2\nproperty uchar a\nelement vertex 2\nproperty uchar red\nproperty float x\nproperty float y\nproperty float z\nproperty ushort label\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_ply_of_others(tmp_path, end):
    files = {
        "ascii 1.0": b"1\n2\n9 1 2 3 3\n9 -4 5 6 65535\n3 0 1 0\n",
        "binary_little_endian 1.0": b"ab" + rows_of("<") + b"face",
        "binary_big_endian 1.0": b"ab" + rows_of(">") + b"face",
    }
    for kind, data in files.items():
        header = PLY.format(kind).replace("\n", end).encode()
        (tmp_path / "other.ply").write_bytes(header + data)
        xyz, labels = read_points(tmp_path / "other.ply")
        assert xyz.tolist() == [[1, 2, 3], [-4, 5, 6]] and labels.tolist() == [3, -1], kind


PCD = "# .PCD v.7\nVERSION .7\nFIELDS rgb x y z normal label\nSIZE 1 4 4 8 4 4\nTYPE U F F F F U\nCOUNT 1 1 1 1 2 1\nWIDTH 2\nHEIGHT 1\nVIEWPOINT {}\nPOINTS 2\nDATA {}\n"


def test_pcd_of_others(tmp_path):
    values = [(9, 1, 2, 3, 0, 0, 3), (9, -4, 5, 6, 0, 0, 65535)]
    text = "\n".join(" ".join(map(str, row)) for row in values).encode() + b"\n"
    binary = b"".join(struct.pack("<BffdffI", *row) for row in values)
    columns = b"".join(struct.pack("<2" + kind, *column) for kind, column in zip("BffdffI", zip(*values)))
    # The normals are one field.
    packed = b"".join(bytes([len(part) - 1]) + part for part in (columns[i : i + 32] for i in range(0, len(columns), 32)))
    compressed = struct.pack("<II", len(packed), len(columns)) + packed
    for kind, data in [("ascii", text), ("binary", binary), ("binary_compressed", compressed)]:
        for view in ["0 0 0 1 0 0 0", "0.0 0 0 1.0 0 0 0"]:
            (tmp_path / "other.pcd").write_bytes(PCD.format(view, kind).encode() + data)
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                xyz, labels = read_points(tmp_path / "other.pcd")
            assert xyz.tolist() == [[1, 2, 3], [-4, 5, 6]] and labels.tolist() == [3, -1], kind
        (tmp_path / "other.pcd").write_bytes(PCD.format("100 0 0 1 0 0 0", kind).encode() + data)
        with pytest.warns(UserWarning, match="VIEWPOINT 100 0 0 1 0 0 0 .* is not applied"):
            read_points(tmp_path / "other.pcd")


def test_copies_of_lzf_are_unpacked(tmp_path):
    # 24 equal bytes: a literal, a copy of 9 + 2 and a copy of 10 + 2 bytes from one byte back.
    packed = bytes([0, 0, 0xE0, 4, 0, 0xE0, 3, 0])
    header = "VERSION .7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA binary_compressed\n"
    header = header.encode()
    length = 1 + (7 + 4 + 2) + (7 + 3 + 2)
    (tmp_path / "zero.pcd").write_bytes(header + struct.pack("<II", len(packed), length) + packed)
    with pytest.raises(ValueError, match="24 bytes, the compressed ones 26"):
        read_points(tmp_path / "zero.pcd")
    packed = bytes([0, 0, 0xE0, 3, 0, 0xE0, 2, 0])
    (tmp_path / "zero.pcd").write_bytes(header + struct.pack("<II", len(packed), 24) + packed)
    assert read_points(tmp_path / "zero.pcd")[0].tolist() == [[0, 0, 0]]


def spoiled():
    ply, pcd = PLY.format("ascii 1.0"), PCD.format("0 0 0 1 0 0 0", "ascii")
    binary = PLY.format("binary_little_endian 1.0")
    return [
        (b"", "neither PLY"),
        (b"x y z\n1 2 3\n", "neither PLY"),
        (b"ply\nformat ascii 1.0\n", "does not end"),
        (b"ply\n" + b"comment\n" * 99_999, "longer than"),
        (ply.replace("vertex 2", "vertex -2").encode(), "line 6"),
        (ply.replace("element vertex", "element point").encode(), "no element vertex"),
        (ply.replace("float x", "float X").encode(), "no field x among"),
        (ply.replace("float y", "float x").encode(), "two fields are named x"),
        (ply.replace("float y", "quad y").encode(), "line 9"),
        (ply.encode() + b"1\n2\n9 1 2 3 3\n", "has 1 points of 2"),
        (ply.encode() + b"1\n2\n9 1 2 3\n", "row 0 has 4 numbers, not 5"),
        (ply.encode() + b"1\n2\n9 1,5 2 3 4\n", '"1,5" is no number'),
        (ply.encode() + b"1\n2\n9 1 2 3 -7\n9 1 2 3 1\n", "label -7"),
        (ply.replace("format ascii", "format text").encode(), "text"),
        (binary.replace("vertex 2", f"vertex {2**63}").encode() + b"ab" + rows_of("<"), "the file has 30"),
        (binary.encode() + b"ab" + rows_of("<")[:-1], "take 30 bytes, the file has 29"),
        (binary.replace("property uchar a", "property list uchar int a").encode(), "element camera has lists"),
        (pcd.replace("POINTS 2", "POINTS 3").encode(), "POINTS is 3"),
        (pcd.replace("WIDTH 2", f"WIDTH {2**63}").encode(), "POINTS is 2"),
        (pcd.replace("SIZE 1", "SIZE").encode(), "6 FIELDS have 5 SIZE"),
        (pcd.replace("TYPE U F", "TYPE U I").replace("SIZE 1 4", "SIZE 1 3").encode(), "TYPE I and SIZE 3"),
        (pcd.replace("COUNT 1 1", "COUNT 1 3").encode(), "field x has 3 numbers"),
        (pcd.replace("DATA ascii", "DATA zip").encode(), "zip"),
        (pcd.replace("FIELDS", "FELDER").encode(), "no FIELDS"),
        (pcd.replace("DATA ascii", "DATA binary_compressed").encode() + b"\0\0\0", "cut off"),
        (pcd.replace("DATA ascii", "DATA binary_compressed").encode() + struct.pack("<II", 2, 58) + b"\x20\x00", "bytes back"),
        (pcd.replace("DATA ascii", "DATA binary_compressed").encode() + struct.pack("<II", 2, 58) + b"\x05\x00", "within a piece"),
        (pcd.replace("DATA ascii", "DATA binary_compressed").encode() + struct.pack("<II", 2**31, 58) + b"\x05\x00", "cut off"),
    ]


@pytest.mark.parametrize("number", range(28))
def test_files_that_are_damaged_are_refused_with_the_place(tmp_path, number):
    data, expected = spoiled()[number]
    path = tmp_path / "spoiled"
    path.write_bytes(data)
    with pytest.raises(ValueError) as error:
        read_points(path)
    assert expected in str(error.value) and str(path) in str(error.value)


def test_errors_of_files_are_those_of_python(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_points(tmp_path / "none.ply")
    with pytest.raises(FileNotFoundError):
        write_points(tmp_path / "no" / "none.ply", XYZ)
    path = tmp_path / "points.ply"
    write_points(path, XYZ)
    before = path.read_bytes()
    for labels in [[1, 2], [1, 2, 70_000]]:
        with pytest.raises(ValueError):
            write_points(path, XYZ, labels)
    with pytest.raises(ValueError, match="ends in .ply or .pcd"):
        write_points(tmp_path / "points.xyz", XYZ)
    assert path.read_bytes() == before and os.listdir(tmp_path) == ["points.ply"]
