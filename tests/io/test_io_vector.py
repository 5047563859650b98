"""Footprints -> maps: the pixel-centre rule, heights, holes, windows, projections."""

import json
import re

import numpy as np
import osmium
import pyogrio
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS

from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.heights import RULES, height_of, is_building, metres
from evocity.io.projection import (
    WGS84,
    is_metric,
    is_true_to_scale,
    local_metres,
    parse_crs,
    transform_polygons,
)
from evocity.io.rasterization import rasterize_footprints
from evocity.io.reader_types import Footprints, Request

LON, LAT = 4.8344, 45.7685
LOCAL = local_metres(LON, LAT)


def burn(polygons, tags=None, *, pixels=64, side=2.0, crs=LOCAL, center=(LON, LAT)):
    """A map of polygons given in metres about the center."""
    tags = tags if tags is not None else [{"height": 5.0}] * len(polygons)
    found = Footprints(np.array(polygons, dtype=object), tags, crs)
    request = Request(pixels=pixels, metres_per_pixel=side, center=center)
    return rasterize_footprints(found, request, "test")


def lonlat(polygon, crs=LOCAL):
    """GeoJSON coordinates of a polygon in metres."""
    transform = transform_polygons(np.array([polygon], dtype=object), crs, WGS84)[0]
    return shapely.geometry.mapping(transform)


def write_geojson(path, polygons, properties, **members):
    features = [
        {"type": "Feature", "properties": p, "geometry": lonlat(g)}
        for g, p in zip(polygons, properties, strict=True)
    ]
    path.write_text(
        json.dumps({"type": "FeatureCollection", "features": features, **members}),
        encoding="utf-8",
    )
    return path


# ---------------------------------------------------------------- laws of burning


@st.composite
def rectangles(draw):
    """Up to eight rectangles (west, south, east, north) within ±50 m, off the pixel centres."""
    corner = st.integers(-200, 200).map(lambda q: q / 4 + 0.1)
    boxes = []
    for _ in range(draw(st.integers(1, 8))):
        x, y = draw(corner), draw(corner)
        boxes.append((x, y, x + draw(st.integers(12, 120)) / 4, y + draw(st.integers(12, 120)) / 4))
    return boxes


@settings(max_examples=40, deadline=None)
@given(boxes=rectangles(), heights=st.lists(st.integers(2, 60), min_size=8, max_size=8))
def test_a_pixel_has_the_highest_footprint_over_its_centre(boxes, heights):
    city = burn([shapely.box(*b) for b in boxes], [{"height": h} for h in heights[: len(boxes)]])
    centres = (np.arange(64) + 0.5) * 2 - 64
    x, y = np.meshgrid(centres, -centres)
    expected = np.zeros((64, 64))
    for (west, south, east, north), height in zip(boxes, heights, strict=False):
        over = (x > west) & (x < east) & (y > south) & (y < north)
        expected[over] = np.maximum(expected[over], height)
    np.testing.assert_array_equal(city.heights, expected)


@settings(max_examples=25, deadline=None)
@given(boxes=rectangles(), right=st.integers(-5, 5), down=st.integers(-5, 5))
def test_shifted_footprints_give_the_shifted_map(boxes, right, down):
    polygons = [shapely.box(*b) for b in boxes]
    transform = [shapely.affinity.translate(p, 2.0 * right, -2.0 * down) for p in polygons]
    here = np.pad(burn(polygons, pixels=96).heights, 5)
    there = np.pad(burn(transform, pixels=96).heights, 5)
    rolled = np.roll(here, (down, right), axis=(0, 1))
    np.testing.assert_array_equal(there[10:-10, 10:-10], rolled[10:-10, 10:-10])


def test_holes_stay_open_and_parts_of_one_building_all_count():
    ring = shapely.box(-40, -40, 0, 0).difference(shapely.box(-30, -30, -10, -10))
    city = burn([shapely.MultiPolygon([ring, shapely.box(20, 20, 40, 40)])])
    assert city.built.sum() * 4 == 40 * 40 - 20 * 20 + 20 * 20
    assert city.heights[32 + 10, 32 - 10] == 0  # the middle of the hole
    assert city.heights[32 - 15, 32 + 15] == 5
    assert city.height_rules == {"height": 1}


