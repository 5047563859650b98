"""Footprints of GeoPackage, Shapefile and GeoJSON: the account, heights, columns and the CRS."""

import json
import shutil
import sqlite3
import struct
import warnings
from pathlib import Path

import geopandas
import numpy as np
import pyogrio
import pytest
import shapely
from pyproj import CRS

import evocity
from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.heights import HeightRules, metres, storeys
from evocity.io.projection import WGS84, transform_polygons, vertical_unit
from evocity.io.wkb_areas import Areas

TROUBLES = Path(__file__).parents[3] / "shared" / "data" / "troubles"
with_shared = pytest.mark.skipif(not TROUBLES.is_dir(), reason=f"there is no {TROUBLES}")

X, Y = 842_000.0, 6_519_000.0  # EPSG:2154, Lyon


def house(east=0.0, north=0.0, side=20.0):
    return shapely.box(X + east, Y + north, X + east + side, Y + north + side)


def write(path, shapes, kind="Unknown", crs="EPSG:2154", layer=None, encoding=None, **columns):
    driver = {".gpkg": "GPKG", ".shp": "ESRI Shapefile"}[path.suffix]
    content = [one if isinstance(one, bytes) else shapely.to_wkb(one) for one in shapes]
    pyogrio.raw.write(
        path,
        geometry=np.array([None if one is None else one for one in content], dtype=object),
        field_data=[np.array(values) for values in columns.values()],
        fields=list(columns),
        geometry_type=kind,
        crs=crs,
        driver=driver,
        layer=layer,
        encoding=encoding,
    )
    return path


def write_json(path, shapes, properties, crs=2154, **members):
    degrees = transform_polygons(np.array(shapes, dtype=object), CRS.from_epsg(crs), WGS84)
    geometries = [shapely.geometry.mapping(one) for one in degrees]
    return write_raw(path, geometries, properties, **members)


def write_raw(path, geometries, properties, **members):
    features = [
        {"type": "Feature", "geometry": geometry, "properties": own}
        for geometry, own in zip(geometries, properties, strict=True)
    ]
    document = {"type": "FeatureCollection", "features": features, **members}
    path.write_text(json.dumps(document), encoding="utf-8")
    return path


def areas_of(city):
    """m² by height, to the centimetre."""
    heights, counts = np.unique(city.heights[city.heights > 0].round(2), return_counts=True)
    size = city.metres_per_pixel**2
    pairs = zip(heights.tolist(), counts.tolist(), strict=True)
    return {round(high, 2): count * size for high, count in pairs}


# ---------------------------------------------------------------- the files of others' troubles


@with_shared
@pytest.mark.parametrize("name", ["gc.gpkg", "epsg2154.shp", "bdtopo3.geojson"])
def test_areas_are_those_of_geopandas(name):
    city, table = read_map(TROUBLES / name), geopandas.read_file(TROUBLES / name)
    assert city.built.sum() * 4 == pytest.approx(table.to_crs(2154).area.sum(), rel=0.005)


