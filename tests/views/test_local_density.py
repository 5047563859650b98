"""Local density around places, kinds of streets by it, and wanted densities."""

import json
import math

import numpy as np
import pytest
import rasterio
from affine import Affine
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import naive_local_density
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.fitness import WantedDensity
from evocity.io import read_wanted_density, write_field
from evocity.pictures import Field
from evocity.views.streets import StreetKinds


@st.composite
def maps(draw):
    height, width = draw(st.integers(1, 12)), draw(st.integers(1, 12))
    rng = np.random.default_rng(draw(st.integers(0, 999)))
    heights = rng.choice([0.0, 1.5, 1.6, 4.5, 7.5, 30.0], (height, width)).astype(np.float32)
    site = rng.random((height, width)) < 0.7 if draw(st.booleans()) else None
    if site is not None and not site.any():
        site = None
    return CityMap(heights, draw(st.sampled_from([0.5, 1.0, 2.0])), site=site)


@settings(deadline=None, max_examples=60)
@given(maps(), st.sampled_from([1.0, 1.25, 2.0, 3.7, 5.0, 100.0]))
def test_the_density_around_each_pixel_is_that_of_its_disc(city, factor):
    pixel = city.metres_per_pixel
    local = city.local_density(factor * pixel)
    assert local is city.local_density(factor * pixel)
    for row in range(city.shape[0]):
        for column in range(city.shape[1]):
            gsi, fsi = local.gsi[row, column], local.fsi[row, column]
            if city.site is not None and not city.site[row, column]:
                assert math.isnan(gsi)
                assert math.isnan(fsi)
                continue
            place = row * pixel, column * pixel
            true = naive_local_density(city.heights, city.site, pixel, place, factor * pixel)
            assert (gsi, fsi) == pytest.approx(true, abs=1e-9)


@settings(deadline=None, max_examples=60)
@given(maps(), st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8)), max_size=5), st.data())
def test_the_density_around_any_place_is_that_of_its_disc(city, eighths, data):
    pixel, (height, width) = city.metres_per_pixel, city.shape
    radius = pixel * data.draw(st.sampled_from([1.0, 1.5, 2.5, 6.0]))
    x = np.array([one / 8 * width * pixel for one, _ in eighths])
    y = np.array([one / 8 * height * pixel for _, one in eighths])
    gsi, fsi = city.local_density_at(np.column_stack([x, y]), radius)
    for k in range(len(eighths)):
        place = height * pixel - y[k] - pixel / 2, x[k] - pixel / 2
        true = naive_local_density(city.heights, city.site, pixel, place, radius)
        assert (gsi[k], fsi[k]) == pytest.approx(true, abs=1e-9, nan_ok=True)


def test_a_disc_over_the_whole_map_has_the_densities_of_the_map():
    city = draw_town(1)
    local = city.local_density(1e4)
    np.testing.assert_allclose(local.gsi, evocity.fitness.gsi(city), rtol=0, atol=1e-12)
    np.testing.assert_allclose(local.fsi, evocity.fitness.fsi(city), rtol=0, atol=1e-12)
    assert city.floors.sum() / city.pixels == evocity.fitness.fsi(city)


def test_the_density_of_pixels_is_that_of_their_centres():
    city = draw_town(2).replace(draw_town(2).heights, origin=(7e5, 6e6), crs="EPSG:2154")
    local, pixel = city.local_density(21.0), city.metres_per_pixel
    rows, columns = np.indices(city.shape)
    left, top = city.north_west
    places = np.column_stack(
        [left + (columns.ravel() + 0.5) * pixel, top - (rows.ravel() + 0.5) * pixel]
    )
    gsi, fsi = city.local_density_at(places, 21.0)
    assert np.array_equal(gsi.reshape(city.shape), local.gsi)
    assert np.array_equal(fsi.reshape(city.shape), local.fsi)


@pytest.mark.parametrize("radius", [0.0, 1.9, math.nan, math.inf, "100", True])
def test_a_radius_is_a_pixel_or_more(radius):
    city = draw_town(1)
    for ask in (city.local_density, lambda one: city.local_density_at(np.zeros((1, 2)), one)):
        with pytest.raises(MapError, match="radius"):
            ask(radius)


@pytest.mark.parametrize(
    ("places", "says"),
    [
        ([[-1.0, 3.0]], "1 of 1 places lie outside"),
        ([[1.0, 1.0], [1.0, 129.0]], "1 of 2 places lie outside"),
        ([[math.nan, 1.0]], "NaN"),
        ([1.0, 2.0], "shape"),
    ],
)
def test_places_lie_on_the_map(places, says):
    with pytest.raises(MapError, match=says) as caught:
        draw_town(1).local_density_at(places, 20.0)
    assert caught.value.expected
    assert caught.value.remedy


# -- kinds of streets ------------------------------------------------------------------------------

