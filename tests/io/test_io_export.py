"""Exported files: other reference systems, styles for QGIS, FlatGeobuf, GeoParquet, GeoTIFF."""

import sqlite3
import xml.etree.ElementTree as ElementTree
from contextlib import closing
from itertools import pairwise

import geopandas
import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from pyproj import CRS, Transformer
from towns import draw_town

import evocity
from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.errors import MapError
from evocity.io import read_map, write_map
from evocity.io.export import styles
from evocity.io.export.reference_systems import LOCAL, file_system, geotiff_text, utm_code
from evocity.io.writers import TABLES
from evocity.pictures.colours import ramp

TANGENT = "+proj=tmerc +lat_0=45.77 +lon_0=4.83 +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m +no_defs"


def town(crs="EPSG:2154", origin=(842_300.0, 6_520_700.0), **more) -> CityMap:
    heights = draw_town(64, 64).heights
    return CityMap(heights, 2.0, name="town", attribution="© Ville", origin=origin, crs=crs, **more)


def table(path) -> geopandas.GeoDataFrame:
    if path.suffix == ".geoparquet":
        return geopandas.read_parquet(path)
    return geopandas.read_file(path, layer="buildings")


# -- reference systems ------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", TABLES)
@pytest.mark.parametrize("code", ["EPSG:32631", "EPSG:4326", "EPSG:3035"])
def test_footprints_lie_where_geopandas_puts_them(tmp_path, suffix, code):
    city = town()
    write_map(city, tmp_path / f"own{suffix}")
    write_map(city, tmp_path / f"other{suffix}", crs=code)
    own, other = (table(tmp_path / f"{name}{suffix}") for name in ("own", "other"))
    assert own.crs == CRS("EPSG:2154")
    assert other.crs == CRS(code)
    wanted = own.sort_values("id").to_crs(code).geometry.reset_index(drop=True)
    found = other.sort_values("id").geometry.reset_index(drop=True)
    grain = 1e-9 if code == "EPSG:4326" else 1e-4
    assert found.geom_equals_exact(wanted, grain).all()
    columns = ["id", "height", "area", "class"]
    own, other = (one.sort_values("id", ignore_index=True) for one in (own, other))
    assert own[columns].equals(other[columns])


@pytest.mark.parametrize("suffix", [".tif", *TABLES])
def test_a_file_in_another_system_is_read_as_a_map(tmp_path, suffix):
    write_map(town(), tmp_path / f"a{suffix}", crs="EPSG:32631")
    size = {} if suffix == ".tif" else {"pixels": 64}
    again = read_map(tmp_path / f"a{suffix}", **size)
    assert CRS(again.crs) == CRS("EPSG:32631")
    assert again.attribution == "© Ville"
    assert again.built.sum() == pytest.approx(town().built.sum(), rel=0.03)


@pytest.mark.parametrize("code", ["EPSG:32631", "EPSG:27572", "EPSG:3035"])
def test_a_raster_takes_the_nearest_pixel(tmp_path, code):
    path = tmp_path / "a.tif"
    rng = np.random.default_rng(3)
    heights = rng.uniform(0, 30, (20, 24)).astype(np.float32)
    city = CityMap(heights, 2.0, name="town", origin=(842_300.0, 6_520_700.0), crs="EPSG:2154")
    write_map(city, path, crs=code)
    with rasterio.open(path) as file:
        assert file.crs == CRS(code)
        assert np.isnan(file.nodata)
        assert file.res == (2.0, 2.0)
        values = file.read(1)
        rows, columns = np.indices(values.shape)
        left, top = file.transform.c, file.transform.f
    x, y = left + 2 * (columns + 0.5), top - 2 * (rows + 0.5)
    back = Transformer.from_crs(code, "EPSG:2154", always_xy=True)
    x, y = back.transform(x, y)
    column, row = (x - 842_300) / 2, (6_520_700 - y) / 2
    inside = (column > 0) & (column < 24) & (row > 0) & (row < 20)
    near = np.full(values.shape, np.nan, np.float32)
    near[inside] = heights[row[inside].astype(int), column[inside].astype(int)]
    # GDAL's transformation has an error of an eighth of a pixel
    edge = np.minimum(np.abs(column - np.round(column)), np.abs(row - np.round(row))) < 0.13
    np.testing.assert_array_equal(values[~edge], near[~edge])
    assert np.isfinite(values).sum() == pytest.approx(heights.size, rel=0.02)


