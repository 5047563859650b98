"""Maps written by windows: the same file as whole ones, whole or not at all."""

import numpy as np
import pytest
import rasterio
from towns import draw_town

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io import WINDOW_WRITERS, WRITERS, read_map, write_map, write_windows
from evocity.io.geotiff_seal import SEAL
from evocity.io.writers import TABLES


class Windows:
    """A map that is asked for its windows, and counts what it hands out."""

    metres_per_pixel = 2.0
    name = "ville"
    attribution = "© IGN – BD TOPO®"
    origin = (10.0, 5000.0)
    crs = "+proj=tmerc +lat_0=45.7 +lon_0=4.8 +k=1 +ellps=WGS84 +units=m"

    def __init__(self, heights):
        self.heights, self.shape, self.largest = heights, heights.shape, 0

    def window(self, top, left, height, width):
        self.largest = max(self.largest, height * width)
        return self.heights[top : top + height, left : left + width]


@pytest.fixture
def town():
    return Windows(np.tile(draw_town(3, side=40).heights, (15, 7)))  # 600 × 280


def test_windows_are_written_to_what_maps_are():
    assert set(WINDOW_WRITERS) == set(WRITERS) - {".png", *TABLES, ".geojson"}


def test_a_geotiff_by_windows_tells_what_a_whole_one_does(tmp_path, town):
    described = {key: getattr(town, key) for key in ("name", "attribution", "origin", "crs")}
    write_map(CityMap(town.heights, 2.0, **described), tmp_path / "whole.tif")
    write_windows(town, tmp_path / "windows.tif")
    whole, windows = (rasterio.open(tmp_path / f"{name}.tif") for name in ("whole", "windows"))
    with whole, windows:
        assert np.array_equal(windows.read(1), whole.read(1))
        for key in ("bounds", "crs", "descriptions", "units", "dtypes"):
            assert getattr(windows, key) == getattr(whole, key), key
        tags = [file.tags() for file in (windows, whole)]
        seals = {each.pop(SEAL) for each in tags}  # of other bytes
        assert len(seals) == 2
        assert tags[0] == tags[1]
        assert windows.block_shapes == [(256, 256)]
    back = read_map(tmp_path / "windows.tif")
    assert np.array_equal(back.heights, town.heights)
    assert (back.name, back.attribution, back.metres_per_pixel) == ("ville", town.attribution, 2.0)


def test_a_map_without_a_place_keeps_its_pixels(tmp_path, town):
    town.origin = town.crs = None
    write_windows(town, tmp_path / "windows.tif")
    back = read_map(tmp_path / "windows.tif")
    assert (back.metres_per_pixel, back.crs) == (2.0, None)
    assert np.array_equal(back.heights, town.heights)


def test_npy_by_windows_is_the_bare_array(tmp_path, town):
    told = []
    write_windows(town, tmp_path / "windows.npy", lambda done, total: told.append((done, total)))
    assert np.array_equal(np.load(tmp_path / "windows.npy", allow_pickle=False), town.heights)
    assert told == [(256, 600), (512, 600), (600, 600)]
    assert town.largest == 256 * 280  # never the whole


@pytest.mark.parametrize("name", ["a.tif", "a.npy"])
def test_what_fails_leaves_the_file_that_was(tmp_path, town, name):
    path = tmp_path / name
    path.write_text("of yesterday")

    def lost(top, left, height, width):
        if top:
            raise OSError(28, "No space left on device")
        return town.heights[top : top + height, left : left + width]

    town.window = lost
    with pytest.raises(MapError, match="No space left"):
        write_windows(town, path)
    assert [one.name for one in tmp_path.iterdir()] == [name]
    assert path.read_text() == "of yesterday"


def test_other_suffixes_are_refused(tmp_path, town):
    with pytest.raises(MapError, match=r"\.png"):
        write_windows(town, tmp_path / "a.png")
    with pytest.raises(MapError, match="no such folder"):
        write_windows(town, tmp_path / "nowhere" / "a.tif")
    assert list(tmp_path.iterdir()) == []