TABLE = """
[[kind]]
name = "quiet"
fsi = { below = 1.2 }
[[kind]]
name = "busy"
fsi = { from = 1.2 }
[density]
radius = 30
"""


def test_kinds_of_streets_depend_on_density():
    city = evocity.read_map("lyon-1er", pixels=128)
    plain = city.street_graph
    table = StreetKinds.of(TABLE.replace("1.2", "4.6"))
    assert table.density_radius == 30
    graph = city.street_graph_of(kinds=table)
    assert np.array_equal(graph.nodes, plain.nodes)
    streets = np.flatnonzero(~np.isin(graph.kind, ["place", "water"]))
    middles = [graph.edges[k].interpolate(0.5, normalized=True) for k in streets]
    fsi = city.local_density_at([[one.x, one.y] for one in middles], 30.0)[1]
    assert graph.kind[streets].tolist() == ["busy" if one >= 4.6 else "quiet" for one in fsi]
    assert set(graph.kind[streets]) == {"quiet", "busy"}


def test_tables_without_density_are_as_before():
    city = draw_town(3)
    assert StreetKinds.of("[[kind]]\nname = 'all'\n").density_radius is None
    assert StreetKinds.of("[[kind]]\nname = 'all'\ngsi = { from = 0 }\n").density_radius == 100
    assert set(city.street_graph_of(kinds=StreetKinds.of(TABLE)).kind) <= {"quiet", "busy", "place"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (TABLE.replace("below = 1.2", "below = 1.0"), "fsi 1"),
        (TABLE.replace("below = 1.2", "below = 2.0"), "both include"),
        (TABLE.replace("radius = 30", "radius = 0"), "density"),
        (TABLE.replace("radius = 30", "reach = 30"), "density"),
        (TABLE.replace("fsi", "osr"), "osr"),
        (TABLE + "[densities]\n", "densities"),
    ],
)
def test_faults_of_tables_are_reported(text, says):
    with pytest.raises(MapError, match=says):
        StreetKinds.of(text)


def test_a_table_by_density_needs_densities():
    from evocity.views.streets import street_graph

    city = evocity.read_map("lyon-1er", pixels=64)
    with pytest.raises(MapError, match="no densities"):
        street_graph(
            city.open_ground,
            city.building_labels,
            2.0,
            city.north_west,
            least_width=4.0,
            kinds=StreetKinds.of(TABLE),
        )


# -- wanted densities ------------------------------------------------------------------------------


def naive_gap(city, wanted, density):
    """Pixel by pixel, place by place."""
    index, total, count = ("gsi", "fsi").index(density), 0.0, 0
    pixel, height = city.metres_per_pixel, city.shape[0]
    for (x, y), value in zip(wanted.places, getattr(wanted, density), strict=True):
        if math.isnan(value):
            continue
        place = height * pixel - y - pixel / 2, x - pixel / 2
        true = naive_local_density(city.heights, city.site, pixel, place, wanted.radius)
        total, count = total + (true[index] - value) ** 2, count + 1
    return math.sqrt(total / count)


def test_the_gap_is_that_of_brute_force():
    city = draw_town(4, side=32)
    rng = np.random.default_rng(1)
    gsi, fsi = rng.random(9), 3 * rng.random(9)
    gsi[::2] = np.nan
    wanted = WantedDensity(rng.random((9, 2)) * 64, gsi, fsi, 15.0)
    assert wanted.wishes == ["gsi", "fsi"]
    for density in wanted.wishes:
        assert wanted.gap(city, density) == pytest.approx(
            naive_gap(city, wanted, density), abs=1e-9
        )
    assert math.isnan(WantedDensity([[1, 1]], [0.5], [np.nan]).gap(city, "fsi"))


def test_a_field_is_written_and_read(tmp_path):
    wanted = WantedDensity([[1, 2], [3.5, 4]], [0.25, np.nan], [np.nan, 1 / 3], 30.0)
    wanted.save(tmp_path / "field.csv")
    loaded = WantedDensity.load(tmp_path / "field.csv", 30.0)
    for name in ("places", "gsi", "fsi"):
        assert np.array_equal(getattr(loaded, name), getattr(wanted, name), equal_nan=True)


@pytest.mark.parametrize("suffix", [".tif", ".npy"])
def test_the_local_density_of_a_map_is_its_own_field(tmp_path, suffix):
    city = evocity.read_map("lyon-1er", pixels=64)
    local = city.local_density(40.0)
    path = tmp_path / f"field{suffix}"
    field = Field(city, local.gsi.astype(np.float32), "GSI", "GSI")
    write_field(field, path)
    wanted = read_wanted_density(path, city, 40.0, "gsi")
    assert wanted.gap(city, "gsi") < 1e-6
    assert 100 < len(wanted) <= 625
    other = city.replace(city.heights[::-1])
    assert wanted.gap(other, "gsi") == pytest.approx(naive_gap(other, wanted, "gsi"), abs=1e-9)


