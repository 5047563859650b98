"""What is bounded still reads what honest files hold."""

import json
import sqlite3

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
import pytest
import shapely

import evocity
from evocity.errors import GenomeError, MapError, RunError
from evocity.io import geopackage_sql, polygon_repair, read_map
from evocity.report import failures
from evocity.store import RunLog, read_limits
from evocity.store.read_limits import read_through

CORNER = (770000.0, 6270000.0)


@pytest.fixture
def package(tmp_path):
    """A GeoPackage of 16 boxes, 3 m and 9 m high by turns, in the layer ``hidden``."""
    places = np.stack(np.meshgrid(range(4), range(4)), -1).reshape(-1, 2) * 12 + CORNER
    boxes = np.array([shapely.box(x, y, x + 9, y + 9) for x, y in places])
    pyogrio.raw.write(
        tmp_path / "a.gpkg",
        shapely.to_wkb(boxes),
        [np.tile([3.0, 9.0], 8)],
        ["height"],
        layer="hidden",
        geometry_type="Polygon",
        crs="EPSG:2154",
    )
    return tmp_path / "a.gpkg"


def viewed(path, view: str):
    """The ``view`` in place of the layer."""
    file = sqlite3.connect(path)
    for table in ("gpkg_contents", "gpkg_geometry_columns"):
        file.execute(f"UPDATE {table} SET table_name = 'seen'")
    file.execute(f'CREATE VIEW "seen" AS {view}')
    file.commit()
    file.close()
    return path


def test_an_honest_view_is_read(package):
    low = "SELECT fid AS OGC_FID, geom, height FROM hidden WHERE height < 5"
    city = read_map(viewed(package, low), pixels=32)
    assert set(np.unique(city.heights)) == {0.0, 3.0}
    assert sum(city.height_rules.values()) == 8


@pytest.mark.parametrize(
    ("view", "found"),
    [
        ("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
         "SELECT i AS fid, geom, 3.0 AS height FROM n, hidden", "longer than"),
        ("WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) "
         "SELECT i AS fid, geom FROM n, hidden WHERE i < 0", "longer than"),
        ("SELECT fid, geom, random() AS height FROM hidden", "not authorized"),
        ("SELECT fid, geom, hex(randomblob(9)) AS name FROM hidden", "not authorized"),
        ("SELECT a.fid, a.geom FROM hidden a, hidden b, hidden c, hidden d", "more than 1000 rows"),
    ],
)  # fmt: skip
def test_a_view_without_end_is_refused(package, view, found, monkeypatch):
    monkeypatch.setattr(geopackage_sql, "SECONDS", 0.3)
    monkeypatch.setattr(geopackage_sql, "ROWS", 1000)
    path = viewed(package, view)
    before = sorted(path.parent.iterdir())
    with pytest.raises(MapError, match=found):
        read_map(path)
    assert sorted(path.parent.iterdir()) == before


def scribble(corners: int) -> shapely.Polygon:
    return shapely.Polygon(np.random.default_rng(0).random((corners, 2)))


def test_crossings_are_counted():
    bowtie = shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])
    assert polygon_repair.crossings(shapely.box(0, 0, 1, 1)) == 1  # the first side meets the last
    assert polygon_repair.crossings(bowtie) == 2
    assert polygon_repair.crossings(shapely.MultiPolygon([bowtie, shapely.box(3, 0, 4, 1)])) == 3
    assert polygon_repair.crossings(scribble(100)) == pytest.approx(100 * 100 / 2 * 0.23, rel=0.2)
    assert polygon_repair.crossings(scribble(1000), 500) == 501


def test_small_tangles_are_repaired_and_large_ones_painted(monkeypatch):
    polygons = np.array([shapely.box(0, 0, 1, 1), scribble(12), scribble(800)], object)
    found, tangled = polygon_repair.repair_polygons(polygons)
    assert tangled.tolist() == [False, False, True]
    assert shapely.is_valid(found[:2]).all()
    assert found[2] is polygons[2]
    monkeypatch.setattr(polygon_repair, "MOST_IN_ALL", 20)
    _, tangled = polygon_repair.repair_polygons(np.array([scribble(12)] * 4, object))
    assert not tangled[0]
    assert tangled[-1]