def test_crossed_outlines_are_repaired():
    bow_tie = shapely.Polygon([(-40, -40), (40, 40), (40, -40), (-40, 40)])
    city = burn([bow_tie])
    assert not bow_tie.is_valid
    assert city.built.sum() * 4 == pytest.approx(2 * 0.5 * 80 * 40, rel=0.05)


def test_north_is_up_and_east_is_right():
    city = burn([shapely.box(30, 30, 60, 60)])
    rows, columns = np.nonzero(city.built)
    assert rows.max() < 32 < columns.min()
    assert city.origin == (-64, 64)
    assert CRS.from_user_input(city.crs) == LOCAL


def test_only_buildings_in_the_window_are_counted():
    inside, outside = shapely.box(0, 0, 10, 10), shapely.box(500, 0, 510, 10)
    city = burn([inside, outside, inside], [{"height": 9}, {"height": 9}, {}])
    assert city.height_rules == {"height": 1, "default": 1}


def test_where_some_polygons_are_called_buildings_the_others_are_none():
    house, park = shapely.box(0, 0, 20, 20), shapely.box(-60, -60, 60, 60)
    city = burn([house, park], [{"building": "yes"}, {"leisure": "park"}])
    assert city.built.sum() == 100


# ---------------------------------------------------------------- heights


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (12, 12),
        (np.float64(7.5), 7.5),
        ("12", 12),
        ("12 m", 12),
        ("12m", 12),
        ("12,5", 12.5),
        ("~ 9 metres", 9),
        ("40'", 40 * 0.3048),
        ("40 ft", 40 * 0.3048),
        ("5'6\"", 5.5 * 0.3048),
        ("1.2e1", 12),
    ],
)
def test_what_is_a_height(text, expected):
    assert metres(text) == pytest.approx(expected)


@pytest.mark.parametrize(
    "value", [None, "", "high", "3-5", 0, "0", -3, "-3", np.nan, "nan", "inf", True, [], {}]
)
def test_what_is_none(value):
    assert metres(value) is None


@given(st.one_of(st.text(), st.floats(), st.integers(), st.none(), st.binary()))
def test_any_value_is_a_height_or_none(value):
    number = metres(value)
    assert number is None or (np.isfinite(number) and number > 0)


def test_rules_are_tried_in_their_order():
    tags = {
        "building:levels": "4",
        "solid_height": 11,
        "measuredHeight": 10,
        "HAUTEUR": 9,
        "height": "8 m",
    }
    order = []
    while True:
        height, rule = height_of(tags, 6.0)
        order.append((height, rule))
        if rule == "default":
            break
        del tags[[*tags][-1]]
    assert order == [
        (8, "height"),
        (9, "HAUTEUR"),
        (10, "measuredHeight"),
        (11, "solid"),
        (12, "levels"),
        (6, "default"),
    ]
    assert tuple(rule for _, rule in order) == RULES[2:]


@pytest.mark.parametrize("unknown", [0, "0", -1, None, "unknown", np.nan, 5000])
def test_an_unknown_height_passes_on(unknown):
    assert height_of({"height": unknown, "NB_ETAGES": 2}, 6.0) == (6.0, "levels")
    assert height_of({"HAUTEUR": unknown}, 7.0) == (7.0, "default")


def test_roof_levels_are_not_added():
    assert height_of({"building:levels": 3, "roof:levels": 2}, 6.0) == (9.0, "levels")


def test_who_is_a_building():
    assert is_building({"building": "yes"})
    assert is_building({"building": None, "building:part": "yes"})
    assert not any(map(is_building, [{}, {"building": "no"}, {"building": np.nan}]))


# ---------------------------------------------------------------- projection


@pytest.mark.parametrize(
    ("code", "place", "true"),
    [
        (3857, (14.4, 50.1), False),
        (3857, (14.4, 0.0), False),  # 0.67 % out between east and north even there
        (2154, (3.85, 43.6), True),
        (25830, (-2.99, 43.3), True),
        (32734, (18.46, -33.93), True),
    ],
)
def test_which_projections_are_true_to_scale(code, place, true):
    assert is_true_to_scale(CRS.from_epsg(code), *place) is true