# ---------------------------------------------------------------- the account


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_every_feature_is_counted(tmp_path, suffix):
    point, line = shapely.Point(X, Y), shapely.LineString([(X, Y), (X + 9, Y)])
    thin = shapely.Polygon([(X, Y), (X + 9, Y + 9), (X + 18, Y + 18)])
    shapes = [house(), house(40), point, line, thin, shapely.Polygon()]
    path = tmp_path / f"a{suffix}"
    if suffix == ".gpkg":
        write(path, [*shapes, None], height=[9.0] * 7)
    else:
        geometries = [shapely.geometry.mapping(one) for one in shapes]
        crs = {"properties": {"name": "EPSG:2154"}}
        write_raw(path, [*geometries, None], [{"height": 9}] * 7, crs=crs)
    taken = read_map(path).taken
    assert "2 of the file's 2 buildings" in taken
    assert "buildings: 2 of the file's 7 features; left out: " in taken
    for reason in ("3 without a polygon", "1 with an empty geometry", "1 with a degenerate"):
        assert reason in taken


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson"])
def test_a_layer_of_points_is_refused_with_its_features(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    if suffix == ".gpkg":
        write(path, [shapely.Point(X, Y)] * 2, "Unknown", height=[9.0] * 2)
    else:
        write_raw(path, [{"type": "Point", "coordinates": [4.8, 45.7]}] * 2, [{}] * 2)
    with pytest.raises(MapError, match="no building; its 2 features: 2 without a polygon"):
        read_map(path)


@pytest.mark.parametrize("underground", [True, 1, "yes"])
def test_underground_buildings_are_left_out(tmp_path, underground):
    rows = [{"height": 9}, {"height": 9, "is_underground": underground}]
    city = read_map(write_json(tmp_path / "a.geojson", [house(), house(40)], rows))
    assert areas_of(city) == {9: 400}
    assert "1 underground" in city.taken


@pytest.mark.parametrize(
    ("row", "title", "is_kept"),
    [
        ({"height": 12}, "areas", True),
        ({"building:levels": 4}, "areas", True),
        ({}, "Bâtiments", True),
        ({}, "areas", False),
        ({"leisure": "park"}, "buildings", False),
        ({"building": "no", "height": 12}, "buildings", False),
    ],
)
def test_rows_without_a_value_of_building(tmp_path, row, title, is_kept):
    rows = [{"building": "yes", "height": 9}, row]
    path = write_json(tmp_path / "a.geojson", [house(), house(40)], rows, name=title)
    city = read_map(path)
    assert city.built.sum() * 4 == (800 if is_kept else 400)
    assert ("without a value of 'building'" in city.taken) is is_kept
    assert ("not tagged as a building" in city.taken) is not is_kept


# ---------------------------------------------------------------- geometry


def test_collections_in_a_collection_count_once(tmp_path):
    inner = shapely.GeometryCollection([house(40), shapely.Point(X, Y)])
    shapes = [shapely.GeometryCollection([house(), inner]), house(0, 40)]
    for path in (
        write(tmp_path / "a.gpkg", shapes, height=[9.0, 12.0]),
        write_json(tmp_path / "a.geojson", shapes, [{"height": 9}, {"height": 12}]),
    ):
        city = read_map(path)
        assert areas_of(city) == {9: 800, 12: 400}
        assert city.height_rules == {"height": 2}


def cube(high, code=1015, face=1003):
    """WKB of a cube of 20 m, as PolyhedralSurface Z."""
    (x, y), s = (X, Y), 20.0
    base = [(x, y), (x + s, y), (x + s, y + s), (x, y + s)]
    faces = [[(*p, 5.0) for p in base], [(*p, 5.0 + high) for p in base]]
    for a, b in zip(base, base[1:] + base[:1], strict=True):
        faces.append([(*a, 5.0), (*b, 5.0), (*b, 5.0 + high), (*a, 5.0 + high)])
    if code == 1016:  # triangles
        faces = [half for f in faces for half in ([f[0], f[1], f[2]], [f[0], f[2], f[3]])]
    text = struct.pack("<BII", 1, code, len(faces))
    for points in faces:
        points = [*points, points[0]]
        text += struct.pack("<BIII", 1, face, 1, len(points))
        text += b"".join(struct.pack("<3d", *point) for point in points)
    return text


@pytest.mark.parametrize(("code", "face"), [(1015, 1003), (1016, 1017)])
@pytest.mark.parametrize("high", [8.0, 30.0])
def test_solids_are_their_outline_with_the_height_of_their_points(tmp_path, code, face, high):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GDAL warns of the kind of geometry
        path = write(tmp_path / "a.gpkg", [cube(high, code, face), house(40)], other=[1, 2])
    city = read_map(path)
    assert areas_of(city) == {6: 400, high: 400}
    assert city.height_rules == {"solid": 1, "default": 1}


def test_a_degenerate_ring_in_wkb_costs_only_itself():
    ring = struct.pack("<I", 5) + b"".join(
        struct.pack("<2d", *p) for p in [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0)]
    )
    short = struct.pack("<I", 2) + struct.pack("<4d", 1, 1, 1, 1)
    areas = Areas(struct.pack("<BII", 1, 3, 2) + ring + short)
    assert (areas.area.area, areas.degenerate) == (81, 1)
    parts = struct.pack("<BII", 1, 6, 2) + struct.pack("<BII", 1, 3, 1) + ring
    areas = Areas(parts + struct.pack("<BII", 1, 3, 1) + short)
    assert (areas.area.area, areas.degenerate) == (81, 1)
    for cut in range(len(parts)):
        with pytest.raises(ValueError, match=r"cut off|type|number"):
            Areas(parts[:cut])


@pytest.mark.parametrize("points", [[[0, 0]] * 4, [[0, 0], [1, 1], [0, 0]], []])
def test_a_degenerate_part_costs_only_itself(tmp_path, points):
    square = [[4.83, 45.76], [4.831, 45.76], [4.831, 45.761], [4.83, 45.761], [4.83, 45.76]]
    geometry = {"type": "MultiPolygon", "coordinates": [[square], [points]]}
    city = read_map(write_raw(tmp_path / "a.geojson", [geometry], [{}]))
    assert city.built.sum() * 4 == pytest.approx(111.2 * 77.8, rel=0.02)
    assert "1 degenerate rings left out" in city.taken


