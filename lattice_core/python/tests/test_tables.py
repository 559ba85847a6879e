"""Tables to and from pyarrow, Polars, DuckDB and pandas."""

import numpy as np
import pyarrow as pa
import pytest

from lattice_core import Lattice, VoxelMap

duckdb = pytest.importorskip("duckdb")
polars = pytest.importorskip("polars")
pandas = pytest.importorskip("pandas")

LATTICE = Lattice("fcc", 0.5)


@pytest.fixture
def cloud():
    return np.random.default_rng(7).uniform(-20, 20, (30_000, 3))


@pytest.fixture
def map(cloud):
    map = VoxelMap(LATTICE, (3.0, 2.0, 1.0), labels=True, stamps=True)
    map.insert(cloud, labels=np.arange(len(cloud)) % 5, stamps=np.arange(len(cloud)))
    return map


@pytest.fixture
def plain(cloud):
    map = VoxelMap(LATTICE)
    map.insert(cloud)
    return map


def test_the_table_itself_and_its_metadata_are_the_map(map):
    for table in [map.to_arrow(), pa.table(map.to_arrow())]:
        again = VoxelMap.from_arrow(table)
        assert again == map and again.points == map.points and again.datum == map.datum


def engines(map):
    rows = pa.table(map.to_arrow())
    yield "polars", polars.DataFrame(map.to_arrow())
    yield "polars sorted", polars.DataFrame(map.to_arrow()).sort("count")
    yield "duckdb", duckdb.sql("SELECT * FROM rows ORDER BY count").to_arrow_table()
    yield "duckdb relation", duckdb.sql("SELECT * FROM rows")
    if hasattr(pandas.DataFrame, "__arrow_c_stream__"):
        frame = rows.to_pandas()
        for name in ["first_ns", "last_ns"]:
            if name in frame:
                frame[name] = frame[name].astype("Int64")
        yield "pandas", frame.sample(frac=1, random_state=1).reset_index(drop=True)


def test_engines_give_the_map_back(map, plain):
    for name, table in engines(map):
        again = VoxelMap.from_arrow(table, lattice=map.lattice, datum=map.datum)
        assert again == map, name
    for name, table in engines(plain):
        again = VoxelMap.from_arrow(table, lattice=plain.lattice)
        assert again == plain, name
        assert again.points == plain.points


@pytest.mark.parametrize("kind", ["int32", "uint64", "float64", "decimal128(38, 0)", "dictionary", "chunked", "large"])
def test_columns_come_as_engines_widen_and_pack_them(map, kind):
    table = pa.table(map.to_arrow())
    columns = {}
    for name in table.column_names:
        column = table[name].combine_chunks()
        if isinstance(column, pa.ChunkedArray):
            column = column.chunk(0)
        if name == "labels":
            if kind == "large":
                column = column.cast(pa.large_list(column.type.value_type))
        elif kind == "dictionary":
            column = column.dictionary_encode()
        elif kind == "decimal128(38, 0)":
            column = column.cast(pa.decimal128(38, 0))
        elif kind == "uint64" and name == "count":
            column = column.cast(kind)
        elif kind == "int32" and name in ("ix", "iy", "iz", "count"):
            column = column.cast(kind)
        elif kind == "float64":
            column = column.cast(kind)
        columns[name] = column
    packed = pa.table(columns)
    if kind == "chunked":
        packed = pa.concat_tables([packed[:7], packed[7:5000], packed[5000:5000], packed[5000:]])
    reordered = packed.select(packed.column_names[::-1])
    assert VoxelMap.from_arrow(reordered, lattice=map.lattice, datum=map.datum) == map


def test_the_hint_to_sum_first_works(cloud, map, plain):
    other = VoxelMap(LATTICE)
    other.insert(cloud[:9000] + [1.0, 0, 0])
    expected = VoxelMap(LATTICE)
    expected.merge(plain)
    expected.merge(other)
    pair = pa.concat_tables([pa.table(plain.to_arrow()), pa.table(other.to_arrow())])
    for lattice in [None, LATTICE]:
        with pytest.raises(ValueError, match="sum them first"):
            VoxelMap.from_arrow(pair, lattice=lattice)
    sums = "SUM(count) AS count, SUM(sum_x) AS sum_x, SUM(sum_y) AS sum_y, SUM(sum_z) AS sum_z"
    summed = duckdb.sql(f"SELECT ix, iy, iz, {sums} FROM pair GROUP BY ix, iy, iz")
    by_duckdb = VoxelMap.from_arrow(summed, lattice=LATTICE)
    frame = polars.DataFrame(pair).group_by("ix", "iy", "iz").agg(polars.sum("count", "sum_x", "sum_y", "sum_z"))
    by_polars = VoxelMap.from_arrow(frame, lattice=LATTICE)
    by_pyarrow = pair.group_by(["ix", "iy", "iz"]).aggregate([(name, "sum") for name in ("count", "sum_x", "sum_y", "sum_z")])
    by_pyarrow = by_pyarrow.rename_columns([name.replace("_sum", "") for name in by_pyarrow.column_names])
    by_pyarrow = VoxelMap.from_arrow(by_pyarrow, lattice=LATTICE)
    assert by_duckdb == by_polars == by_pyarrow == expected
    assert by_duckdb.points == expected.points
    # The metadata of one of the maps, kept by pyarrow, with the rows of both.
    kept = summed.to_arrow_table().replace_schema_metadata(pair.schema.metadata)
    assert VoxelMap.from_arrow(kept) == expected and VoxelMap.from_arrow(kept).points == expected.points
    # Labels and stamps too.
    twice = pa.concat_tables([pa.table(map.to_arrow())] * 2)
    sums += ", MIN(first_ns) AS first_ns, MAX(last_ns) AS last_ns, flatten(list(labels)) AS labels"
    summed = duckdb.sql(f"SELECT ix, iy, iz, {sums} FROM twice GROUP BY ix, iy, iz")
    map.merge(map)
    assert VoxelMap.from_arrow(summed, lattice=LATTICE, datum=map.datum) == map