def test_feet_are_no_metres():
    assert is_metric(CRS.from_epsg(2154))
    assert not is_metric(CRS.from_epsg(2263))
    assert not is_metric(WGS84)


@pytest.mark.parametrize(
    "name",
    [
        "urn:ogc:def:crs:EPSG::3946",
        "EPSG:3946",
        "https://www.opengis.net/def/crs/EPSG/0/3946",
        "http://www.opengis.net/def/crs/EPSG/0/3946",
    ],
)
def test_names_of_one_reference_system(name):
    assert parse_crs(name, "here") == CRS.from_epsg(3946)


def test_a_compound_system_is_made_flat():
    assert parse_crs("https://www.opengis.net/def/crs/EPSG/0/7415", "").to_epsg() == 28992
    assert parse_crs("urn:ogc:def:crs:OGC:1.3:CRS84", "").is_geographic


@pytest.mark.parametrize(
    "name", ["EPSG:99999999", "nonsense", None, 3, "+proj=tmerc +nadgrids=/etc/passwd", "+init=x"]
)
def test_other_names_are_refused(name):
    with pytest.raises(MapError, match="reference system"):
        parse_crs(name, "here")


def test_metres_are_true_whatever_the_source_has():
    """A square of 100 m is 100 m, from every reference system, within .1 % a side."""
    square = np.array([shapely.box(-50, -50, 50, 50)], dtype=object)
    for code in (4326, 3857, 2154, 32631, 3946):
        crs = CRS.from_epsg(code)
        city = burn(transform_polygons(square, LOCAL, crs), crs=crs)
        assert city.built.sum() * 4 == pytest.approx(100 * 100, rel=0.005), code


# ---------------------------------------------------------------- files


def test_geojson_window_attribution_and_3d(tmp_path):
    square = shapely.box(190, 190, 210, 210)
    path = write_geojson(
        tmp_path / "town.geojson",
        [shapely.force_3d(square, 170.0), shapely.box(0, 0, 20, 20)],
        [{"height": "20 m"}, {}],
        attribution="© somebody",
        window={"center": [LON, LAT], "side_m": 100},
    )
    city = read_map(path)
    assert (city.name, city.attribution) == ("town", "© somebody")
    assert city.heights[128 - 100, 128 + 100] == 20
    assert city.heights[128 - 5, 128 + 5] == 6
    assert city.taken == (
        "a window of 512 × 512 m, with 2 of the file's 2 buildings, which extend over 210 × 210 m; "
        "the file names a window of 100 × 100 m; heights: 1 from height, 1 by default"
    )
    assert city.replace(city.heights).taken == city.taken
    asked = read_map(path, pixels=50).taken
    assert asked.startswith("a window of 100 × 100 m, with 1 of the file's 2 buildings")
    assert "names" not in asked
    elsewhere = read_map(path, pixels=20, metres_per_pixel=1.0, center=(LON, LAT), name="x")
    assert elsewhere.shape == (20, 20)
    assert elsewhere.name == "x"


def test_a_window_with_far_more_buildings_is_named(tmp_path):
    rng = np.random.default_rng(4)
    few = rng.uniform(-1000, 1000, (30, 2))
    many = np.array([700, -800]) + rng.uniform(-100, 100, (60, 2))
    boxes = [shapely.box(x, y, x + 8, y + 8) for x, y in np.concatenate([few, many])]
    path = write_geojson(tmp_path / "town.geojson", boxes, [{}] * len(boxes))
    taken = read_map(path).taken
    lon, lat, _, told = taken.partition("about the centre ")[2].split()
    there = read_map(path, center=(float(lon), float(lat))).taken
    assert "about" not in there
    inside = int(there.partition("with ")[2].split()[0])
    assert 60 <= int(told) <= inside <= int(told) + 10  # what only touches it is not counted
    alone = write_geojson(tmp_path / "a.geojson", boxes[30:], [{}] * 60)
    assert "about" not in read_map(alone).taken


@pytest.mark.parametrize("side", ["1024", -1, 0, None, True, 1e300])
def test_a_window_whose_side_is_no_length_names_none(tmp_path, side):
    window = {"center": [LON, LAT], "side_m": side}
    path = write_geojson(tmp_path / "a.geojson", [shapely.box(0, 0, 20, 20)], [{}], window=window)
    assert "names a window" not in read_map(path).taken


