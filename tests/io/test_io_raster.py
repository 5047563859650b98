"""Rasters -> maps -> files: what is kept bit for bit, what is resampled, what is refused."""

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from pyproj import CRS, Transformer

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.io import WRITERS, attribution_of, cities, read_map, write_map
from evocity.pictures.colours import GROUND, PAPER, ramp, roofs_end, scale_end
from evocity.pictures.picture import render


def blocks(shape=(60, 80)):
    rows, columns = np.indices(shape)
    return ((rows // 5 + columns // 7) % 4 * 7.25).astype(np.float32)


def write_tif(path, heights, crs="EPSG:25830", corner=(500000, 4794000), side=(2.0, 2.0), **more):
    profile = {
        "driver": "GTiff",
        "count": 1,
        "height": heights.shape[0],
        "width": heights.shape[1],
        "dtype": heights.dtype,
        "crs": crs,
        "transform": rasterio.Affine(side[0], 0, corner[0], 0, -side[1], corner[1]),
    } | more
    with rasterio.open(path, "w", **profile) as target:
        target.write(heights, 1)
    return path


def test_native_pixels_are_kept_as_they_are(tmp_path):
    heights = blocks()
    city = read_map(write_tif(tmp_path / "a.tif", heights))
    np.testing.assert_array_equal(city.heights, heights)
    assert (city.metres_per_pixel, city.crs) == (2.0, "EPSG:25830")
    assert city.origin == (500000, 4794000)
    assert city.taken == "the whole raster of the file, 80 × 60 px"


def test_a_window_is_cut_on_the_same_pixels(tmp_path):
    heights = blocks()
    path = write_tif(tmp_path / "a.tif", heights)
    city = read_map(path, pixels=20)
    np.testing.assert_array_equal(city.heights, heights[20:40, 30:50])
    assert city.origin == (500060, 4793960)
    assert city.taken == "a window of 20 × 20 px of the file's 80 × 60 px"
    to_degrees = Transformer.from_crs(25830, 4326, always_xy=True)
    center = to_degrees.transform(500000 + 2 * 25, 4794000 - 2 * 15)
    city = read_map(path, pixels=20, center=center, metres_per_pixel=2.0)
    np.testing.assert_array_equal(city.heights, heights[5:25, 15:35])


def test_finer_and_coarser_pixels_take_what_lies_at_their_centre(tmp_path):
    heights = blocks()
    path = write_tif(tmp_path / "a.tif", heights)
    finer = read_map(path, metres_per_pixel=1.0)
    np.testing.assert_array_equal(finer.heights, heights.repeat(2, axis=0).repeat(2, axis=1))
    assert finer.taken == "160 × 120 m at 1 m a pixel, from a raster of 80 × 60 px of about 2 m"
    coarser = read_map(path, metres_per_pixel=6.0)
    np.testing.assert_array_equal(coarser.heights, heights[1::3, 1::3][:20, : coarser.shape[1]])


def test_pixels_that_are_not_square_become_so(tmp_path):
    heights = blocks()
    city = read_map(write_tif(tmp_path / "a.tif", heights, side=(4.0, 1.0)))
    assert city.metres_per_pixel == pytest.approx(2.0, rel=1e-3)
    assert city.shape == (30, 160)
    assert city.built.mean() == pytest.approx((heights > 1.5).mean(), abs=0.02)


def test_degrees_become_metres(tmp_path):
    side = 2.0 / 111_200
    heights = np.zeros((200, 200), np.float32)
    heights[50:150, 50:150] = 10
    path = write_tif(tmp_path / "a.tif", heights, "EPSG:4326", (2.0, 60.0), (side, side))
    city = read_map(path, metres_per_pixel=1.0)
    assert city.built.sum() == pytest.approx((100 * 2) * (100 * 2 * 0.5), rel=0.03)
    assert CRS.from_user_input(city.crs).is_projected


def test_web_mercator_is_put_right(tmp_path):
    heights = np.zeros((200, 200), np.float32)
    heights[50:150, 50:150] = 10
    path = write_tif(tmp_path / "a.tif", heights, "EPSG:3857", (1_600_000, 6_460_000), (3.0, 3.0))
    city = read_map(path)
    area = city.built.sum() * city.metres_per_pixel**2
    assert area == pytest.approx((300 * np.cos(np.radians(50.1))) ** 2, rel=0.03)


def test_nodata_and_what_lies_below_ground_are_ground(tmp_path):
    heights = np.full((8, 8), 9, np.float32)
    heights[0, 0], heights[0, 1], heights[0, 2], heights[0, 3] = 0, -2, np.nan, 255
    heights[1, :4] = -99
    city = read_map(write_tif(tmp_path / "a.tif", heights, nodata=255), terrain=0)
    assert (city.heights[:2, :4] == 0).all()
    assert (city.heights[2:] == 9).all()


def test_feet_of_a_band_are_converted(tmp_path):
    path = write_tif(tmp_path / "a.tif", np.full((8, 8), 10, np.int16))
    with rasterio.open(path, "r+") as target:
        target.units = ("ft",)
    assert read_map(path, terrain=0).heights[0, 0] == pytest.approx(3.048)
    assert read_map(path, height_scale=2, terrain=0).heights[0, 0] == pytest.approx(6.096)


def test_a_tif_without_a_place_needs_its_pixel_size(tmp_path):
    path = tmp_path / "a.tif"
    with pytest.warns(rasterio.errors.NotGeoreferencedWarning):
        write_tif(path, blocks(), crs=None, transform=rasterio.Affine.identity())
    with pytest.raises(MapError, match="metres_per_pixel="):
        read_map(path)
    np.testing.assert_array_equal(read_map(path, metres_per_pixel=3).heights, blocks())
    with pytest.raises(MapError, match="no coordinate reference system"):
        read_map(path, metres_per_pixel=3, center=(0, 0))


@pytest.mark.parametrize("levels", [np.uint8, np.uint16])
def test_grey_png(tmp_path, levels):
    heights = (blocks() * 4).astype(levels)
    Image.fromarray(heights).save(tmp_path / "a.png")
    with pytest.raises(MapError, match="height_scale="):
        read_map(tmp_path / "a.png", metres_per_pixel=2)
    city = read_map(tmp_path / "a.png", metres_per_pixel=2, height_scale=0.25, pixels=60)
    np.testing.assert_array_equal(city.heights, blocks()[:, 10:70])


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P"])
def test_a_colour_png_is_refused(tmp_path, mode):
    Image.new(mode, (8, 8)).save(tmp_path / "a.png")
    with pytest.raises(MapError, match="colour"):
        read_map(tmp_path / "a.png", metres_per_pixel=2, height_scale=1)


def test_npy(tmp_path):
    np.save(tmp_path / "a.npy", blocks().astype(float))
    with pytest.raises(MapError, match="metres_per_pixel="):
        read_map(tmp_path / "a.npy")
    city = read_map(tmp_path / "a.npy", metres_per_pixel=0.5)
    np.testing.assert_array_equal(city.heights, blocks())
    assert city.metres_per_pixel == 0.5
    assert city.taken == "the whole raster of the file, 80 × 60 px"
    cut = read_map(tmp_path / "a.npy", metres_per_pixel=0.5, pixels=30)
    assert cut.taken == "a window of 30 × 30 px of the file's 80 × 60 px"


@pytest.mark.parametrize("pixels", [61, 500])
def test_a_window_beyond_the_raster_is_refused(tmp_path, pixels):
    path = write_tif(tmp_path / "a.tif", blocks())
    for side in (2.0, 2.5):
        with pytest.raises(MapError, match="beyond the raster"):
            read_map(path, pixels=pixels, metres_per_pixel=side)
    with pytest.raises(MapError, match="beyond the raster"):
        read_map(path, pixels=20, center=(-3.5, 43.3))


# ---------------------------------------------------------------- writing


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 70), st.integers(1, 70)),
    side=st.floats(0.1, 30),
    placed=st.booleans(),
)
def test_a_tif_gives_back_the_map(tmp_path_factory, seed, shape, side, placed):
    heights = np.random.default_rng(seed).gamma(1.0, 9.0, shape).astype(np.float32)
    place = {"origin": (652_345.25, 6_862_345.5), "crs": "EPSG:2154"} if placed else {}
    city = CityMap(heights, side, name="Đà Nẵng", attribution="© Ünë – x", **place)
    path = tmp_path_factory.mktemp("tif") / "a.tif"
    write_map(city, path)
    back = read_map(path)
    assert back.heights.tobytes() == city.heights.tobytes()
    for what in ("metres_per_pixel", "name", "attribution", "origin", "crs"):
        assert getattr(back, what) == getattr(city, what), what
    assert sorted(p.name for p in path.parent.iterdir()) == ["a.qml", "a.tif"]


