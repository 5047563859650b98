"""Values on a city's grid: what is written is what is read."""

import numpy as np
import pytest
import rasterio
from PIL import Image
from towns import draw_town

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io import FIELD_WRITERS, WRITERS, write_field
from evocity.io.writers import TABLES
from evocity.pictures import Field
from evocity.pictures.colours import NOTHING
from evocity.pictures.picture import render_field


@pytest.fixture
def field():
    town = draw_town(3, side=40)
    city = CityMap(
        town.heights, 2.0, name="ville", attribution="© IGN", origin=(10, 50), crs="EPSG:2154"
    )
    values = np.random.default_rng(4).random(city.shape, dtype=np.float32)
    return Field(city, values, "share of light", "light", "%")


def test_fields_are_written_wherever_maps_are_rasters():
    assert set(FIELD_WRITERS) == set(WRITERS) - {*TABLES, ".geojson"}


def test_geotiff_keeps_values_place_and_words(tmp_path, field):
    write_field(field, tmp_path / "field.tif")
    with rasterio.open(tmp_path / "field.tif") as file:
        np.testing.assert_array_equal(file.read(1), field.values)
        assert file.bounds == (10, -30, 90, 50)
        assert file.crs.to_epsg() == 2154
        assert (file.descriptions, file.units) == (("share of light",), ("%",))
        assert file.tags()["ATTRIBUTION"] == "© IGN"


def test_npy_is_the_bare_array(tmp_path, field):
    write_field(field, tmp_path / "field.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "field.npy"), field.values)


def test_picture_has_title_and_attribution(tmp_path, field):
    write_field(field, tmp_path / "field.png")
    with Image.open(tmp_path / "field.png") as picture:
        assert picture.text["Title"] == "ville: share of light"
        assert picture.text["Copyright"] == "© IGN"


def test_larger_values_are_darker():
    values = np.linspace(0, 0.04, 48 * 48, dtype=np.float32).reshape(48, 48)
    city = CityMap(np.zeros((48, 48)), 2.0)
    drawn = render_field(Field(city, values, "", ""))
    left = top = 2 * 11  # a small sheet's margin
    top += int(2.4 * 11)
    fabric = np.asarray(drawn.convert("L"), int)[top : top + 48, left : left + 48]
    lines = fabric.mean(axis=1)
    assert (np.diff(lines) <= 0).all()
    assert lines[0] - lines[-1] > 150


@pytest.mark.parametrize("value", [0.0, 1e-9, 1.0, 1234.0])
def test_one_value_everywhere_can_be_drawn(value):
    city = CityMap(np.zeros((8, 8)), 2.0)
    picture = render_field(Field(city, np.full((8, 8), value, np.float32), "v", "v"), zoom=3)
    assert picture.width > 24


def test_where_there_is_no_value_it_is_grey_and_nodata(tmp_path, field):
    values = field.values.copy()
    values[5:9, 7:30] = np.nan
    holed = Field(field.city, values, field.title, field.symbol)
    plain, drawn = (np.asarray(render_field(one, zoom=12)) for one in (field, holed))
    grey = (drawn == NOTHING).all(axis=2)
    assert not (plain == NOTHING).all(axis=2).any()
    assert grey.sum() > 0.6 * 4 * 23 * 12**2  # the edges of roofs are drawn over it
    write_field(holed, tmp_path / "field.tif")
    with rasterio.open(tmp_path / "field.tif") as file:
        assert np.isnan(file.nodata)
        np.testing.assert_array_equal(file.read(1), values)
    write_field(field, tmp_path / "field.tif")
    with rasterio.open(tmp_path / "field.tif") as file:
        assert np.isnan(file.nodata)
    everywhere = Field(field.city, np.full_like(values, np.nan), "nothing", "n")
    assert render_field(everywhere).width > 40


def test_another_suffix_is_refused(tmp_path, field):
    with pytest.raises(MapError, match=r"choose \.tif"):
        write_field(field, tmp_path / "field.jpg")
    assert not list(tmp_path.iterdir())