def test_without_a_window_the_middle_of_the_buildings_is_the_centre(tmp_path):
    town = [shapely.box(x, y, x + 10, y + 10) for x in range(0, 200, 20) for y in range(0, 100, 20)]
    path = write_geojson(tmp_path / "a.geojson", town, [{}] * len(town))
    rows, columns = np.nonzero(read_map(path, metres_per_pixel=1.0).built)
    assert abs(rows.min() + rows.max() - 255) <= 1
    assert abs(columns.min() + columns.max() - 255) <= 1
    # one stray far away does not move it
    astray = [*town, shapely.box(9000, 9000, 9010, 9010)]
    strayed = write_geojson(tmp_path / "b.geojson", astray, [{}] * len(astray))
    np.testing.assert_array_equal(
        read_map(path, metres_per_pixel=1.0).heights,
        read_map(strayed, metres_per_pixel=1.0).heights,
    )


@pytest.mark.parametrize("crs", [2154, 3857])
@pytest.mark.parametrize(("driver", "suffix"), [("GPKG", ".gpkg"), ("ESRI Shapefile", ".shp")])
def test_geopackage_and_shapefile(tmp_path, driver, suffix, crs):
    squares = np.array([shapely.box(0, 0, 40, 40), shapely.box(-40, -40, 0, 0)], dtype=object)
    path = tmp_path / f"map{suffix}"
    write_layer(path, transform_polygons(squares, LOCAL, CRS.from_epsg(crs)), crs, driver)
    city = read_map(path, center=(LON, LAT), pixels=64)
    assert city.height_rules == {"HAUTEUR": 1, "levels": 1}
    assert city.built.sum() * 4 == pytest.approx(3200, rel=0.03)
    assert sorted(set(city.heights.ravel().tolist())) == [0, 9, 12]


def write_layer(path, polygons, crs, driver="GPKG", layer=None, **options):
    pyogrio.raw.write(
        path,
        geometry=shapely.to_wkb(polygons),
        field_data=[np.array([12.0, 0.0]), np.array([np.nan, 3])],
        fields=["HAUTEUR", "NB_ETAGES"],
        geometry_type="Polygon",
        crs=f"EPSG:{crs}",
        driver=driver,
        layer=layer,
        **options,
    )


def test_which_layer(tmp_path):
    squares = np.array([shapely.box(0, 0, 40, 40), shapely.box(-40, -40, 0, 0)], dtype=object)
    squares = transform_polygons(squares, LOCAL, CRS.from_epsg(2154))
    path = tmp_path / "layers.gpkg"
    write_layer(path, squares, 2154, layer="parcels")
    assert read_map(path).built.any()  # the only one
    write_layer(path, squares, 2154, layer="more", append=True)
    with pytest.raises(MapError, match="parcels, more"):
        read_map(path)
    assert read_map(path, layer="more").built.any()
    write_layer(path, squares[:1].repeat(2), 2154, layer="Bâtiments", append=True)
    assert read_map(path).height_rules == {"HAUTEUR": 1, "levels": 1}
    with pytest.raises(MapError, match=r"'plots'.*\n.*Bâtiments"):
        read_map(path, layer="plots")


def osm(ways, relations=(), order="nwr"):
    """An OSM XML text: ways are (id, corners in degrees/1e4, tags), closed; negative ids."""
    tag = "".join
    nodes, lines = [], []
    for number, (way, corners, tags) in enumerate(ways):
        ids = [-(100 * number + i + 1) for i in range(len(corners))]
        nodes += [
            f'<node id="{i}" lon="{LON + x / 1e4:.7f}" lat="{LAT + y / 1e4:.7f}"/>'
            for i, (x, y) in zip(ids, corners, strict=True)
        ]
        refs = tag(f'<nd ref="{i}"/>' for i in [*ids, ids[0]])
        told = tag(f"<tag k='{k}' v=\"{v}\"/>" for k, v in tags.items())
        lines.append(f'<way id="{way}">{refs}{told}</way>')
    areas = [
        "<relation id='1'><tag k='type' v='multipolygon'/>"
        + tag(f"<tag k='{k}' v='{v}'/>" for k, v in tags.items())
        + tag(f"<member type='way' ref='{way}' role='{role}'/>" for way, role in members)
        + "</relation>"
        for members, tags in relations
    ]
    parts = {"n": tag(nodes), "w": tag(lines), "r": tag(areas)}
    return '<?xml version="1.0"?><osm version="0.6">' + tag(parts[p] for p in order) + "</osm>"