def test_a_tangle_is_painted_by_the_even_odd_rule(tmp_path, monkeypatch):
    """A square that goes round twice, with a bow across: once repaired, once as it is."""
    ring = [(0, 0), (1, 1), (1, 0), (0, 1), (0, 0)]
    square = [[3.87 + x * 1e-3, 43.53 + y * 1e-3] for x, y in ring]
    (tmp_path / "a.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [square]}))
    repaired = read_map(tmp_path / "a.geojson", pixels=64)
    monkeypatch.setattr(polygon_repair, "MOST", 0)
    assert np.array_equal(read_map(tmp_path / "a.geojson", pixels=64).heights, repaired.heights)
    assert repaired.built.any()


@pytest.mark.parametrize(
    "crs", ["EPSG:999999", "", "\x1b[31m", "PROJCS[", "+init=/etc/passwd", "A" * 10_000]
)
def test_a_genome_with_a_broken_reference_system(tmp_path, town, crs):
    evocity.encode(town).genome.write(tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet")
    about = json.loads(table.schema.metadata[b"evocity.genome"]) | {"crs": crs}
    told = table.replace_schema_metadata({"evocity.genome": json.dumps(about)})
    pq.write_table(told, tmp_path / "a.parquet")
    with pytest.raises(GenomeError, match="crs = "):
        evocity.read_genome(tmp_path / "a.parquet")


@pytest.fixture
def old_run(tmp_path):
    """A run of an older release, whose files have no checksums, to be changed."""
    import shutil
    from pathlib import Path

    old = Path(__file__).parents[1] / "old" / "run-3"
    return Path(shutil.copytree(old, tmp_path / "run"))


def with_errors(run, texts: pa.Array) -> None:
    path = run / "births" / "generation-00000001.parquet"
    table = pq.read_table(path)
    at = table.column_names.index("error")
    status = table.column_names.index("status")
    kind = table.schema.field(status)
    table = table.set_column(status, kind, pa.array(["error"] * len(table)).cast(kind.type))
    pq.write_table(table.set_column(at, table.schema.field(at), texts.take(rows(table))), path)


def rows(table: pa.Table) -> pa.Array:
    return pa.array(np.zeros(len(table), np.int32))


@pytest.mark.parametrize(("most", "told"), [(1 << 26, "x" * 1000), (1 << 14, "MiB of error text")])
def test_long_errors_of_older_runs_are_cut_or_left_out(old_run, monkeypatch, most, told):
    monkeypatch.setattr(read_limits, "MOST_TEXT", most)
    with_errors(old_run, pa.array(["x" * 100_000]))
    run = RunLog(old_run)
    texts = [one for one in run.births(1, columns=["id", "error"])["error"].to_pylist() if one]
    assert texts
    assert all(told in one and len(one) <= 1000 for one in texts)
    assert run.births(1).schema.names == run.births(0).schema.names
    assert run.births(1).schema.field("error").type == pa.string()
    assert any(one.error for one in failures(run))


def test_a_billion_rows_are_not_read(old_run, monkeypatch):
    monkeypatch.setattr(read_limits, "MOST_ROWS", 3)
    with pytest.raises(RunError, match=r"rows in one generation|no generation 0"):
        RunLog(old_run).births(0, columns=["id"])


def test_more_parents_than_a_birth_can_have_are_not_read(old_run):
    path = old_run / "births" / "generation-00000001.parquet"
    table = pq.read_table(path)
    at = table.column_names.index("parents")
    kind = table.schema.field(at)

    def told(each: int) -> list[int]:
        column = pa.array([[0] * each] * len(table), kind.type)
        pq.write_table(table.set_column(at, kind, column), path)
        births = RunLog(old_run).births(1, columns=["id", "parents"])
        return [len(one) for one in births["parents"].to_pylist()]

    assert told(256) == [256] * len(table)
    assert len(RunLog(old_run).generations) > 1
    with pytest.raises(RunError, match=f"{257 * len(table)} values of parents in one generation"):
        told(257)


def test_more_parents_in_the_last_generation_are_not_read_either(old_run):
    """Whether it can be read is looked at first of all."""
    whole = len(RunLog(old_run).generations)
    path = sorted((old_run / "births").iterdir())[-1]
    table = pq.read_table(path)
    at = table.column_names.index("parents")
    column = pa.array([[0] * 257] * len(table), table.schema.field(at).type)
    pq.write_table(table.set_column(at, table.schema.field(at), column), path)
    with pytest.raises(ValueError, match="values of parents in one generation"):
        read_through(pq.ParquetFile(path), 0)
    assert len(RunLog(old_run).generations) == whole - 1


def test_an_array_that_is_not_there_is_not_made(old_run):
    path = next((old_run / "sources").glob("*.npy"))
    head = b"{'descr': '<f4', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    path.write_bytes(b"\x93NUMPY\1\0" + len(head).to_bytes(2, "little") + head)
    with pytest.raises(RunError, match="0 bytes for float32"):
        RunLog(old_run).sources()
