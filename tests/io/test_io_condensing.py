"""Files that tell what of a map is kept: where exactly, at what height, and what is refused."""

import json

import numpy as np
import pytest
import rasterio
from PIL import Image
from pyproj import Transformer

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io import read_condensation, read_map, write_map

CORNER = (500_000.0, 4_794_000.0)
ON_EARTH = {"origin": CORNER, "crs": "EPSG:25830"}


def draw_city(shape=(40, 60), **place) -> CityMap:
    rows, columns = np.indices(shape)
    heights = (rows // 5 + columns // 7) % 4 * 7.25 + 1
    return CityMap(heights, 2.0, name="here", attribution="the town", **place)


@pytest.fixture
def city() -> CityMap:
    return draw_city(**ON_EARTH)


def ring(left, top, right, bottom):
    """Corners of pixels (columns, rows) of the city, in longitude and latitude."""
    to_degrees = Transformer.from_crs(25830, 4326, always_xy=True)
    corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
    return [to_degrees.transform(CORNER[0] + 2 * x, CORNER[1] - 2 * y) for x, y in corners]


def write_geojson(path, *rings, **members):
    """Footprints; each ring may come with properties."""
    features = []
    for one in rings:
        outline, properties = one if isinstance(one, tuple) else (one, {})
        shape = {"type": "Polygon", "coordinates": [outline]}
        features.append({"type": "Feature", "properties": properties, "geometry": shape})
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features} | members))
    return path


def box(shape, rows: slice, columns: slice) -> np.ndarray:
    mask = np.zeros(shape, bool)
    mask[rows, columns] = True
    return mask


# -- where ------------------------------------------------------------------------------------


def test_footprints_keep_the_pixels_whose_centres_lie_in_them(tmp_path, city):
    path = write_geojson(tmp_path / "a.geojson", ring(10.4, 5.6, 20.4, 15.4), ring(50, 30, 99, 99))
    layer, attribution = read_condensation(path, city)
    expected = box(city.shape, slice(6, 15), slice(10, 20))
    expected |= box(city.shape, slice(30, 40), slice(50, 60))
    assert np.array_equal(layer.mask, expected)
    assert np.array_equal(layer.heights[layer.mask], city.heights[layer.mask])
    assert attribution == ""


def test_every_polygon_counts_whether_it_says_building_or_not(tmp_path, city):
    path = write_geojson(
        tmp_path / "a.geojson",
        (ring(0, 0, 5, 5), {"building": "yes"}),
        (ring(10, 10, 15, 15), {"waterway": "river"}),
    )
    assert len(read_condensation(path, city)[0]) == 50


def test_the_buildings_of_a_bundled_city_are_its_pixels():
    lyon = read_map("lyon-1er")
    layer, attribution = read_condensation("lyon-1er", lyon)
    assert np.array_equal(layer.mask, lyon.heights > 0)
    assert np.array_equal(layer.heights, lyon.heights)
    assert attribution == lyon.attribution


@pytest.mark.parametrize("name", ["mask.npy", "mask.png", "mask.tif", "small.png"])
@pytest.mark.parametrize("place", [{}, ON_EARTH], ids=["nowhere", "placed"])
def test_masks_keep_the_pixels_above_0(tmp_path, name, place):
    city = draw_city(**place)
    mask = box(city.shape, slice(3, 20), slice(7, 31))
    if name == "mask.npy":
        np.save(tmp_path / name, mask)
    elif name == "mask.tif":
        write_map(CityMap(mask * 0.5, 2.0), tmp_path / name)
    else:
        levels = (mask * (255 if name == "mask.png" else 1)).astype(np.uint8)
        Image.fromarray(levels).save(tmp_path / name)
    layer, _ = read_condensation(tmp_path / name, city)
    assert np.array_equal(layer.mask, mask)
    assert np.array_equal(layer.heights, city.heights * mask)


def test_a_placed_mask_is_laid_where_it_lies(tmp_path, city):
    """A raster of another extent, of pixels twice as large."""
    path = tmp_path / "a.tif"
    with rasterio.open(
        path, "w", driver="GTiff", count=1, height=30, width=40, dtype="uint8", crs="EPSG:25830",
        transform=rasterio.Affine(4, 0, CORNER[0] - 20, 0, -4, CORNER[1] + 20),
    ) as target:  # fmt: skip
        target.write(box((30, 40), slice(7, 12), slice(10, 19)).astype(np.uint8), 1)
    layer, _ = read_condensation(path, city)
    assert np.array_equal(layer.mask, box(city.shape, slice(4, 14), slice(10, 28)))


def test_a_mask_written_from_the_map_itself_is_on_its_pixels(tmp_path):
    lyon = read_map("lyon-1er")
    write_map(lyon, tmp_path / "lyon.tif")
    layer, _ = read_condensation(tmp_path / "lyon.tif", lyon)
    assert np.array_equal(layer.mask, lyon.heights > 0)