def square(x, y, side):
    return [(x, y), (x + side, y), (x + side, y + side), (x, y + side)]


def test_osm_xml(tmp_path):
    path = tmp_path / "a.osm"
    path.write_text(
        osm(
            [
                (-1, square(0, 0, 4), {"building:part": "yes", "height": "40'"}),
                (-2, square(-6, -6, 4), {"building": "no"}),
                (-3, square(-20, -20, 40), {"landuse": "residential"}),
            ]
        )
    )
    city = read_map(path)
    assert city.attribution == "© OpenStreetMap contributors"
    assert city.height_rules == {"height": 1}
    assert city.heights.max() == pytest.approx(40 * 0.3048)


@pytest.mark.parametrize("order", ["nwr", "rwn", "wnr", "nrw"])
@pytest.mark.parametrize("custom", ["tags on the relation", "tags on the outer way"])
def test_osm_courts_in_any_order(tmp_path, order, custom):
    building = {"building": "yes", "building:levels": "4"}
    old = custom == "tags on the outer way"
    path = tmp_path / "a.osm"
    path.write_text(
        osm(
            [(1, square(0, 0, 9), building if old else {}), (2, square(3, 3, 3), {})],
            [([(1, "outer"), (2, "inner"), (99, "outer")], {} if old else building)],
            order,
        )
    )
    city = read_map(path, center=(LON + 4.5e-4, LAT + 4.5e-4), pixels=128, metres_per_pixel=1.0)
    assert city.height_rules == {"levels": 1}
    assert city.heights[64, 64] == 0
    one = np.cos(np.radians(LAT)) * 11.1195**2  # m² of a square of 1e-4 degrees
    assert city.built.sum() == pytest.approx((81 - 9) * one, rel=0.02)


@pytest.mark.parametrize("suffix", [".osm.pbf", ".PBF", ".osm.gz", ".osm.bz2"])
def test_osm_packings_tell_the_same(tmp_path, suffix):
    court = osm(
        [
            (1, square(0, 0, 9), {}),
            (2, square(3, 3, 3), {}),
            (4, square(20, 20, 2), {"building:part": "yes", "height": "9"}),
        ],
        [([(1, "outer"), (2, "inner")], {"building": "yes", "name": "Cour à l’Été"})],
    )
    (tmp_path / "a.osm").write_text(court)
    with osmium.SimpleWriter(tmp_path / f"written{suffix.lower()}") as writer:
        for element in osmium.FileProcessor(tmp_path / "a.osm"):
            writer.add(element)
    packed = (tmp_path / f"written{suffix.lower()}").rename(tmp_path / f"b{suffix}")
    one, other = (
        read_map(path, center=(LON, LAT), pixels=256) for path in (tmp_path / "a.osm", packed)
    )
    assert one.height_rules == other.height_rules == {"height": 1, "default": 1}
    np.testing.assert_array_equal(one.heights, other.heights)


@pytest.mark.parametrize("corner", [-101, -102, -104])
def test_osm_ways_that_leave_the_extract(tmp_path, corner):
    """A way that lacks a node is left out; no other building is lost."""
    whole = osm(
        [
            (1, square(0, 0, 9), {"building": "yes", "height": "9"}),
            (2, square(-20, 0, 9), {"building": "yes", "height": "5"}),
            (3, square(-20, -20, 9), {"building": "yes"}),
            (4, square(0, -20, 9), {"building": "yes"}),
        ],
        [([(77, "outer"), (78, "inner")], {"building": "yes"})],
    )
    gone = [corner, *range(-204, -200), -301, -302]
    missing = "|".join(f'<node id="{node}" [^>]*/>' for node in gone)
    (tmp_path / "a.osm").write_text(re.sub(missing, "", whole))
    city = read_map(tmp_path / "a.osm", center=(LON, LAT), pixels=256)
    assert city.height_rules == {"height": 1}
    assert city.built.sum() * 4 == pytest.approx(81 * 11.1195**2 * np.cos(np.radians(LAT)), rel=0.1)


