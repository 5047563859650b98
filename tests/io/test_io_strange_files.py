"""Files that few programs write: places beside rasters, arcs, links, deep zips, flat terrains."""

import json
import os
import struct
import warnings
import zipfile
from decimal import Decimal

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pyogrio
import pytest
import rasterio
import shapely
from affine import Affine

from evocity.errors import EvocityError, MapError
from evocity.io import read_map
from evocity.io.map_paths import is_map_path, network_address
from evocity.recipe.reader import read_recipe
from tests.io import format_writers as w

X, Y = 842_000.0, 6_519_000.0  # EPSG:2154, Lyon
BOX = shapely.box(X, Y, X + 20, Y + 20)
TRANSFORM = Affine(2, 0, X, 0, -2, Y + 100)
ARC = struct.pack("<BIIBII6d", 1, 10, 1, 1, 8, 3, X, Y, X + 20, Y + 20, X, Y)
with_links = pytest.mark.skipif(os.name != "posix", reason="links and pipes")


def heights():
    values = np.zeros((50, 50), np.float32)
    values[10:20, 10:20] = 12
    return values


def write_tif(path, values=None, **more):
    values = heights() if values is None else values
    profile = {"driver": "GTiff", "count": 1, "dtype": "float32", "crs": "EPSG:2154"}
    profile |= dict(zip(("height", "width"), values.shape, strict=True)) | more
    with warnings.catch_warnings(action="ignore"), rasterio.open(path, "w", **profile) as target:
        target.write(values, 1)
    return path


# ---------------------------------------------------------------- the place of a raster


def test_the_place_of_a_tif_in_its_notes(tmp_path):
    path = write_tif(tmp_path / "a.tif", profile="BASELINE", transform=TRANSFORM)
    assert "<GeoTransform>" in (tmp_path / "a.tif.aux.xml").read_text()
    city = read_map(path)
    assert (city.metres_per_pixel, city.shape) == (2.0, (50, 50))
    assert city.north_west == pytest.approx((X, Y + 100))
    assert np.array_equal(city.heights, heights())


@pytest.mark.parametrize("suffix", [".tfw", ".TFW", ".wld"])
def test_the_place_of_a_tif_in_a_world_file(tmp_path, suffix):
    path = write_tif(tmp_path / "a.tif")
    lines = (2, 0, 0, -2, X + 1, Y + 99)
    path.with_suffix(suffix).write_text("\n".join(map(str, lines)))
    assert read_map(path).north_west == pytest.approx((X, Y + 100))


def test_a_tif_without_its_place_is_refused(tmp_path):
    path = write_tif(tmp_path / "a.tif")
    with pytest.raises(MapError, match="no place in it"):
        read_map(path)
    path.with_suffix(".tfw").write_text("2 0 0")
    with pytest.raises(MapError, match="a world file of six numbers"):
        read_map(path)
    path.with_suffix(".tfw").unlink()
    notes = "<PAMDataset><GeoTransform>1, 2</GeoTransform></PAMDataset>"
    (tmp_path / "a.tif.aux.xml").write_text(notes)
    with pytest.raises(MapError, match="GeoTransform has 2 numbers"):
        read_map(path)


# ---------------------------------------------------------------- terrains


def test_an_elevation_of_the_ground_must_fit(tmp_path):
    path = write_tif(tmp_path / "a.tif", heights() + 170, transform=TRANSFORM)
    assert read_map(path, terrain=170).heights.max() == 12
    for wrong, words in ((9999, "reaches from"), (300, "reaches from"), (172.5, "below the")):
        with pytest.raises(MapError, match=words):
            read_map(path, terrain=wrong)
    high = heights() + 170
    high[0, 0] = 5000
    path = write_tif(tmp_path / "b.tif", high, transform=TRANSFORM)
    with pytest.raises(MapError, match=r"a less 170 m reaches|b less 170 m reaches from 0 to 4830"):
        read_map(path, terrain=170)


def test_an_elevation_of_the_ground_for_a_raster_of_roofs_only(tmp_path):
    values = np.full((50, 50), np.nan, np.float32)
    values[5:15, 5:15], values[30:40, 30:40] = 176, 190
    path = write_tif(tmp_path / "a.tif", values, transform=TRANSFORM)
    assert read_map(path, terrain=170).heights.max() == 20
    with pytest.raises(MapError, match="200 pixels lie more than 2 m below"):
        read_map(path, terrain=195)


def test_a_zip_of_footprints_is_not_a_terrain(tmp_path):
    path = write_tif(tmp_path / "a.tif", heights() + 170, transform=TRANSFORM)
    w.write_geojson(tmp_path / "a.geojson", [BOX], [{"height": 9.0}])
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.write(tmp_path / "a.geojson", "a.geojson")
    with pytest.raises(MapError, match=r"the terrain a\.zip is not a raster"):
        read_map(path, terrain=tmp_path / "a.zip")


# ---------------------------------------------------------------- GeoParquet


def write_parquet(path, shapes, **columns):
    shapes = [one if isinstance(one, bytes) else shapely.to_wkb(one) for one in shapes]
    w.write_geoparquet(path, [BOX], [{}])
    about = pq.read_schema(path).metadata
    made = pa.table({"geometry": pa.array(shapes, pa.binary()), **columns})
    pq.write_table(made.replace_schema_metadata(about), path)
    return path


