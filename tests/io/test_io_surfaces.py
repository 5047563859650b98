"""Rasters that other programs stumble over: sidecars, orientation, fillers, elevations, units."""

import contextlib
import os

import numpy as np
import pytest
import rasterio
from affine import Affine
from PIL import Image
from pyproj import CRS

from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.resampling import compose

NORTH_UP = Affine(2, 0, 842000, 0, -2, 6519128)


def town(shape=(64, 64)):
    """Two buildings of 10 × 10 px, 12 and 30 m high, on open ground."""
    heights = np.zeros(shape, np.float32)
    heights[10:20, 10:20], heights[30:40, 40:50] = 12, 30
    return heights


def write(path, heights, transform=NORTH_UP, crs="EPSG:2154", **more):
    profile = {"driver": "GTiff", "count": 1, "dtype": heights.dtype, "crs": crs}
    rows, columns = heights.shape
    with rasterio.open(
        path, "w", height=rows, width=columns, transform=transform, **profile | more
    ) as target:
        target.write(heights, 1)
    return path


def same(city, heights):
    np.testing.assert_array_equal(city.heights, heights)


@pytest.mark.parametrize(
    ("turn", "transform"),
    [
        (lambda h: h[::-1], Affine(2, 0, 842000, 0, 2, 6519000)),
        (lambda h: h[:, ::-1], Affine(-2, 0, 842128, 0, -2, 6519128)),
        (lambda h: h[::-1, ::-1], Affine(-2, 0, 842128, 0, 2, 6519000)),
        (lambda h: h.T, Affine(0, 2, 842000, -2, 0, 6519128)),
    ],
)
def test_flipped_and_quarter_turned_rasters_are_read_exactly(tmp_path, turn, transform):
    city = read_map(write(tmp_path / "a.tif", np.ascontiguousarray(turn(town())), transform))
    same(city, town())
    assert city.origin == (842000, 6519128)


@pytest.mark.parametrize("degrees", [10, -30, 45])
def test_a_rotated_raster_keeps_its_areas(tmp_path, degrees):
    transform = compose(NORTH_UP, Affine.rotation(degrees))
    city = read_map(write(tmp_path / "a.tif", town(), transform))
    areas = [(city.heights == high).sum() * city.metres_per_pixel**2 for high in (12, 30)]
    assert areas == pytest.approx([400, 400], rel=0.1)


@pytest.mark.parametrize("value", [9999, -9999, 250])
def test_the_nodata_of_a_sidecar_is_applied(tmp_path, value):
    heights = town()
    heights[:5, :5] = value
    path = write(tmp_path / "a.tif", heights)
    note = f'<PAMRasterBand band="1"><NoDataValue>{value}</NoDataValue></PAMRasterBand>'
    (tmp_path / "a.tif.aux.xml").write_text(f"<PAMDataset>{note}</PAMDataset>")
    city = read_map(path)
    same(city, town())
    assert "25 pixels without a value" in city.taken


def test_scale_and_offset_of_a_sidecar_are_applied(tmp_path):
    path = write(tmp_path / "a.tif", ((town() + 1) * 4).astype(np.int16))
    note = '<PAMRasterBand band="1"><Scale>0.25</Scale><Offset>-1</Offset></PAMRasterBand>'
    (tmp_path / "a.tif.aux.xml").write_text(f"<PAMDataset>{note}</PAMDataset>")
    same(read_map(path), town())


@pytest.mark.parametrize(
    "text",
    ["<PAMDataset>", "<!DOCTYPE a [<!ENTITY b 'c'>]><PAMDataset/>", "\x00", "<a>\ud800</a>"],
)
def test_a_damaged_sidecar_is_refused(tmp_path, text):
    path = write(tmp_path / "a.tif", town())
    (tmp_path / "a.tif.aux.xml").write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(MapError, match=r"a\.tif\.aux\.xml, beside the raster"):
        read_map(path)


@pytest.mark.parametrize("suffix", [".aux.xml", ".msk"])
def test_a_sidecar_is_not_read_through_a_link(tmp_path, suffix):
    path = write(tmp_path / "a.tif", town())
    (tmp_path / "other").write_text("<PAMDataset/>")
    os.symlink(tmp_path / "other", f"{path}{suffix}")
    with pytest.raises(MapError, match="it is a link"):
        read_map(path)


def test_a_mask_beside_the_raster_is_applied(tmp_path):
    path = write(tmp_path / "a.tif", town())
    mask = np.where(town() == 30, 0, 255).astype(np.uint8)
    os.rename(write(tmp_path / "m.tif", mask), tmp_path / "a.tif.msk")
    same(read_map(path), np.where(town() == 30, 0, town()))
    os.rename(write(tmp_path / "m.tif", mask[:9]), tmp_path / "a.tif.msk")
    with pytest.raises(MapError, match="9 × 64 px"):
        read_map(path)


def test_alpha_marks_missing_pixels(tmp_path):
    levels = town().astype(np.uint8)
    alpha = np.where(levels == 30, 0, 255).astype(np.uint8)
    Image.fromarray(np.dstack([levels, alpha]), "LA").save(tmp_path / "a.png")
    city = read_map(tmp_path / "a.png", metres_per_pixel=2, height_scale=1)
    same(city, np.where(levels == 30, 0, town()))


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        ("float32", 9999),
        ("float32", -9999),
        ("float32", 3.4028235e38),
        ("uint16", 65535),
        ("int16", -32768),
    ],
)
def test_undeclared_fillers_are_refused_and_named(tmp_path, kind, value):
    heights = town().astype(kind)
    heights[:5, :5] = value
    path = write(tmp_path / "a.tif", heights)
    with pytest.raises(MapError, match=r"25 of 4096 pixels \(0.61 %\)") as caught:
        read_map(path)
    assert "nodata" in str(caught.value)
    same(read_map(path, nodata=value), town())