def test_osm_what_is_no_area(tmp_path):
    """Open ways, ways there and back, other relations, members that are no ways."""
    tags = {"building": "yes", "height": "9"}
    text = osm(
        [(1, square(0, 0, 4), tags), (2, square(9, 9, 4), tags), (3, [(-9, 0), (-5, 0)], tags)]
        + [(way, square(20 - 10 * way, -20, 4), {}) for way in (4, 5)],
        [([(4, "outer")], tags), ([(5, "outer")], tags)],
    )
    text = text.replace('<nd ref="-101"/></way>', "</way>").replace('<nd ref="-101"/><tag', "<tag")
    site, other = text.index("v='multipolygon'"), text.rindex("type='way'")
    text = text[:other] + "type='node'" + text[other + 10 :]
    text = text[:site] + "v='site'" + text[site + 16 :]
    (tmp_path / "a.osm").write_text(text)
    assert read_map(tmp_path / "a.osm", center=(LON, LAT)).height_rules == {"height": 1}


def cityjson(objects, vertices, **members):
    return {
        "type": "CityJSON",
        "version": "2.0",
        "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/2154"},
        "transform": {"scale": [0.01, 0.01, 0.01], "translate": [770000, 6270000, 100]},
        "CityObjects": objects,
        "vertices": vertices,
    } | members


CUBE = [(x, y, z) for z in (0, 900) for x, y in ((0, 0), (4000, 0), (4000, 4000), (0, 4000))]
FACES = [[[0, 3, 2, 1]], [[4, 5, 6, 7]], [[0, 1, 5, 4]], [[1, 2, 6, 5]], [[2, 3, 7, 6]]]


@pytest.mark.parametrize("semantics", [True, False])
def test_cityjson(tmp_path, semantics):
    solid = {"type": "Solid", "lod": "1", "boundaries": [[*FACES, [[3, 0, 4, 7]]]]}
    if semantics:
        surfaces = [{"type": "GroundSurface"}, {"type": "RoofSurface"}, {"type": "WallSurface"}]
        solid["semantics"] = {"surfaces": surfaces, "values": [[0, 1, 2, 2, 2, 2]]}
    objects = {
        "a": {"type": "Building", "attributes": {"measuredHeight": 12.0}, "children": ["b"]},
        "b": {"type": "BuildingPart", "parents": ["a"], "geometry": [solid]},
        "c": {"type": "Road", "geometry": [{"type": "MultiSurface", "boundaries": FACES}]},
    }
    path = tmp_path / "a.city.json"
    path.write_text(json.dumps(cityjson(objects, CUBE)))
    city = read_map(path)
    assert (city.name, city.height_rules) == ("a", {"solid": 1})
    assert city.built.sum() * 4 == pytest.approx(1600, rel=0.03)
    assert city.heights.max() == 9  # its own, before that of the building
    # any JSON says itself what it is
    del objects["a"]["attributes"]
    renamed = tmp_path / "a.geojson"
    renamed.write_text(json.dumps(cityjson(objects, CUBE)))
    assert read_map(renamed).height_rules == {"solid": 1}
    assert read_map(renamed).heights.max() == 9


@pytest.mark.parametrize("metadata", [{}, {"title": "a model"}])
def test_cityjson_without_a_reference_system_lies_nowhere(tmp_path, metadata):
    solid = {"type": "Solid", "lod": "1", "boundaries": [[*FACES, [[3, 0, 4, 7]]]]}
    document = cityjson({"a": {"type": "Building", "geometry": [solid]}}, CUBE, metadata=metadata)
    path = tmp_path / "a.city.json"
    path.write_text(json.dumps(document))
    city = read_map(path, pixels=40)  # 40 m square, 9 m high, about its middle
    assert (city.crs, city.origin, city.height_rules) == (None, None, {"solid": 1})
    assert (city.heights[10:30, 10:30] == 9).all()
    assert city.built.sum() == 400
    with pytest.raises(MapError, match="no coordinate reference system, so center="):
        read_map(path, center=(LON, LAT))
    del document["metadata"]
    path.write_text(json.dumps(document))
    assert np.array_equal(read_map(path, pixels=40).heights, city.heights)
