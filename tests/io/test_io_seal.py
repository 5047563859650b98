"""The seal of GeoTIFFs that evocity writes: changed bytes are refused, files of others are read."""

import shutil

import numpy as np
import pytest
import rasterio
from PIL import Image
from rasterio.shutil import copy

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io import read_map, write_map
from evocity.io.geotiff_seal import SEAL, UNSEALED
from evocity.io.writers import write_windows


@pytest.fixture(scope="module")
def city():
    rng = np.random.default_rng(0)
    lots = np.where(rng.random((16, 16)) < 0.5, rng.integers(3, 20, (16, 16)), 0)
    heights = lots.repeat(4, 0).repeat(4, 1).astype(np.float32)
    place = {"origin": (770000.0, 6270000.0), "crs": "EPSG:2154"}
    return CityMap(heights, 2.0, name="town", attribution="© nobody", **place)


@pytest.fixture
def path(city, tmp_path):
    write_map(city, tmp_path / "town.tif")
    return tmp_path / "town.tif"


def content(path):
    found = read_map(path)
    about = found.name, found.attribution, found.origin, found.crs, found.metres_per_pixel
    return found.heights.tobytes(), about


def value_of(path):
    with rasterio.open(path) as file:
        return file.tags()[SEAL]


def test_a_written_file_has_the_seal(path, city):
    value = value_of(path)
    assert value != UNSEALED
    assert int(value[:16]) == path.stat().st_size
    assert np.array_equal(read_map(path).heights, city.heights)


def test_flips_are_refused_or_harmless(path):
    whole, data, rng = content(path), path.read_bytes(), np.random.default_rng(1)
    refused = 0
    for at in rng.choice(len(data), 60, replace=False):
        changed = bytearray(data)
        changed[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(changed)
        try:
            found = content(path)
        except MapError as error:
            refused += "town.tif" in str(error)
        else:
            assert found == whole
    assert refused > 50


def test_the_message_says_how_to_accept_a_change(path, city):
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    changed = path.with_name("changed.tif")
    changed.write_bytes(data)
    with pytest.raises(MapError, match=r"changed\.tif is damaged") as refused:
        read_map(changed)
    assert f"rio edit-info --tag {SEAL}= changed.tif" in str(refused.value)


@pytest.mark.parametrize("way", ["emptied", "removed", "again", "heights"])
def test_files_that_others_saved_are_read(path, city, way):
    other = path.with_name("other.tif")
    if way == "again":  # as gdal_translate does
        copy(path, other, driver="GTiff", compress="none")
        assert value_of(other) == value_of(path)
    else:
        shutil.copyfile(path, other)
        with rasterio.open(other, "r+") as file:
            if way == "heights":
                file.write(city.heights * 2, 1)
            elif way == "emptied":
                file.update_tags(**{SEAL: ""})
            else:
                tags = {key: value for key, value in file.tags().items() if key != SEAL}
                file.update_tags(ns="", **tags)
    found = read_map(other).heights
    assert np.array_equal(found, city.heights * (2 if way == "heights" else 1))


def test_a_file_that_is_written_in_windows_has_the_seal(city, tmp_path):
    class Source:
        shape, metres_per_pixel, name, attribution = (600, 300), 2.0, "large", "nobody"
        origin = crs = None

        def window(self, top, left, height, width):
            return np.full((height, width), top + 1, np.float32)

    write_windows(Source(), tmp_path / "large.tif")
    assert value_of(tmp_path / "large.tif") != UNSEALED
    data = bytearray((tmp_path / "large.tif").read_bytes())
    assert read_map(tmp_path / "large.tif").shape == (600, 300)
    data[len(data) // 2] ^= 4
    (tmp_path / "large.tif").write_bytes(data)
    with pytest.raises(MapError, match="is damaged"):
        read_map(tmp_path / "large.tif")


def test_flips_in_a_png_are_refused_or_harmless(city, tmp_path):
    path, rng = tmp_path / "town.png", np.random.default_rng(2)
    Image.fromarray(city.heights.astype(np.uint8)).save(path)
    data, stated, refused = path.read_bytes(), {"metres_per_pixel": 2.0, "height_scale": 1.0}, 0
    for at in rng.choice(len(data), 100, replace=False):
        changed = bytearray(data)
        changed[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(changed)
        try:
            found = read_map(path, **stated)
        except MapError as error:
            refused += "town.png" in str(error)
        else:
            assert np.array_equal(found.heights, city.heights)
    assert refused > 80