@pytest.mark.parametrize("kind", [pa.decimal128(6, 2), pa.decimal256(40, 2)])
def test_decimal_heights(tmp_path, kind):
    column = pa.array([Decimal("12.50"), None], kind)
    far = shapely.box(X + 40, Y, X + 60, Y + 20)
    city = read_map(write_parquet(tmp_path / "a.parquet", [BOX, far], height=column))
    assert sorted(set(city.heights[city.heights > 0].tolist())) == [6.0, 12.5]


def test_arcs_in_geoparquet_are_refused(tmp_path):
    for path in (tmp_path / "a.parquet", tmp_path / "buildings.parquet"):
        with pytest.raises(MapError, match=r"(?s)has arcs.*CONVERT_TO_LINEAR"):
            read_map(write_parquet(path, [BOX, ARC]))
    path = write_parquet(tmp_path / "b.parquet", [BOX, ARC] + [BOX] * 5000)
    with pytest.raises(MapError, match="has arcs"):
        read_map(path, center=(4.83, 45.76))


def test_a_cut_outline_costs_only_its_row(tmp_path):
    path = write_parquet(tmp_path / "a.parquet", [BOX, shapely.to_wkb(BOX)[:40]])
    city = read_map(path)
    assert city.heights.max() == 6
    assert "1 without a polygon" in city.taken


# ---------------------------------------------------------------- zips and Shapefiles


@pytest.mark.parametrize("names", [["a" * 300 + "/a.geojson"], ["b", "b/a.geojson"]])
def test_folders_of_a_zip_that_cannot_be_made(tmp_path, names):
    w.write_geojson(tmp_path / "a.geojson", [BOX], [{"height": 9.0}])
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        for name in names:
            packed.write(tmp_path / "a.geojson", name)
    if len(names) > 1:  # the folder b is not a part of the map
        assert read_map(tmp_path / "a.zip").heights.max() == 9
    else:
        with pytest.raises(MapError, match="cannot be unpacked: File name too long"):
            read_map(tmp_path / "a.zip")


def test_a_zip_with_a_file_in_the_place_of_a_folder(tmp_path):
    w.write_layer(tmp_path / "b.gdb", [BOX], [{"height": 9.0}])
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.writestr("b.gdb/c", "")
        packed.writestr("b.gdb/c/d", "")
    with pytest.raises(MapError, match="cannot be unpacked"):
        read_map(tmp_path / "a.zip")


def write_shapefile(path):
    pyogrio.raw.write(
        path,
        geometry=np.array([shapely.to_wkb(BOX)], dtype=object),
        field_data=[np.array([9.0])],
        fields=["height"],
        geometry_type="Polygon",
        crs="EPSG:2154",
        driver="ESRI Shapefile",
        encoding="UTF-8",
    )
    return path


@with_links
@pytest.mark.parametrize("kind", ["pipe", "link", "folder"])
@pytest.mark.parametrize("suffix", [".cpg", ".dbf", ".PRJ", ".qix"])
def test_parts_of_a_shapefile_are_plain_files(tmp_path, kind, suffix):
    path = write_shapefile(tmp_path / "a.shp")
    (tmp_path / "a.gdb").mkdir()  # another map of the same name
    assert read_map(path).heights.max() == 9
    part = path.with_suffix(suffix)
    part.unlink(missing_ok=True)
    if kind == "pipe":
        os.mkfifo(part)
    elif kind == "folder":
        part.mkdir()
    else:
        part.symlink_to("/etc/hostname")
    with pytest.raises(MapError, match=rf"a{suffix}.*is a link or not a regular file"):
        read_map(path)


# ---------------------------------------------------------------- maps in recipes


def check(tmp_path, place, **more):
    lines = [f"{key} = {json.dumps(value)}" for key, value in {"map": place, **more}.items()]
    text = "\n".join(["[[parents]]", *lines, "[[parents]]", 'map = "lyon-1er"'])
    (tmp_path / "recipe.toml").write_text(text)
    try:
        read_recipe(tmp_path / "recipe.toml")
    except EvocityError as error:
        return str(error)
    return ""


def test_a_file_gdb_is_a_parent(tmp_path):
    w.write_layer(tmp_path / "a.gdb", [BOX], [{"height": 9.0}])
    (tmp_path / "plain").mkdir()
    assert "a.gdb" not in check(tmp_path, "a.gdb")
    assert "'plain' is neither a file nor a bundled city" in check(tmp_path, "plain")
    assert is_map_path(tmp_path / "a.gdb")
    assert not is_map_path(tmp_path / "plain")


def test_an_address_is_not_a_file(tmp_path):
    for place in ("https://example.org/a.tif", "https:/example.org/a.tif"):
        words = check(tmp_path, place)
        assert "is an address on the network" in words
        assert "curl -L -O https://example.org/a.tif" in words
        with pytest.raises(MapError, match=r"curl -L -O https://example\.org/a\.tif"):
            read_map(place)
    assert "curl" in check(tmp_path, "lyon-1er", terrain="s3://bucket/a.tif")
    assert network_address("C:/maps/a.tif") is None
    assert network_address("/vsicurl/a") == "/vsicurl/a"