@pytest.mark.parametrize("told", ["UTF-8", "CP936", "nonsense"])
def test_a_wrong_cpg_costs_no_layer(tmp_path, told):
    path = tmp_path / "a.shp"
    columns = {"height": [9.0, 12.0], "name": ["Hôtel", "Café"]}
    write(path, [house(), house(40)], "Polygon", encoding="ISO-8859-1", **columns)
    path.with_suffix(".cpg").write_text(told)
    assert areas_of(read_map(path)) == {9: 400, 12: 400}


# ---------------------------------------------------------------- heights


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("11' 4\"", 3.4544),
        ("11' 4 ''", 3.4544),
        ("36 ft", 10.9728),
        ("36 feet 6 in", 11.1252),
        ("3;4", 4),
        ("12,5;9", 12.5),
        ("12 mètres", 12),
        ("3;cellar", 3),
    ],
)
def test_texts_of_heights(text, expected):
    assert metres(text) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("3,4", 4), ("3;4", 4), ("3.5", 3.5), (4, 4), ("2, 3;1", 3), ("12 m", None), ("0", None)],
)
def test_texts_of_storeys(text, expected):
    assert storeys(text) == expected


@pytest.mark.parametrize(
    "column", ["num_floors", "storeysAboveGround", "nombre_d_etages", "NB_ETAGES"]
)
def test_columns_of_storeys(column):
    rules = HeightRules(6.0)
    assert rules.apply({column: 5, "min_height": 3}) == 15
    assert rules.note == (
        "1 from levels, 1 of them with a foot above the ground, which is not subtracted"
    )


