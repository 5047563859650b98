"""`evocity decode`, `pattern` and `grow` write footprints with heights."""

import geopandas
import numpy as np
import pyogrio
import pytest
from cli_tools import AT_2_M, PLAIN, call, refused, write_town

import evocity
from evocity.fitness.heredity import building_sources


@pytest.fixture
def nowhere(tmp_path):
    path = tmp_path / "town.parquet"
    call("encode", write_town(tmp_path / "town.npy"), *AT_2_M, *PLAIN, "-o", path)
    return path


@pytest.fixture
def placed(tmp_path):
    path = tmp_path / "lyon.parquet"
    call("encode", "lyon-1er", "--pixels", 64, "-o", path)
    return path


def features(path) -> int:
    return pyogrio.read_info(path, layer=0)["features"]


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_a_decoded_map_as_footprints(tmp_path, placed, suffix):
    path = tmp_path / f"lyon{suffix}"
    assert call("decode", placed, "-o", path).stdout.endswith(f"wrote {path}\n")
    city = evocity.decode(evocity.read_genome(placed)).city
    assert features(path) == len(city.walls)
    straight = path.read_bytes()
    call("decode", placed, "--raw", "-o", path)
    assert path.read_bytes() != straight
    assert features(path) == len(city.buildings)
    back = evocity.read_map(path, pixels=64)
    np.testing.assert_array_equal(back.built, city.built)
    assert back.attribution == city.attribution


def read_footprints(path) -> geopandas.GeoDataFrame:
    if path.suffix == ".geoparquet":
        return geopandas.read_parquet(path)
    return geopandas.read_file(path, layer=0)


@pytest.mark.parametrize("suffix", [".gpkg", ".fgb", ".geoparquet"])
@pytest.mark.parametrize("raw", [(), ("--raw",)])
def test_footprints_of_a_child_name_their_source_cities(tmp_path, placed, suffix, raw):
    town, child, path = (
        tmp_path / "town.parquet",
        tmp_path / "child.parquet",
        tmp_path / f"a{suffix}",
    )
    call("encode", "new-york-west-village", "--pixels", 64, "-o", town)
    call("breed", "region_fusion", placed, town, "--seed", 3, "-o", child)
    call("decode", child, *raw, "-o", path)
    table = read_footprints(path)
    genome = evocity.read_genome(child)
    city = evocity.decode(genome).city
    named = building_sources(city, genome)
    assert list(table["source"]) == [named[k - 1] for k in table["id"]]
    assert len(set(named)) == 2
    if not raw:
        call("scene", child, "-o", path)
        assert list(read_footprints(path)["source"]) == list(table["source"])


def test_what_lies_nowhere_becomes_a_geopackage(tmp_path, nowhere):
    call("decode", nowhere, "--raw", "-o", tmp_path / "a.gpkg")
    city = evocity.decode(evocity.read_genome(nowhere)).city
    back = evocity.read_map(tmp_path / "a.gpkg", pixels=64)
    np.testing.assert_array_equal(back.built, city.built)
    call("pattern", "chessboard", "--pixels", 64, "-o", tmp_path / "b.gpkg")
    assert features(tmp_path / "b.gpkg") > 4
    call("grow", nowhere, "--width", 128, "--height", 96, "-o", tmp_path / "c.gpkg")
    assert features(tmp_path / "c.gpkg") > features(tmp_path / "a.gpkg")


def test_what_lies_nowhere_is_no_geojson(tmp_path, nowhere):
    path = tmp_path / "a.geojson"
    for words in (
        ("decode", nowhere),
        ("pattern", "radial"),
        ("grow", nowhere, "--width", 128, "--height", 96),
    ):
        told = refused(tmp_path, *words, "-o", path, says="no position in a")
        assert "write a .gpkg, which accepts local metres" in told


def test_only_footprints_have_pixels_edges_or_walls(tmp_path, placed):
    told = refused(tmp_path, "decode", placed, "--raw", "-o", tmp_path / "a.tif", says="tif")
    assert ".gpkg" in told


@pytest.mark.parametrize("name", ["lyon.geoparquet", "lyon.parquet"])
def test_geoparquet_is_a_map_and_not_a_genome(tmp_path, placed, name):
    footprints = tmp_path / "lyon.gpkg"
    call("decode", placed, "-o", footprints)
    path = tmp_path / "more" / name
    path.parent.mkdir()
    geopandas.read_file(footprints, layer="buildings").to_parquet(path)
    again = tmp_path / "again.parquet"
    call("encode", path, "--pixels", 64, "-o", again)
    left, right = (evocity.decode(evocity.read_genome(each)).city for each in (placed, again))
    assert (left.built != right.built).mean() < 0.06
    child = tmp_path / "child.parquet"
    refused(tmp_path, "decode", path, "-o", child.with_suffix(".tif"), says="is a map")
    refused(tmp_path, "encode", path, "-o", child.with_suffix(".geoparquet"), says="name of a map")