def test_systems_without_a_code_are_one_text():
    text = file_system(TANGENT)
    assert file_system(text) == text
    crs = CRS(text)
    assert crs.name == "transverse Mercator at 4.83, 45.77"
    assert crs.geodetic_crs == CRS("EPSG:4326")
    assert geotiff_text(text) == geotiff_text(geotiff_text(text))
    x, y = Transformer.from_crs(CRS(TANGENT), crs, always_xy=True).transform(100.0, -250.0)
    assert (x, y) == pytest.approx((100.0, -250.0), abs=1e-6)
    assert file_system("EPSG:2154") == "EPSG:2154"


def test_a_geopackage_and_a_geotiff_have_equal_systems(tmp_path):
    city = town(TANGENT, (0.0, 0.0))
    write_map(city, tmp_path / "a.tif")
    write_map(city, tmp_path / "a.gpkg")
    with closing(sqlite3.connect(tmp_path / "a.gpkg")) as file:
        ((name, wkt),) = file.execute(
            "select srs_name, definition_12_063 from gpkg_spatial_ref_sys where srs_id >= 100000"
        )
    assert name == "transverse Mercator at 4.83, 45.77"
    with rasterio.open(tmp_path / "a.tif") as file:
        own = file.crs.to_wkt(version="WKT2_2019")
    # rasterio loses the name of the conversion
    assert wkt == own.replace('CONVERSION["unnamed"', 'CONVERSION["Transverse Mercator"')
    assert CRS(read_map(tmp_path / "a.tif").crs) == CRS(read_map(tmp_path / "a.gpkg").crs)


def test_files_without_a_place_have_equal_systems(tmp_path):
    write_map(town(None, None), tmp_path / "a.tif")
    write_map(town(None, None), tmp_path / "a.gpkg")
    with closing(sqlite3.connect(tmp_path / "a.gpkg")) as file:
        ((wkt,),) = file.execute(
            "select definition_12_063 from gpkg_spatial_ref_sys where srs_id >= 100000"
        )
        ((own,),) = file.execute("select srs_id from gpkg_geometry_columns")
    assert (wkt, own) == (LOCAL, 100000)  # QGIS compares texts, see test_to_other_programs
    with rasterio.open(tmp_path / "a.tif") as file:
        assert file.crs.wkt.startswith('LOCAL_CS["Metres from the south-west corner",')
    for name in ("a.tif", "a.gpkg"):
        back = read_map(tmp_path / name, metres_per_pixel=town().metres_per_pixel)
        assert (back.crs, back.origin) == (None, None)


@pytest.mark.parametrize(
    ("crs", "suffix", "says"),
    [
        ("EPSG:1", ".gpkg", "is unknown"),
        ("/etc/passwd", ".gpkg", "is unknown"),
        ("EPSG:4978", ".gpkg", "longitude and latitude, or a plane"),
        ("EPSG:4326", ".tif", "crs='EPSG:4326' has degrees"),
        ("EPSG:2263", ".tif", "US survey foot"),
        ("EPSG:2056", ".gpkg", "outside the area of EPSG:2056"),
        ("EPSG:32756", ".tif", "outside the area of EPSG:32756"),
        ("EPSG:2154", ".geojson", "EPSG:4326, because RFC 7946"),
        ("EPSG:2154", ".png", "has no coordinates for crs="),
        ("EPSG:2154", ".npy", "has no coordinates for crs="),
    ],
)
def test_systems_that_do_not_fit_are_refused(tmp_path, crs, suffix, says):
    with pytest.raises(MapError) as caught:
        write_map(town(), tmp_path / f"a{suffix}", crs=crs)
    assert says in str(caught.value).replace("\ufdd0", "")
    assert not list(tmp_path.iterdir())