@pytest.mark.parametrize("suffix", [".gpkg", ".shp", ".geojson"])
def test_any_column_gives_heights(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    columns = {"TOIT": [31.0, np.nan, np.nan], "floors": [1, 4, 0], "height": [5.0, 5.0, 5.0]}
    shapes = [house(), house(40), house(0, 40)]
    if suffix == ".geojson":
        rows = [
            {"TOIT": 31.0, "floors": 1, "height": 5},
            {"TOIT": None, "floors": 4, "height": 5},
            {"floors": 0, "height": 5},
        ]
        write_json(path, shapes, rows)
    else:
        write(path, shapes, "Polygon", **columns)
    city = read_map(path, height_column="TOIT", levels_column="floors")
    assert areas_of(city) == {5: 400, 12: 400, 31: 400}
    assert city.height_rules == {"height_column": 1, "levels_column": 1, "height": 1}
    assert "heights: 1 from TOIT, 1 from floors, 1 from height" in city.taken
    with pytest.raises(MapError, match="height_column = 'TOITS'") as fault:
        read_map(path, height_column="TOITS")
    assert "TOIT" in fault.value.expected
    with pytest.raises(MapError, match="name of a column"):
        read_map(path, levels_column=" ")


def test_a_raster_has_no_columns(tmp_path):
    evocity.write_map(evocity.CityMap(np.ones((8, 8)), 2.0), tmp_path / "a.tif")
    with pytest.raises(MapError, match="height_column= does not apply"):
        read_map(tmp_path / "a.tif", metres_per_pixel=2.0, height_column="a")


def test_two_columns_of_one_name_are_refused(tmp_path):
    rows = [{"height": 9, "Height": 30}, {}]
    path = write_json(tmp_path / "a.geojson", [house(), house(40)], rows)
    with pytest.raises(MapError, match=r"two columns of heights: '\w+', '\w+'"):
        read_map(path)
    assert areas_of(read_map(path, height_column="Height")) == {30: 400, 6: 400}


@pytest.mark.parametrize(
    ("code", "unit"),
    [("EPSG:2263", 0.3048006), ("EPSG:2154", 1), ("EPSG:4326", 1), ("EPSG:2263+6360", 0.3048006)],
)
def test_units_of_height(code, unit):
    assert vertical_unit(CRS.from_user_input(code)) == pytest.approx(unit)


def test_heights_of_a_layer_in_feet(tmp_path):
    box = shapely.box(983_000, 206_000, 983_100, 206_100)
    path = write(tmp_path / "a.gpkg", [box], crs="EPSG:2263", height=[100.0])
    assert areas_of(read_map(path)).keys() == {30.48}
    path = write(tmp_path / "b.gpkg", [box], crs="EPSG:2263", height=["30 m"])
    assert areas_of(read_map(path)).keys() == {30}


# ---------------------------------------------------------------- the file's own CRS

PLACES = [
    (2154, 4.83, 45.76),
    (25832, 9.0, 48.0),
    (28992, 4.9, 52.37),
    (27700, -0.1, 51.5),
    (2056, 8.54, 47.37),
    (32631, 5.9, 45.0),
]


@pytest.mark.parametrize(("code", "lon", "lat"), PLACES)
def test_a_true_reference_system_stays(tmp_path, code, lon, lat):
    crs = CRS.from_epsg(code)
    x, y = transform_polygons(np.array([shapely.Point(lon, lat)]), WGS84, crs)[0].coords[0]
    box = shapely.box(x, y, x + 40, y + 40)
    city = read_map(write(tmp_path / "a.gpkg", [box], crs=f"EPSG:{code}", height=[9.0]))
    assert city.crs == f"EPSG:{code}"
    assert city.built.sum() * 4 == 1600
    assert "transverse" not in city.taken
    for suffix in (".gpkg", ".tif"):
        evocity.write_map(city, tmp_path / f"b{suffix}")
        assert read_map(tmp_path / f"b{suffix}").crs == city.crs
    evocity.scene(city).write(tmp_path / "b.city.json")
    document = json.loads((tmp_path / "b.city.json").read_text(encoding="utf-8"))
    assert document["metadata"]["referenceSystem"].endswith(f"EPSG/0/{code}")


@pytest.mark.parametrize("code", [3857, 2263, 5513])
def test_other_reference_systems_are_replaced_and_named(tmp_path, code):
    crs = CRS.from_epsg(code)
    lon, lat = {3857: (4.8, 45.7), 2263: (-74.0, 40.7), 5513: (14.4, 50.1)}[code]
    x, y = transform_polygons(np.array([shapely.Point(lon, lat)]), WGS84, crs)[0].coords[0]
    box = shapely.box(x, y, x + 90, y + 90)
    city = read_map(write(tmp_path / "a.gpkg", [box], crs=f"EPSG:{code}", height=["9 m"]))
    assert "transverse Mercator" in city.crs
    assert "transverse Mercator projection about its centre, and not" in city.taken


def test_the_reference_system_stays_in_a_genome(tmp_path):
    path = write(tmp_path / "a.gpkg", [house(0, 0, 60)], height=[9.0])
    city = read_map(path, pixels=64)
    genome = evocity.encode(city, block=8).genome
    genome.write(tmp_path / "a.parquet")
    assert evocity.read_genome(tmp_path / "a.parquet").crs == "EPSG:2154"
    assert evocity.decode(genome).city.crs == "EPSG:2154"


@pytest.mark.parametrize("name", ["lyon-1er", "cape-town-salt-river"])
def test_cityjson_has_a_reference_system(tmp_path, name):
    city = read_map(name, pixels=64)
    evocity.scene(city).write(tmp_path / "a.city.json")
    document = json.loads((tmp_path / "a.city.json").read_text(encoding="utf-8"))
    code = {"lyon-1er": 32631, "cape-town-salt-river": 32734}[name]
    assert document["metadata"]["referenceSystem"].endswith(f"EPSG/0/{code}")
    x, y, _ = document["transform"]["translate"]
    zone, own = CRS.from_epsg(code), CRS.from_user_input(city.crs)
    corner = np.array([shapely.Point(x, y)])
    there = transform_polygons(corner, zone, own)[0]
    assert abs(there.x - city.origin[0]) < 200
    assert abs(there.y - city.origin[1]) < 200
    again = read_map(tmp_path / "a.city.json", pixels=64)
    assert again.origin == pytest.approx(city.origin, abs=1e-3)
    assert (again.built == city.built).mean() > 0.9


def test_texts_that_are_not_utf8_in_a_geopackage(tmp_path):
    path = write(tmp_path / "a.gpkg", [house()], height=[9.0], name=["abc"])
    copy = tmp_path / "b.gpkg"
    shutil.copyfile(path, copy)
    database = sqlite3.connect(copy)
    with database:
        for (trigger,) in database.execute(
            "select name from sqlite_master where type='trigger'"
        ).fetchall():
            database.execute(f'drop trigger "{trigger}"')
        database.execute("update a set name = cast(x'ff41' as text)")
    database.close()
    assert areas_of(read_map(copy, layer="a")) == {9: 400}
