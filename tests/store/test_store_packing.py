"""How the columns of a log are packed: which are compressed, and that nothing is lost by it."""

import io
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_runs import write_toy

import evocity
from evocity import read_recipe
from evocity.search import Search
from evocity.store import layout, merge
from evocity.store.checksums import packing_of

OLD = sorted((Path(__file__).parent.parent / "old").glob("run-*[0-9]"))
SMALL = {"generation", "id", "parents", "operator", "status", "seconds", "feasible"}
TEXTS = {"made", "error", "genome"}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """One of births and one of membership."""
    folder = tmp_path_factory.mktemp("packed")
    recipe = read_recipe(write_toy(folder, population=40), generations=2)
    with Search(recipe, folder / "night", workers=0) as search:
        for _ in search:
            pass
    kinds = "births", "membership"
    return [sorted((folder / "night" / kind).glob("*.parquet"))[-1] for kind in kinds]


def leaves(file) -> dict:
    """What metadata tell of each column of a file's first row group, by its name."""
    group = pq.ParquetFile(file).metadata.row_group(0)
    found = [group.column(n) for n in range(group.num_columns)]
    return {one.path_in_schema.removesuffix(".list.element"): one for one in found}


def test_lists_and_texts_are_compressed_and_what_is_small_is_not(files):
    births, membership = map(leaves, files)
    small = {name for name, one in births.items() if one.compression == "UNCOMPRESSED"}
    assert small == SMALL | {name for name in births if name.startswith("fitness.")}
    others = {births[name].compression for name in births.keys() - small}
    assert others == {"ZSTD"}
    assert births.keys() - small > TEXTS | {"sigma", "beta", "x", "source"}
    assert {one.compression for one in membership.values()} == {"UNCOMPRESSED"}


def test_whole_numbers_are_differences(files):
    births, membership = map(leaves, files)
    differences = {
        name
        for name, one in [*births.items(), *membership.items()]
        if "DELTA_BINARY_PACKED" in one.encodings
    }
    assert differences == {"generation", "id", "parents", "slot", "rank", "source"}


def test_statistics_are_kept_of_what_is_small_alone(files):
    births, membership = map(leaves, files)
    assert births["id"].statistics.min is not None  # by which births are found
    for one in (*births.values(), *membership.values()):
        single = one.compression == "UNCOMPRESSED" and ".list." not in one.path_in_schema
        assert one.is_stats_set == single


def test_of_what_is_not_compressed_words_alone_have_dictionaries(files):
    births, membership = map(leaves, files)
    plain = [one for one in births.items() if one[1].compression == "UNCOMPRESSED"]
    found = {name for name, one in plain if one.has_dictionary_page}
    assert found == {"operator", "status"}
    assert not any(one.has_dictionary_page for one in membership.values())


def test_a_mark_may_be_called_as_births_parents_are():
    table, file = pa.table({"parents": [0.5, 2.0]}), io.BytesIO()
    with pq.ParquetWriter(file, table.schema, **packing_of(table.schema)) as writer:
        writer.write_table(table)
    assert pq.read_table(pa.BufferReader(file.getvalue())).equals(table)


def test_a_column_of_several_leaves_is_refused():
    with pytest.raises(TypeError, match="a column both of struct"):
        packing_of(pa.schema([("both", pa.struct([("a", pa.int32()), ("b", pa.int32())]))]))


@pytest.mark.parametrize("path", OLD, ids=lambda path: path.name)
def test_logs_of_older_releases_are_packed_anew_as_they_are_merged(path, tmp_path, monkeypatch):
    folder = shutil.copytree(path, tmp_path / "run")
    before = evocity.open_run(folder)
    for module in (layout, merge):
        monkeypatch.setattr(module, "SPANS", (4, 16))
    merge.merge(layout.Folder(folder))
    after = evocity.open_run(folder)
    assert before.births().equals(after.births())
    assert before.members().equals(after.members())
    for kind in ("births", "membership"):
        (file,) = (folder / kind).glob("*.parquet")
        packing = packing_of(pq.ParquetFile(file).schema_arrow)["compression"]
        group = pq.ParquetFile(file).metadata.row_group(1)
        for one in map(group.column, range(group.num_columns)):
            wanted = packing[one.path_in_schema]
            assert one.compression == {"none": "UNCOMPRESSED", "zstd": "ZSTD"}[wanted]