def test_a_map_of_footprints_comes_back_from_a_tif_at_its_place(tmp_path):
    city = read_map("montpellier-pas-du-loup")
    write_map(city, tmp_path / "a.tif")
    back = read_map(tmp_path / "a.tif")
    assert back.heights.tobytes() == city.heights.tobytes()
    assert back.attribution == city.attribution
    assert (back.origin, back.metres_per_pixel) == (city.origin, 2.0)
    with rasterio.open(tmp_path / "a.tif") as tif:
        bounds = rasterio.warp.transform_bounds(tif.crs, "EPSG:4326", *tif.bounds)
        assert tif.units == ("metre",)
        assert tif.compression.name == "deflate"
    middle = ((bounds[0] + bounds[2]) / 2, (bounds[1] + bounds[3]) / 2)
    assert middle == pytest.approx((3.848770, 43.598475), abs=1e-6)


def test_npy_and_png_are_written(tmp_path):
    city = read_map("villeurbanne-gratte-ciel")
    write_map(city, tmp_path / "a.npy")
    assert np.load(tmp_path / "a.npy").tobytes() == city.heights.tobytes()
    write_map(city, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        assert min(picture.size) >= 768
        assert picture.text["Copyright"] == city.attribution
    with pytest.raises(MapError, match="colour"):
        read_map(tmp_path / "a.png")


@pytest.mark.parametrize("name", ["a.jpg", "a", "no/such/folder/a.tif", "folder.tif"])
def test_where_no_map_is_written(tmp_path, name):
    (tmp_path / "folder.tif").mkdir()
    city = CityMap(blocks(), 2.0)
    with pytest.raises(MapError) as fault:
        write_map(city, tmp_path / name)
    if "folder" not in name:
        assert all(suffix in str(fault.value) for suffix in WRITERS)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.tif"]


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    (tmp_path / "a.npy").write_bytes(b"old")

    def break_off(city, path):
        path.write_bytes(b"half")
        raise OSError("No space left on device")

    monkeypatch.setitem(WRITERS, ".npy", break_off)
    with pytest.raises(MapError, match="No space left"):
        write_map(CityMap(blocks(), 2.0), tmp_path / "a.npy")
    assert [p.name for p in tmp_path.iterdir()] == ["a.npy"]
    assert (tmp_path / "a.npy").read_bytes() == b"old"


# ---------------------------------------------------------------- pictures


def lightness(colours):
    """L of CIELAB, from first principles, for sRGB in 0…255."""
    c = np.asarray(colours) / 255
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(luminance > 0.008856, 116 * np.cbrt(luminance) - 16, 903.3 * luminance)


@pytest.mark.parametrize("highest", [10, 40, 300])
def test_higher_is_darker_evenly(highest):
    light = lightness(ramp(np.linspace(2.0, highest, 9)[None], highest)[0])
    steps = -np.diff(light)
    assert (steps > 0).all()
    assert steps.max() < 2.5 * steps.min()
    assert (lightness(GROUND) - light[0]) > 5  # the lowest roof stands out from the ground


def test_colours_at_the_ends():
    colours = ramp(np.array([[0.0, 40.0, 400.0]], np.float32), 40)
    assert colours.dtype == np.uint8
    assert tuple(colours[0, 0]) == GROUND
    assert (colours[0, 1] == colours[0, 2]).all()


def test_one_tower_does_not_turn_the_rest_pale():
    heights = np.full((100, 100), 12, np.float32)
    assert scale_end(CityMap(heights, 2.0)) == 15
    heights[0, :4] = 540
    assert scale_end(CityMap(heights, 2.0)) == 15
    heights[0] = 540  # one of fifty of what is built
    assert scale_end(CityMap(heights[:60], 2.0)) == 15
    assert scale_end(CityMap(heights[:30], 2.0)) == 550
    assert scale_end(CityMap(np.zeros((4, 4)), 2.0)) == 10
    rng = np.random.default_rng(1)
    for count in (1, 2, 49, 50, 51, 1000):
        roofs = rng.choice([3.0, 9.0, 18.0, 40.0], count, p=[0.5, 0.4, 0.07, 0.03])
        usual, top = np.quantile(roofs, 0.98), roofs.max()
        end = max(10, 5 * np.ceil((usual if top > 2 * usual else top) / 5))
        assert roofs_end(roofs) == end


@pytest.mark.parametrize("shape", [(1, 1), (3, 50), (256, 256)])
@pytest.mark.parametrize("zoom", [1, 3])
def test_a_picture_shows_the_map_and_thanks_its_source(shape, zoom):
    heights = np.zeros(shape, np.float32)
    heights[: shape[0] // 2] = 25
    text = "© Somebody – édition 2021; " * 3
    city = CityMap(heights, 2.0, name="Ville d'été", attribution=text)
    bare = render(city, legend=False, zoom=zoom)
    assert bare.size == (shape[1] * zoom, shape[0] * zoom)
    full, silent = render(city, zoom=zoom), render(city.replace(heights, attribution=""), zoom=zoom)
    assert full.height > silent.height > bare.height
    dark = [(np.asarray(picture).sum(axis=2) < 600).sum() for picture in (full, silent)]
    assert dark[0] > dark[1]  # the attribution is printed
    assert (np.asarray(full)[0] == PAPER).all()


@pytest.mark.parametrize("name", [*cities(), None])
def test_the_copyright_of_a_geotiff_is_ascii(tmp_path, name):
    text = "© Ünë’s – é" if name is None else attribution_of(name)
    write_map(CityMap(np.ones((4, 4)), 2.0, attribution=text), tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as source:
        told = source.tags()
    assert told["ATTRIBUTION"] == text
    assert told["TIFFTAG_COPYRIGHT"].isascii()
    assert "?" not in told["TIFFTAG_COPYRIGHT"]
    assert ("(c)" in told["TIFFTAG_COPYRIGHT"]) == ("©" in text)
