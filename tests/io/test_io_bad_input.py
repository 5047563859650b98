"""Whatever is wrong with a file: one clear message, nothing on the terminal, nothing opened."""

import contextlib
import json
import os
import shutil
import sqlite3

import numpy as np
import osmium
import pyogrio
import pytest
import rasterio
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from evocity.citymap import MOST_ATTRIBUTION, CityMap
from evocity.errors import MapError
from evocity.io import (
    READERS,
    Footprints,
    Grid,
    Reader,
    bundled_cities,
    cities,
    map_reader,
    read_map,
    write_map,
)

BREAKABLE = [".geojson", ".gpkg", ".osm", ".osm.pbf", ".osm.gz", ".tif", ".png", ".npy"]

SQUARE = [[0.0, 0.0], [0.001, 0.0], [0.001, 0.001], [0.0, 0.001], [0.0, 0.0]]


@pytest.fixture
def refused(tmp_path, capfd):
    """Read a file of the given content; check the refusal and that nothing else is said."""

    def read(name, content, found, **options):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(
                content if isinstance(content, bytes) else json.dumps(content).encode()
            )
        before = sorted(tmp_path.rglob("*"))
        with pytest.raises(MapError, match=found) as fault:
            read_map(path, **options)
        assert all(fault.value.args)
        assert "Traceback" not in str(fault.value)
        assert capfd.readouterr() == ("", "")
        assert sorted(tmp_path.rglob("*")) == before
        return str(fault.value)

    return read


def collection(*geometries, **members):
    features = [{"type": "Feature", "properties": {}, "geometry": g} for g in geometries]
    return {"type": "FeatureCollection", "features": features, **members}


def polygon(*rings):
    return {"type": "Polygon", "coordinates": [*rings]}


def test_the_square_of_these_tests_is_read(tmp_path):
    (tmp_path / "a.geojson").write_text(json.dumps(collection(polygon(SQUARE))))
    assert read_map(tmp_path / "a.geojson").built.any()


@pytest.mark.parametrize("suffix", READERS)
def test_missing_empty_and_foreign_files(refused, suffix):
    refused(f"a{suffix}", None, "no file")
    refused(f"a{suffix}", b"", "is empty")
    refused(
        f"a{suffix}", b"\x00\x01\x02 nothing anybody knows" * 50, "holds data in an unknown format"
    )


def test_a_folder_a_wrong_suffix_and_a_missing_folder(refused, tmp_path):
    (tmp_path / "town.tif").mkdir()
    refused("town.tif", None, "is a folder")
    message = refused("a.docx", b"x", "no reader for .docx")
    assert all(suffix in message for suffix in READERS)
    refused("no/where/a.tif", None, "there is no folder")
    refused("a\0.tif", None, "no file|cannot be opened")


@pytest.mark.parametrize(
    ("name", "content", "found"),
    [
        ("a.tif", b"\x89PNG\r\n\x1a\n" + bytes(50), "holds PNG"),
        ("a.png", b"II*\x00" + bytes(50), "holds TIFF"),
        ("a.geojson", b"SQLite format 3\x00" + bytes(90), "holds SQLite"),
        ("a.gpkg", b'{"type": "FeatureCollection"}', "holds JSON"),
        ("a.osm", b"<html><body>404</body></html>", "holds XML"),
        ("a.osm.pbf", b"<osm version='0.6'></osm>", "holds OSM XML"),
        ("a.shp", b"PK\x03\x04" + bytes(90), "holds ZIP"),
        ("a.npy", b"PK\x03\x04" + bytes(90), "holds ZIP"),
    ],
)
def test_a_wrongly_named_file(refused, name, content, found):
    refused(name, content, found)


@pytest.mark.parametrize("name", ["a.gpkg", "a.shp", "a.osm", "a.tif"])
@pytest.mark.parametrize(
    "content",
    [
        b'<OGRVRTDataSource><OGRVRTLayer name="x"><SrcDataSource>/vsicurl/http://localhost:9/x'
        b"</SrcDataSource></OGRVRTLayer></OGRVRTDataSource>",
        b'<VRTDataset rasterXSize="9" rasterYSize="9"></VRTDataset>',
        b'<!DOCTYPE osm [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><osm>&b;</osm>',
    ],
)
def test_virtual_formats_are_never_opened(refused, name, content):
    refused(name, content, "holds XML")