def test_a_log_is_smaller_than_one_of_which_all_is_compressed(files):
    for file in files:
        table = pq.read_table(file)
        compressed = {"compression": "zstd", "compression_level": 3, "write_page_checksum": True}
        assert written(table, packing_of(table.schema)) < written(table, compressed)


def written(table: pa.Table, packing: dict) -> int:
    file = io.BytesIO()
    with pq.ParquetWriter(file, table.schema, **packing) as writer:
        writer.write_table(table)
    return len(file.getvalue())


WHOLE = st.one_of(st.none(), st.integers(-(2**63), 2**63 - 1))
COLUMNS = {
    "id": (pa.int64(), WHOLE),
    "slot": (pa.int32(), st.one_of(st.none(), st.integers(-(2**31), 2**31 - 1))),
    "parents": (pa.list_(pa.int64()), st.one_of(st.none(), st.lists(WHOLE, max_size=4))),
    "operator": (pa.dictionary(pa.int32(), pa.string()), st.one_of(st.none(), st.text())),
    "made": (pa.string(), st.one_of(st.none(), st.text())),
    "fitness.a": (pa.float64(), st.one_of(st.none(), st.floats(allow_nan=False))),
    "feasible": (pa.bool_(), st.one_of(st.none(), st.booleans())),
    "x": (pa.list_(pa.uint16(), 2), st.lists(st.integers(0, 9), min_size=2, max_size=2)),
    "sigma": (pa.list_(pa.float32()), st.lists(st.floats(width=32, allow_nan=False), max_size=9)),
    "thumbnail": (pa.binary(3), st.one_of(st.none(), st.binary(min_size=3, max_size=3))),
}


@pytest.mark.slow
@given(st.data(), st.integers(0, 20), st.sets(st.sampled_from(sorted(COLUMNS)), min_size=1))
def test_what_is_read_is_what_was_written(data, count, names):
    columns = {
        name: pa.array(
            data.draw(st.lists(COLUMNS[name][1], min_size=count, max_size=count)),
            COLUMNS[name][0],
        )
        for name in names
    }
    table, file = pa.table(columns), io.BytesIO()
    with pq.ParquetWriter(file, table.schema, **packing_of(table.schema)) as writer:
        writer.write_table(table)
    if count:
        for name, one in leaves(pa.BufferReader(file.getvalue())).items():
            assert (one.compression == "ZSTD") == (name in ("made", "x", "sigma", "thumbnail"))
    assert pq.read_table(pa.BufferReader(file.getvalue())).equals(table)


def test_other_readers_read_it(files):
    """DuckDB, polars and pandas, as the notebook of SQL does."""
    pandas = pytest.importorskip("pandas")
    duckdb, polars = pytest.importorskip("duckdb"), pytest.importorskip("polars")
    for file in files:
        right = pq.read_table(file)
        names = [one for one in right.schema.names if one in SMALL | {"slot", "rank"}]
        select = ", ".join(f'"{name}"' for name in names)
        told = duckdb.sql(f"SELECT {select} FROM read_parquet('{file}')").fetchall()
        wanted = [tuple(row.values()) for row in right.select(names).to_pylist()]
        assert told == wanted
        assert polars.read_parquet(file, columns=names).rows() == wanted
        assert pandas.read_parquet(file)["id"].tolist() == right["id"].to_pylist()
        assert np.array_equal(polars.read_parquet(file)["id"].to_numpy(), right["id"].to_numpy())