def test_a_map_without_a_place_has_no_other_system(tmp_path):
    for suffix in (".gpkg", ".tif", ".fgb"):
        with pytest.raises(MapError, match="no place on Earth"):
            write_map(town(None, None), tmp_path / f"a{suffix}", crs="EPSG:2154")
    assert not list(tmp_path.iterdir())


def test_a_map_on_the_border_of_two_zones_fits_both(tmp_path):
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True).transform(6.0, 45.0)
    city = town("EPSG:32631", (x - 64, y + 64))
    for code in ("EPSG:32631", "EPSG:32632"):
        write_map(city, tmp_path / "a.gpkg", crs=code)


def test_utm_zones():
    assert utm_code(4.83, 45.77) == "EPSG:32631"
    assert utm_code(-179.9, -1.0) == "EPSG:32701"
    assert utm_code(180.0, 1.0) == "EPSG:32601"
    assert utm_code(0.0, 86.0) == "EPSG:4326"


# -- tables -----------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".fgb", ".geoparquet"])
@pytest.mark.parametrize("placed", [True, False])
def test_tables_have_the_contents_of_a_geopackage(tmp_path, suffix, placed):
    city = town() if placed else town(None, None)
    write_map(city, tmp_path / "a.gpkg")
    write_map(city, tmp_path / f"a{suffix}")
    own = table(tmp_path / "a.gpkg").sort_values("id").reset_index(drop=True)
    other = table(tmp_path / f"a{suffix}").sort_values("id").reset_index(drop=True)
    assert list(other.columns)[:5] == list(own.columns)
    assert own.drop(columns="geometry").equals(other[own.columns[:-1]].astype(own.dtypes[:-1]))
    assert shapely.equals_exact(other.geometry.to_numpy(), own.geometry.to_numpy(), 0).all()
    first, again = (read_map(tmp_path / f"a{end}", pixels=64) for end in (".gpkg", suffix))
    np.testing.assert_array_equal(first.heights, again.heights)
    assert first.origin == again.origin
    assert again.attribution == "© Ville"


def test_geoparquet_says_what_its_specification_wants(tmp_path):
    import json

    import pyarrow.parquet as pq

    write_map(town(), tmp_path / "a.geoparquet")
    found = pq.read_table(tmp_path / "a.geoparquet")
    about = json.loads(found.schema.metadata[b"geo"])
    assert (about["version"], about["primary_column"]) == ("1.1.0", "geometry")
    own = about["columns"]["geometry"]
    assert own["encoding"] == "WKB"
    assert own["geometry_types"] == ["Polygon"]
    assert own["crs"]["id"] == {"authority": "EPSG", "code": 2154}
    shapes = shapely.from_wkb(found["geometry"].to_pylist())
    assert own["bbox"] == pytest.approx(shapely.total_bounds(shapes))
    bounds = np.array([[row[edge] for edge in row] for row in found["bbox"].to_pylist()])
    np.testing.assert_array_equal(bounds, shapely.bounds(shapes))
    assert all(shape.exterior.is_ccw for shape in shapes)


@pytest.mark.parametrize("suffix", TABLES)
def test_an_empty_map_makes_an_empty_table(tmp_path, suffix):
    city = CityMap(np.zeros((8, 8)), 2.0, origin=(842_300.0, 6_520_700.0), crs="EPSG:2154")
    write_map(city, tmp_path / f"a{suffix}", crs="EPSG:32631")
    assert len(table(tmp_path / f"a{suffix}")) == 0


def test_classes_and_walls_of_a_caller_are_written(tmp_path):
    city = town()
    walls = city.walled(squared=True)
    for suffix in TABLES:
        more = {"mark": np.arange(len(walls))}
        write_map(city, tmp_path / f"a{suffix}", walls=walls, columns=more)
        found = table(tmp_path / f"a{suffix}").sort_values("mark")
        assert found["mark"].tolist() == list(range(len(walls)))
        polygons = np.array(walls.polygons, dtype=object)
        assert shapely.equals_exact(found.geometry.to_numpy(), polygons, 1e-9, normalize=True).all()
        names = np.array(city.classes.names)[city.classes.of_buildings[walls.buildings - 1]]
        assert found["class"].tolist() == names.tolist()