@pytest.mark.parametrize(
    "source", ["/vsicurl/http://localhost:9/a.tif", "http://localhost:9/a.tif"]
)
def test_addresses_are_no_files(source):
    with pytest.raises(MapError, match="no file"):
        read_map(source)


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b'{"type": "FeatureCollection", "features": [', "not complete JSON"),
        (b"{" * 100_000, "not complete JSON"),
        (b'{"a":' * 200_000, "not complete JSON"),
        (b"[1, 2]", "type None"),
        ({"type": "Topology"}, "type 'Topology'"),
        ({"type": "FeatureCollection"}, "not a list"),
        ({"type": "FeatureCollection", "features": [3]}, "feature 0"),
        (collection(), "no building"),
        (collection(None), "no building"),
        (collection({"type": "Point", "coordinates": [0, 0]}), "no building"),
        (collection(polygon()), "no building"),
        (collection(polygon([SQUARE[0], SQUARE[1], SQUARE[0]])), "1 with a degenerate outline"),
        (collection(polygon([[0, 0], [1], [2, 2], [0, 0]])), "cannot be read"),
        (collection(polygon([["x", 0], [1, 0], [1, 1]])), "cannot be read"),
        (collection(polygon([[0, 0], [float("nan"), 1], [1, 1]])), "NaN"),
        (collection(polygon([[0, 0], [float("inf"), 1], [1, 1]])), "infinite"),
        (collection({"type": "Polygon"}), "cannot be read"),
        (collection({"type": "MultiPolygon", "coordinates": 7}), "cannot be read"),
        (collection(polygon([[0, 89], [0, 95], [1, 95]])), "out of range"),
        (collection(polygon([[841205, 5176065], [841300, 5176065], [841300, 5176165]])), "out of"),
        (collection(polygon(SQUARE), crs={"properties": {"name": "EPSG:123456"}}), "reference"),
        (collection(polygon(SQUARE), crs=17), "reference system"),
        (collection(polygon(SQUARE), window=[]), "'window'"),
        (collection(polygon(SQUARE), window={"center": [200, 3]}), "'window'"),
        (collection(polygon(SQUARE), window={"center": [0, 0], "projection": 3}), "projection"),
        (
            collection(polygon(SQUARE), window={"center": [0, 0], "projection": "EPSG:4326"}),
            "projection",
        ),
        ({"type": "CityJSON"}, "vertices"),
        ({"type": "CityJSON", "metadata": {"referenceSystem": 7}}, "reference system"),
        (
            {"type": "CityJSON", "metadata": {"referenceSystem": "EPSG:7415"}, "vertices": []},
            "CityObjects",
        ),
    ],
)
def test_broken_json(refused, content, found):
    refused("a.geojson", content, found)


def test_projected_coordinates_out_of_range(refused):
    far = [[1e30, 1e30], [2e30, 1e30], [2e30, 2e30]]
    crs = {"type": "name", "properties": {"name": "EPSG:2154"}}
    refused("a.geojson", collection(polygon(far), crs=crs), "out of range")


def test_an_empty_window_says_where_the_buildings_are(refused):
    message = refused("a.geojson", collection(polygon(SQUARE)), "no building in", center=(5, 45))
    assert "center=(0.0005, 0.0005)" in message


def test_a_window_in_which_nothing_is_is_open_ground(refused, tmp_path):
    window = {"center": [4.83, 45.76]}
    (tmp_path / "bare.geojson").write_text(json.dumps(collection(window=window)))
    city = read_map(tmp_path / "bare.geojson", pixels=32)
    assert city.shape == (32, 32)
    assert not city.heights.any()
    point = {"type": "Point", "coordinates": [4.83, 45.76]}
    refused("a.geojson", collection(point, window=window), "has no building")
    refused("a.geojson", collection(window=window), "has no building", center=(5, 45))


@pytest.mark.parametrize("share", [0.05, 0.4, 0.95])
@pytest.mark.parametrize("suffix", [*BREAKABLE, ".shp"])
def test_truncated_files(refused, whole_files, suffix, share, tmp_path):
    path = whole_files / f"a{suffix}"
    content = path.read_bytes()
    for sidecar in (".shx", ".dbf", ".prj"):
        if suffix == ".shp":
            shutil.copy(path.with_suffix(sidecar), tmp_path / f"a{sidecar}")
    refused(f"a{suffix}", content[: int(len(content) * share)], "a", height_scale=None)