def test_part_of_a_table_has_its_points(map, plain):
    table = pa.table(map.to_arrow())
    part = table.filter(pa.compute.greater(table["count"], 1))
    again = VoxelMap.from_arrow(part)
    assert again.points == pa.compute.sum(part["count"]).as_py() and len(again) == len(part)
    fewer = VoxelMap.from_arrow(table.select(["ix", "iy", "iz", "count", "sum_x", "sum_y", "sum_z"]), lattice=LATTICE)
    np.testing.assert_array_equal(fewer.counts(), map.counts())
    cells = VoxelMap.from_arrow(table.select(["ix", "iy", "iz"]), lattice=LATTICE)
    assert len(cells) == len(map) == cells.points
    empty = VoxelMap.from_arrow(table[:0])
    assert len(empty) == 0 == empty.points


def test_tables_far_away_have_a_datum(plain):
    far = VoxelMap(LATTICE, datum=(450_000, 5_400_000, 300))
    far.insert(plain.means() + far.datum)
    frame = polars.DataFrame(far.to_arrow())
    again = VoxelMap.from_arrow(frame, lattice=LATTICE)
    np.testing.assert_array_equal(np.sort(again.cells(), axis=0), np.sort(far.cells(), axis=0))
    assert VoxelMap.from_arrow(frame, lattice=LATTICE, datum=far.datum) == far
    with pytest.raises(ValueError, match="give datum= near the cells"):
        VoxelMap.from_arrow(frame, lattice=LATTICE, datum=(0, 0, 0))


def replaced(table, name, values):
    return table.set_column(table.column_names.index(name), name, values)


def test_nulls_are_refused_or_missing(map, plain):
    for name in ["ix", "iy", "iz", "count", "sum_x", "sum_y", "sum_z"]:
        table = pa.table(plain.to_arrow())
        values = table[name].to_pylist()
        values[11] = None
        with pytest.raises(ValueError) as error:
            VoxelMap.from_arrow(replaced(table, name, pa.array(values, pa.int64())))
        assert f"column {name!r}".replace("'", '"') in str(error.value) and "row 11" in str(error.value)
    table = pa.table(map.to_arrow())
    missing = pa.array([None] * len(table), pa.int64())
    stampless = VoxelMap.from_arrow(replaced(replaced(table, "first_ns", missing), "last_ns", missing))
    assert np.isnat(stampless.stamps()).all()
    with pytest.raises(ValueError, match="only one of first_ns and last_ns"):
        VoxelMap.from_arrow(replaced(table, "first_ns", missing))
    unlabelled = replaced(table, "labels", pa.array([None] * len(table), table["labels"].type))
    assert (VoxelMap.from_arrow(unlabelled).labels() == -1).all()
    cells = replaced(pa.table(plain.to_arrow()), "count", missing[: len(plain)])
    assert VoxelMap.from_arrow(cells, lattice=LATTICE).points == len(plain)


def spoiled(map):
    table = pa.table(map.to_arrow())
    rows = len(table)
    count = table["count"].to_pylist()
    return [
        (7, TypeError, "__arrow_c_stream__"),
        (np.zeros((4, 3)), TypeError, "__arrow_c_stream__"),
        (table.drop_columns(["sum_y"]), ValueError, '"sum_y"'),
        (table.replace_schema_metadata({}), ValueError, "give lattice="),
        (table.replace_schema_metadata({"lattice_map": "zz"}), ValueError, "damaged"),
        (table.replace_schema_metadata({"lattice_map": "00"}), ValueError, "lattice_map"),
        (replaced(table, "ix", pa.array(["1"] * rows)), TypeError, "Utf8"),
        (replaced(table, "ix", pa.array([0.5] * rows)), ValueError, "0.5"),
        (replaced(table, "count", pa.array([0] + count[1:])), ValueError, "without points"),
        (replaced(table, "count", pa.array([-1] + count[1:])), ValueError, "row 0 has count -1"),
        (replaced(table, "count", pa.array([2**40] + count[1:])), ValueError, "2^32"),
        (replaced(table, "sum_x", pa.array([2**40] * rows)), ValueError, "leave the cell"),
        (replaced(table, "ix", pa.array([2**30] + table["ix"].to_pylist()[1:])), ValueError, "2^20"),
        (replaced(table, "ix", pa.array([2**63] * rows, pa.uint64())), ValueError, "9223372036854775808"),
        (replaced(table, "labels", pa.array([[1]] * rows)), TypeError, "{label, n}"),
        (replaced(table, "labels", pa.array([[{"label": 70_000, "n": 1}]] * rows)), ValueError, "70000"),
        (replaced(table, "labels", pa.array([[{"label": None, "n": 1}]] * rows)), ValueError, "null"),
    ]


@pytest.mark.parametrize("number", range(17))
def test_tables_that_are_no_map_are_refused(map, number):
    table, kind, expected = spoiled(map)[number]
    with pytest.raises(kind) as error:
        VoxelMap.from_arrow(table)
    assert expected in str(error.value)
    if number == 3:
        with pytest.raises(ValueError, match="bcc"):
            VoxelMap.from_arrow(map.to_arrow(), lattice=Lattice("bcc", 0.5))