@pytest.mark.parametrize("ground", [170, -3, 2500])
def test_elevations_are_refused_without_a_terrain(tmp_path, ground):
    path = write(tmp_path / "a.tif", town() + np.float32(ground))
    with pytest.raises(MapError, match="terrain="):
        read_map(path)
    slope = np.full((64, 64), ground, np.float32)
    terrain = write(tmp_path / "dtm.tif", slope)
    same(read_map(path, terrain=terrain), town())
    same(read_map(path, terrain=ground), town())


def test_a_terrain_of_other_pixels_and_a_larger_extent_is_fitted(tmp_path):
    path = write(tmp_path / "a.tif", town() + 170)
    larger = Affine(2, 0, 841900, 0, -2, 6519228)
    terrain = write(tmp_path / "dtm.tif", np.full((200, 200), 170, np.float32), larger)
    same(read_map(path, terrain=terrain), town())


@pytest.mark.parametrize(
    ("terrain", "found"),
    [
        ({"crs": "EPSG:32631"}, "two rasters in the same reference system"),
        ({"transform": Affine(2, 0, 842064, 0, -2, 6519128)}, "values for 50 % of the pixels"),
        ({"nodata": 170}, "values for 0 % of the pixels"),
    ],
)
def test_a_terrain_that_does_not_fit_is_refused(tmp_path, terrain, found):
    path = write(tmp_path / "a.tif", town() + 170)
    ground = write(tmp_path / "dtm.tif", np.full((64, 64), 170, np.float32), **terrain)
    with pytest.raises(MapError, match=found):
        read_map(path, terrain=ground)


def test_a_raster_of_buildings_only_needs_no_terrain(tmp_path):
    heights = np.where(town() > 0, town(), -9999).astype(np.float32)
    same(read_map(write(tmp_path / "a.tif", heights, nodata=-9999)), town())


def test_a_local_system_in_metres_gives_the_size_of_pixels(tmp_path):
    crs = 'LOCAL_CS["site",UNIT["metre",1],AXIS["Easting",EAST],AXIS["Northing",NORTH]]'
    path = write(tmp_path / "a.tif", town(), crs=crs)
    city = read_map(path)
    same(city, town())
    assert (city.metres_per_pixel, city.crs) == (2.0, None)
    same(read_map(path, metres_per_pixel=1.0), town().repeat(2, axis=0).repeat(2, axis=1))


def grid(heights, **header):
    keys = {"ncols": heights.shape[1], "nrows": heights.shape[0], "xllcorner": 842000}
    keys |= {"yllcorner": 6519000, "cellsize": 2, "nodata_value": "-3.4E+038"} | header
    rows = (" ".join(map(str, row)) for row in heights.tolist())
    return "\n".join([*(f"{key} {value}" for key, value in keys.items()), *rows]) + "\n"


def test_an_ascii_grid_is_read(tmp_path):
    path = tmp_path / "a.asc"
    path.write_text(grid(town()))
    with pytest.raises(MapError, match="metres_per_pixel=2"):
        read_map(path)
    same(read_map(path, metres_per_pixel=2), town())
    for kind in ("WKT1_GDAL", "WKT1_ESRI", "WKT2_2019"):  # ESRI writes no codes
        (tmp_path / "a.prj").write_text(CRS.from_epsg(2154).to_wkt(kind))
        city = read_map(path)
        same(city, town())
        assert (city.origin, city.crs) == ((842000, 6519128), "EPSG:2154")


@pytest.mark.parametrize(
    "text",
    [
        grid(town())[:900],
        grid(town()) + "1 2 3",
        grid(town(), ncols="x"),
        grid(town(), cellsize=0),
        grid(town()).replace("30.0", "north"),
        "ncols 5\nnrows 5\n",
        "ncols 99999999\nnrows 99999999\ncellsize 1\n",
    ],
)
def test_a_damaged_ascii_grid_is_refused(tmp_path, text):
    (tmp_path / "a.asc").write_text(text)
    with pytest.raises(MapError):
        read_map(tmp_path / "a.asc", metres_per_pixel=2)


def _fuzz(tmp_path, count):
    rng, whole = np.random.default_rng(7), grid(town((24, 24))[:24]).encode()
    path = tmp_path / "a.asc"
    for _ in range(count):
        damaged = bytearray(whole)
        for _ in range(rng.integers(1, 9)):
            damaged[rng.integers(len(damaged))] = rng.integers(256)
        path.write_bytes(bytes(damaged[: rng.integers(1, len(damaged) + 1)]))
        with contextlib.suppress(MapError):
            read_map(path, metres_per_pixel=2)


def test_damaged_ascii_grids_end_in_a_map_or_an_error(tmp_path):
    _fuzz(tmp_path, 50)


@pytest.mark.long
def test_a_thousand_damaged_ascii_grids_end_in_a_map_or_an_error(tmp_path):
    _fuzz(tmp_path, 1000)


def test_crowns_of_trees_are_noted(tmp_path):
    rough = town()
    rough[20:50, 5:35] = np.random.default_rng(1).uniform(3, 20, (30, 30))
    rough[30:40, 40:50] = 0
    assert "crowns of trees" in read_map(write(tmp_path / "a.tif", rough)).taken
    assert "crowns" not in read_map(write(tmp_path / "b.tif", town())).taken