@pytest.fixture(scope="module")
def whole_files(tmp_path_factory):
    """One small map in each format, and a check that the whole files are read."""
    import pyogrio
    import shapely

    folder = tmp_path_factory.mktemp("whole")
    boxes = np.array(
        [shapely.box(x * 20, y * 20, x * 20 + 9, y * 20 + 9) for x, y in np.ndindex(12, 12)]
    )
    boxes = shapely.transform(boxes, lambda points: np.add(points, (770000, 6270000)))
    for suffix in (".gpkg", ".shp"):
        pyogrio.raw.write(
            folder / f"a{suffix}",
            shapely.to_wkb(boxes),
            [],
            [],
            geometry_type="Polygon",
            crs="EPSG:2154",
        )
    degrees = [[[x / 1e4, y / 1e4] for x, y in np.array(SQUARE) * 1e3] for _ in range(20)]
    (folder / "a.geojson").write_text(json.dumps(collection(*(polygon(r) for r in degrees))))
    nodes = "".join(f'<node id="{i}" lat="{y}" lon="{x}"/>' for i, (x, y) in enumerate(SQUARE, 1))
    way = "".join(f'<nd ref="{i}"/>' for i in (1, 2, 3, 4, 1)) + '<tag k="building" v="yes"/>'
    (folder / "a.osm").write_text(f'<osm version="0.6">{nodes}<way id="1">{way}</way></osm>')
    for suffix in (".osm.pbf", ".osm.gz"):
        with osmium.SimpleWriter(folder / f"a{suffix}") as writer:
            for element in osmium.FileProcessor(folder / "a.osm"):
                writer.add(element)
    noise = np.random.default_rng(0).integers(0, 255, (64, 64), dtype=np.uint8)
    noise[:8] = 0
    Image.fromarray(noise).save(folder / "a.png")
    np.save(folder / "a.npy", noise)
    with rasterio.open(
        folder / "a.tif",
        "w",
        driver="GTiff",
        height=64,
        width=64,
        count=1,
        dtype="uint8",
        crs="EPSG:2154",
        transform=rasterio.Affine(2, 0, 770000, 0, -2, 6270000),
        compress="deflate",
    ) as tif:
        tif.write(noise, 1)
    for path in folder.iterdir():
        if path.suffix in READERS:
            unplaced = {".png": {"metres_per_pixel": 2, "height_scale": 1}}
            unplaced[".npy"] = {"metres_per_pixel": 2}
            assert read_map(path, **unplaced.get(path.suffix, {})).built.any(), path
    return folder


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_damaged_file_gives_a_map_or_one_error(whole_files, tmp_path_factory, data):
    suffix = data.draw(st.sampled_from(BREAKABLE))
    content = bytearray((whole_files / f"a{suffix}").read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, min(len(content), 3000) - 1))
        cut = data.draw(st.integers(0, 4))
        content[at : at + cut] = data.draw(st.binary(max_size=4) | st.sampled_from(NASTY))
    path = tmp_path_factory.mktemp("damaged") / f"a{suffix}"
    path.write_bytes(content)
    stated = {"metres_per_pixel": 2, "pixels": 32}
    with contextlib.suppress(MapError):  # anything else fails the test
        city = read_map(path, **stated | ({"height_scale": 1} if suffix == ".png" else {}))
        assert city.heights.min() >= 0


NASTY = [
    b"NaN",
    b"1e999",
    b"-",
    b"null",
    b"[[[[",
    b'"',
    b"\xff\xff\xff\xff",
    b"99999999999999999999",
]


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b'<osm version="0.6"></osm>', "no nodes"),
        (b'<osm version="0.6"><node id="1" lat="1" lon="2"/></osm>', "no building"),
        (b'<osm version="0.6"><node id="x" lat="1" lon="2"/></osm>', "cannot be read"),
        (b'<osm version="0.6"><node id="1" lat="nan" lon="2"/></osm>', "coordinate"),
        (
            b'<osm version="0.6"><node id="1"/><way id="1"><tag k="building" v="yes"/></way></osm>',
            "no nodes",
        ),
        (
            b'<osm version="0.6"><node id="1" lat="95" lon="2"/>'
            b'<way id="1"><nd ref="1"/><tag k="building" v="yes"/></way></osm>',
            "invalid location",
        ),
        (b'<osm><node id="1" lat="1" lon="2"/></osm>', "without version"),
        (b'<?xml version="1.0" encoding="UTF-648"?><osm></osm>', "cannot be read"),
    ],
)
def test_osm_without_buildings(refused, content, found):
    refused("a.osm", content, found)


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may read everything")
def test_a_file_one_may_not_read(refused, tmp_path):
    (tmp_path / "a.geojson").write_text("{}")
    (tmp_path / "a.geojson").chmod(0)
    refused("a.geojson", None, "Permission denied")