# -- styles -----------------------------------------------------------------------------------


def stored_styles(path) -> dict[tuple[str, str], tuple[str, int]]:
    with closing(sqlite3.connect(path)) as file:
        rows = file.execute(
            "select f_table_name, styleName, styleQML, useAsDefault from layer_styles"
        ).fetchall()
        assert file.execute("pragma user_version").fetchone() == (10200,)
        assert file.execute("pragma integrity_check").fetchone() == ("ok",)
        kinds = file.execute("select table_name, data_type from gpkg_contents").fetchall()
    assert ("layer_styles", "attributes") in kinds
    return {(layer, name): (qml, default) for layer, name, qml, default in rows}


def test_each_layer_has_one_style_by_default(tmp_path):
    write_map(town(), tmp_path / "a.gpkg", streets=True)
    found = stored_styles(tmp_path / "a.gpkg")
    layers = [name for name, kind in pyogrio.list_layers(tmp_path / "a.gpkg") if kind]
    assert sorted(layer for (layer, _), (_, default) in found.items() if default) == sorted(layers)
    assert ("buildings", "classes") in found
    for qml, _ in found.values():
        root = ElementTree.fromstring(qml.split("\n", 1)[1])
        assert root.tag == "qgis"
        symbols = {one.get("name") for one in root.iter("symbol")}
        used = {one.get("symbol") for kind in ("range", "category") for one in root.iter(kind)}
        assert used <= symbols


def test_lines_of_streets_are_narrower_than_streets():
    root = ElementTree.fromstring(styles.street_style().split(styles.MARK)[1])
    props = [one.attrib for one in root.iter("prop")]
    widths = [float(one["v"]) for one in props if one["k"] == "line_width"]
    assert widths == sorted(widths)
    assert max(widths) <= 4
    assert "data_defined" not in styles.street_style()


def test_heights_have_the_colours_of_pictures():
    root = ElementTree.fromstring(styles.height_style(40.0).split("\n", 1)[1])
    ranges = [(float(one.get("lower")), float(one.get("upper"))) for one in root.iter("range")]
    assert ranges[0][0] == 0
    assert all(a[1] == b[0] for a, b in pairwise(ranges))
    colours = [one.get("v") for one in root.iter("prop") if one.get("k") == "color"]
    for (low, high), colour in zip(ranges[:-1], colours, strict=False):
        middle = max((low + high) / 2, BUILT_ABOVE)
        wanted = ramp(np.array([[middle]]), 40.0)[0, 0].tolist()
        assert [int(part) for part in colour.split(",")[:3]] == wanted


def test_a_raster_style_goes_from_ground_to_the_highest():
    for highest in (2.0, 10.0, 150.0):
        root = ElementTree.fromstring(styles.raster_style(highest).split("\n", 1)[1])
        values = [float(one.get("value")) for one in root.iter("item")]
        assert values == sorted(values)
        assert values[0] == 0
        assert values[-1] == max(highest, 2 * BUILT_ABOVE)


def test_a_style_lies_beside_a_raster_and_replaces_only_ours(tmp_path):
    write_map(town(), tmp_path / "a.tif")
    first = (tmp_path / "a.qml").read_text(encoding="utf-8")
    assert styles.MARK in first
    write_map(CityMap(np.full((64, 64), 90.0), 2.0), tmp_path / "a.tif")
    assert (tmp_path / "a.qml").read_text(encoding="utf-8") != first
    (tmp_path / "a.qml").write_text("my own", encoding="utf-8")
    write_map(town(), tmp_path / "a.tif")
    assert (tmp_path / "a.qml").read_text(encoding="utf-8") == "my own"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.qml", "a.tif"]


def test_a_style_that_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "a.qml").mkdir()
    with pytest.raises(MapError, match=r"a\.qml"):
        write_map(town(), tmp_path / "a.tif")
    assert evocity.read_map(tmp_path / "a.tif").shape == (64, 64)