# -- how high ---------------------------------------------------------------------------------


def test_a_height_in_metres_stands_in_all_of_it(tmp_path, city):
    path = write_geojson(tmp_path / "river.geojson", ring(0, 10, 60, 20), attribution="the river")
    layer, attribution = read_condensation(path, city, 0)
    assert np.array_equal(layer.mask, box(city.shape, slice(10, 20), slice(0, 60)))
    assert not layer.heights.any()
    assert attribution == "the river"


def test_new_buildings_bring_their_heights(tmp_path, city):
    path = write_geojson(
        tmp_path / "new.geojson",
        (ring(0, 0, 10, 10), {"height": 12.5}),
        (ring(5, 5, 20, 20), {"building:levels": 7}),
        (ring(30, 0, 40, 10), {}),
        attribution="the architect",
    )
    layer, attribution = read_condensation(path, city, path)
    assert layer.heights[2, 2] == 12.5
    assert layer.heights[7, 7] == 21  # the highest, where two stand
    assert layer.heights[5, 35] == 6
    assert layer.mask.sum() == 100 + 225 - 25 + 100
    assert attribution == "the architect"


@pytest.mark.parametrize("suffix", [".npy", ".tif"])
def test_heights_of_a_raster(tmp_path, city, suffix):
    other = city.replace(city.heights + 3.25, attribution="a survey")
    write_map(other, tmp_path / f"dsm{suffix}")
    np.save(tmp_path / "mask.npy", box(city.shape, slice(0, 9), slice(0, 9)))
    layer, told = read_condensation(tmp_path / "mask.npy", city, tmp_path / f"dsm{suffix}")
    assert np.array_equal(layer.heights[layer.mask], other.heights[layer.mask])
    assert told == ("a survey" if suffix == ".tif" else "")


# -- refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("missing.geojson", None, "no file"),
        ("a.npy", np.ones((60, 40), bool), r"60 × 40 px, but here has 40 × 60 px"),
        ("a.npy", np.zeros((40, 60), bool), "no value above 0 on the map here"),
        ("a.npy", np.full((40, 60), -1.0), "no value above 0 on the map here"),
        ("a.npy", np.full((40, 60), np.nan), "no value above 0 on the map here"),
        ("a.png", np.zeros((40, 60, 3), np.uint8), "picture in colour"),
        ("a.geojson", [], "has no polygon"),
        (
            "a.geojson",
            [[[4.8, 45.7], [4.9, 45.7], [4.9, 45.8], [4.8, 45.7]]],
            "footprints .1 in all. cover",
        ),
        ("a.geojson", [ring(10.6, 10.6, 11.4, 11.4)], "footprints .1 in all. cover"),
        ("a.geojson", [[[1e6, 1e6], [2e6, 1e6], [2e6, 2e6], [1e6, 1e6]]], "out of range"),
        ("a.doc", b"a letter", "no reader for .doc"),
    ],
)
def test_places_at_fault_are_refused(tmp_path, city, name, content, word):
    path = tmp_path / name
    if isinstance(content, np.ndarray) and name.endswith(".npy"):
        np.save(path, content)
    elif isinstance(content, np.ndarray):
        Image.fromarray(content).save(path)
    elif isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        write_geojson(path, *content)
    with pytest.raises(MapError, match=word):
        read_condensation(path, city)


def test_footprints_need_a_map_with_a_place(tmp_path):
    path = write_geojson(tmp_path / "a.geojson", ring(0, 0, 9, 9))
    for place in ({}, {"origin": CORNER}, {"crs": "EPSG:25830"}):
        with pytest.raises(MapError, match="here has no position in a coordinate reference system"):
            read_condensation(path, draw_city(**place))
    with pytest.raises(MapError, match="reference system 'nonsense'"):
        read_condensation(path, draw_city(origin=CORNER, crs="nonsense"))


@pytest.mark.parametrize("height", [-1, 1001, float("nan"), float("inf")])
def test_heights_beyond_all_buildings_are_refused(tmp_path, city, height):
    path = write_geojson(tmp_path / "a.geojson", ring(0, 0, 9, 9))
    with pytest.raises(MapError, match="0 m \\(ground\\) to 1000 m"):
        read_condensation(path, city, height)


def test_heights_at_fault_are_refused(tmp_path, city):
    path = write_geojson(tmp_path / "a.geojson", ring(0, 0, 9, 9))
    Image.fromarray(np.zeros((40, 60), np.uint8)).save(tmp_path / "dsm.png")
    np.save(tmp_path / "dsm.npy", np.full((40, 60), -1.0))
    np.save(tmp_path / "small.npy", np.ones((4, 6)))
    for name, word in (
        ("dsm.png", "grey levels"),
        ("dsm.npy", "below ground"),
        ("small.npy", "4 × 6 px"),
        ("missing.tif", "no file"),
    ):
        with pytest.raises(MapError, match=word):
            read_condensation(path, city, tmp_path / name)