def test_a_file_that_cannot_be_opened(tmp_path, monkeypatch):
    (tmp_path / "a.geojson").write_text("{}")

    def denied(*_args, **_options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(map_reader, "open", denied, raising=False)
    with pytest.raises(MapError, match="Permission denied"):
        read_map(tmp_path / "a.geojson")


def test_a_shapefile_without_its_companions(refused, whole_files, tmp_path):
    for suffix in (".shp", ".shx", ".dbf"):
        shutil.copy(whole_files / f"a{suffix}", tmp_path)
    refused("a.shp", None, "has no reference system")
    (tmp_path / "a.shx").unlink()
    refused("a.shp", None, "cannot be read")


# ---------------------------------------------------------------- a stranger's file is harmless


def test_pickles_are_refused(refused, tmp_path):
    np.save(tmp_path / "a.npy", np.array([[{}]], dtype=object), allow_pickle=True)
    refused("a.npy", None, "cannot be read", metres_per_pixel=1)


@pytest.mark.parametrize(
    "array", [np.zeros(5), np.zeros((2, 2, 2)), np.zeros((2, 2), complex), np.array([["a"]])]
)
def test_arrays_that_are_no_maps(refused, tmp_path, array):
    np.save(tmp_path / "a.npy", array)
    refused("a.npy", None, "holds", metres_per_pixel=1)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1, 1e300])
def test_heights_that_are_none(refused, tmp_path, value):
    np.save(tmp_path / "a.npy", np.full((4, 4), value))
    refused("a.npy", None, "NaN|below ground", metres_per_pixel=1)


def test_tiny_files_of_huge_maps(refused, tmp_path):
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2000000, 2000000), }"
    header += b" " * (117 - len(header)) + b"\n"
    refused("a.npy", b"\x93NUMPY\x01\x00\x76\x00" + header, "cannot be read", metres_per_pixel=1)
    with rasterio.open(
        tmp_path / "b.tif",
        "w",
        driver="GTiff",
        height=32767,
        width=32767,
        count=1,
        dtype="uint8",
        compress="deflate",
        sparse_ok=True,
        crs="EPSG:2154",
        transform=rasterio.Affine(1, 0, 770000, 0, -1, 6270000),
    ):
        pass
    refused("b.tif", None, "32767 × 32767 pixels")
    Image.new("1", (12000, 12000)).save(tmp_path / "c.png")
    refused("c.png", None, "12000 × 12000 pixels", metres_per_pixel=1, height_scale=1)
    refused("d.geojson", collection(polygon(SQUARE)), "20000 × 20000 pixels", pixels=20000)
    with rasterio.open(
        tmp_path / "e.tif",
        "w",
        driver="GTiff",
        height=9,
        width=9,
        count=1,
        dtype="uint8",
        crs="EPSG:2154",
        transform=rasterio.Affine(9, 0, 770000, 0, -9, 6270000),
    ):
        pass
    refused("e.tif", None, "pixels", metres_per_pixel=1e-4)


def test_pictures_are_no_heights(refused, tmp_path):
    with rasterio.open(
        tmp_path / "a.tif",
        "w",
        driver="GTiff",
        height=9,
        width=9,
        count=3,
        dtype="uint8",
        crs="EPSG:2154",
        transform=rasterio.Affine(9, 0, 770000, 0, -9, 6270000),
    ):
        pass
    refused("a.tif", None, "3 bands")


# ---------------------------------------------------------------- what the caller asks


@pytest.mark.parametrize(
    "options",
    [
        {"pixels": 0},
        {"pixels": -4},
        {"pixels": 2.5},
        {"pixels": True},
        {"pixels": 40000},
        {"metres_per_pixel": 0},
        {"metres_per_pixel": float("nan")},
        {"metres_per_pixel": "2"},
        {"center": (45.7,)},
        {"center": (4.8, 95)},
        {"center": (float("nan"), 0)},
        {"center": "Lyon"},
        {"default_height": -1},
        {"default_height": None},
        {"height_scale": 2},
        {"layer": "buildings"},
    ],
)
def test_options_that_mean_nothing(options):
    with pytest.raises(MapError, match=next(iter(options))):
        read_map("lyon-1er", **options)