def test_a_raster_of_another_reference_system_is_placed(tmp_path):
    city = evocity.read_map("lyon-1er", pixels=64)
    from pyproj import Transformer

    west, south = city.south_west
    x, y = Transformer.from_crs(city.crs, 4326, always_xy=True).transform(west + 64, south + 64)
    path = tmp_path / "degrees.tif"
    with rasterio.open(
        path, "w", driver="GTiff", width=1, height=1, count=1, dtype="float32", crs="EPSG:4326",
        transform=Affine(1e-4, 0, x - 5e-5, 0, -1e-4, y + 5e-5), nodata=-1,
    ) as target:  # fmt: skip
        target.write(np.array([[2.5]], np.float32), 1)
    wanted = read_wanted_density(path, city, 40.0)
    assert wanted.fsi.tolist() == [2.5]
    np.testing.assert_allclose(wanted.places, [[64, 64]], atol=0.01)


def geojson(path, features, **more):
    points = [
        {
            "type": "Feature",
            "geometry": {"type": "Point", "coordinates": pair},
            "properties": wishes,
        }
        for pair, wishes in features
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": points, **more}))
    return path


def test_points_of_geojson_are_places(tmp_path):
    city = evocity.read_map("lyon-1er", pixels=64)
    from pyproj import Transformer

    west, south = city.south_west
    lon, lat = Transformer.from_crs(city.crs, 4326, always_xy=True).transform(west + 9, south + 20)
    path = geojson(
        tmp_path / "points.geojson",
        [([lon, lat], {"fsi": 2}), ([lon, lat], {"name": "no wish"}), ([0, 0], {"gsi": 0.2})],
    )
    wanted = read_wanted_density(path, city, 40.0)
    np.testing.assert_allclose(wanted.places, [[9, 20]], atol=1e-6)
    assert wanted.wishes == ["fsi"]
    here = geojson(tmp_path / "here.geojson", [([9, 20], {"gsi": 0.5})], window=True)
    assert read_wanted_density(here, draw_town(1)).places.tolist() == [[9, 20]]


FAULTS = [
    ("x,y,gsi\n1e7,1e7,.5\n", "none of the 1 places"),
    ("x,y,gsi\n1,1,1.5\n", "wrong values of gsi"),
    ("x,y,fsi\n1,1,-1\n", "wrong values of fsi"),
    ("x,y,fsi\n1,1,many\n", "line 2"),
    ("x,y,height\n1,1,3\n", "columns"),
    ("x,y,fsi\n1,1,\n", "no wish"),
    ("", "columns"),
    ("\xff\n", "columns"),
]


@pytest.mark.parametrize(("text", "says"), FAULTS)
def test_faults_of_tables_of_places_are_reported(tmp_path, text, says):
    path = tmp_path / "places.csv"
    path.write_text(text)
    with pytest.raises(MapError, match=says) as caught:
        read_wanted_density(path, draw_town(1))
    assert caught.value.expected
    assert caught.value.remedy


@pytest.mark.parametrize("features", [5, None, {"a": 1}, "point"])
def test_a_document_without_a_list_of_points_is_refused(tmp_path, features):
    path = tmp_path / "points.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    with pytest.raises(MapError, match="no point with a wish"):
        read_wanted_density(path, draw_town(1))


def test_fields_without_a_common_place_are_refused(tmp_path):
    town, lyon = draw_town(1), evocity.read_map("lyon-1er", pixels=64)
    path = geojson(tmp_path / "points.geojson", [([4.8, 45.7], {"fsi": 2})])
    with pytest.raises(MapError, match="no position in a coordinate reference system"):
        read_wanted_density(path, town)
    with pytest.raises(MapError, match="none of the"):
        read_wanted_density(path, lyon)
    with pytest.raises(MapError, match="no point with a wish"):
        read_wanted_density(geojson(tmp_path / "none.geojson", []), lyon)
    for pair in (["a", 1], [1], None, [1, 1e999]):
        wrong = geojson(tmp_path / "wrong.geojson", [(pair, {"fsi": 2, "gsi": 0.5})])
        with pytest.raises(MapError, match="feature 1"):
            read_wanted_density(wrong, lyon)
    np.save(tmp_path / "narrow.npy", np.ones((64, 32)))
    with pytest.raises(MapError, match="no reference system"):
        read_wanted_density(tmp_path / "narrow.npy", lyon)
    wanted = WantedDensity([[100, 100]], [0.5], [np.nan])
    small = draw_town(1, side=32)
    assert not wanted.fits(small)
    with pytest.raises(MapError, match="outside the map"):
        wanted.gap(small, "gsi")
    with pytest.raises(MapError, match="density"):
        wanted.gap(town, "osr")
    with pytest.raises(MapError, match="values"):
        WantedDensity([[1, 1]], [0.5, 0.2], [1.0])