@pytest.mark.parametrize("wrong", ["lyon", "Lyon-1er", "new-york", "xyz"])
def test_a_misspelt_city(wrong):
    with pytest.raises(MapError) as fault:
        read_map(wrong)
    assert all(city in str(fault.value) for city in cities())
    if wrong != "xyz":
        assert "did you mean" in str(fault.value)
    with pytest.raises(MapError):
        bundled_cities.attribution_of(wrong)


@pytest.fixture
def plugins(monkeypatch):
    def install(*entries):
        monkeypatch.setattr("evocity.plugins.entry_points", lambda group: entries)
        map_reader._from_plugins.cache_clear()

    yield install
    map_reader._from_plugins.cache_clear()


def test_a_reader_from_another_package(tmp_path, plugins):
    class Entry:
        name, value = ".grid", "afar:read"

        def load(self):
            return lambda path, request: Grid(np.full((4, 4), float(path.read_text())))

    class Other(Entry):
        name = ".city.xyz"

        def load(self):
            def read(path, request):
                return Footprints(np.array([], dtype=object), [], None)

            return Reader(read, content="JSON", takes=frozenset())

    class Broken(Entry):
        name = ".dwg"

        def load(self):
            raise ImportError("its library is missing")

    class Clash(Entry):
        name = ".png"

    plugins(Broken(), Clash(), Entry(), Other())
    (tmp_path / "a.grid").write_text("7")
    assert (read_map(tmp_path / "a.grid", metres_per_pixel=3).heights == 7).all()
    (tmp_path / "a.city.xyz").write_text("{}")
    with pytest.raises(MapError, match="no building"):
        read_map(tmp_path / "a.city.xyz")
    assert {".grid", ".city.xyz"} <= set(map_reader.suffixes())
    broken, clash = map_reader.plugin_warnings()
    assert "plugin .dwg (afar:read) not loaded: ImportError: its library is missing" in broken
    assert "a second reader of .png" in clash
    (tmp_path / "a.dwg").write_text("7")
    with pytest.raises(MapError, match=r"no reader for \.dwg; .*its library is missing"):
        read_map(tmp_path / "a.dwg")


STRANGE_SCHEMAS = {
    "table": "UPDATE sqlite_master SET name = CAST(x'ff' AS TEXT), sql = 'CREATE TABLE a ('"
    " WHERE name = 'map'",
    "columns": "UPDATE sqlite_master SET sql = CAST(CAST(sql AS BLOB) || x'ff' AS TEXT)"
    " WHERE name = 'map'",
    "function": "INSERT INTO sqlite_master VALUES ('view', 'v', 'v', 0, CAST(CAST("
    "'CREATE VIEW v AS SELECT f' AS BLOB) || x'ff' || CAST('(1) FROM map' AS BLOB) AS TEXT))",
    "other": "INSERT INTO sqlite_master VALUES ('view', 'v', 'v', 0, CAST(CAST("
    "'CREATE VIEW v AS SELECT * FROM m' AS BLOB) || x'ff' AS TEXT))",
}


@pytest.mark.parametrize("change", STRANGE_SCHEMAS.values(), ids=STRANGE_SCHEMAS)
def test_a_geopackage_whose_schema_is_not_utf_8_is_refused(tmp_path, change):
    path = tmp_path / "map.gpkg"
    shape = [shapely.to_wkb(shapely.box(770000, 6270000, 770050, 6270050))]
    pyogrio.raw.write(
        path, shape, [np.array([9.0])], ["height"], geometry_type="Polygon", crs="EPSG:2154"
    )
    with contextlib.closing(sqlite3.connect(path)) as file:
        file.execute("PRAGMA writable_schema = ON")
        file.execute(change)
        file.commit()
    with pytest.raises(MapError, match=r"map\.gpkg"):
        read_map(path, pixels=32, metres_per_pixel=2.0)


def test_an_endless_attribution_is_refused(tmp_path):
    city = CityMap(np.ones((4, 4), np.float32), 2.0, name="a")
    with pytest.raises(MapError, match=f"at most {MOST_ATTRIBUTION} characters"):
        CityMap(city.heights, 2.0, attribution="a" * 5_000_000)
    write_map(city, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif", "r+") as file:
        file.update_tags(ATTRIBUTION="a" * 5_000_000)
    with pytest.raises(MapError, match="the attribution has 5000000 characters"):
        read_map(tmp_path / "a.tif")
