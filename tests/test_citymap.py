import copy
import pickle

import numpy as np
import pytest
from scipy import ndimage

from evocity.citymap import BUILT_ABOVE, CityMap, same_grid
from evocity.errors import MapError


@pytest.mark.parametrize(
    ("heights", "word"),
    [
        (np.zeros(5), "shape"),
        ([["a"]], "shape"),
        (np.zeros((0, 5)), "shape"),
        (np.full((4, 4), np.nan), "NaN"),
        (np.full((4, 4), np.inf), "infinite"),
        (np.full((4, 4), -1.0), "below ground"),
    ],
)
def test_heights_that_are_no_map_are_refused(heights, word):
    with pytest.raises(MapError, match=word):
        CityMap(heights, 2.0)


@pytest.mark.parametrize("pixel", [0, -1, np.nan, np.inf, "2", None])
def test_pixel_size_must_be_positive(pixel):
    with pytest.raises(MapError, match="metres_per_pixel"):
        CityMap(np.zeros((4, 4)), pixel)


def test_a_map_is_a_read_only_copy(town):
    source = np.ones((4, 4))
    city = CityMap(source, 1.0)
    source[:] = 9
    assert city.heights.max() == 1
    for view in (town.heights, town.built, town.labels, town.areas, *town.gradients):
        with pytest.raises(ValueError, match="read-only"):
            view[0] = 0


def test_views_are_computed_once(town):
    assert town.labels is town.labels
    assert town.gradients is town.gradients


def test_areas_sum_to_the_built_area(town):
    assert town.areas.sum() == pytest.approx(town.built.sum() * town.metres_per_pixel**2)
    assert town.labels.max() == town.areas.size
    assert np.array_equal(town.labels > 0, town.built)


def test_corners_do_not_join_components():
    city = CityMap(np.eye(3) * 10, 1.0)
    assert city.areas.tolist() == [1, 1, 1]


def test_traces_are_not_built():
    city = CityMap([[0, BUILT_ABOVE, BUILT_ABOVE + 0.01]], 1.0)
    assert city.built.tolist() == [[False, False, True]]


def test_gradients_of_a_plane_and_oracle_of_scipy():
    y, x = np.mgrid[:12, :10]
    city = CityMap(3 * y + 2 * x, 2.0)
    along_y, along_x = city.gradients
    assert along_y[1:-1, 1:-1] == pytest.approx(1.5)
    assert along_x[1:-1, 1:-1] == pytest.approx(1.0)
    heights = np.random.default_rng(0).random((9, 9)) * 20
    ours = CityMap(heights, 1.0).gradients[1]
    scharr = np.array([[-3, 0, 3], [-10, 0, 10], [-3, 0, 3]]) / 32
    assert ours == pytest.approx(ndimage.correlate(heights, scharr, mode="nearest"), abs=1e-5)


def test_replace_keeps_the_description(town):
    other = town.replace(town.heights + 1, name="raised")
    assert (other.name, other.attribution) == ("raised", town.attribution)
    assert other.metres_per_pixel == town.metres_per_pixel


def test_maps_of_different_grids_are_told_apart(town):
    same_grid([town, town])
    with pytest.raises(MapError, match="32 × 32"):
        same_grid([town, CityMap(np.zeros((32, 32)), 2.0)])


def test_copies_of_a_map_are_read_only_too():
    city = CityMap(np.full((4, 4), 9.0), 2.0, name="a", height_rules={"height": 3}, origin=(1, 2))
    _ = city.labels  # a view, computed
    for other in (copy.copy(city), copy.deepcopy(city), pickle.loads(pickle.dumps(city))):
        for array in (other.heights, other.built, other.labels):
            assert not array.flags.writeable
        assert np.array_equal(other.heights, city.heights)
        described = ("metres_per_pixel", "name", "attribution", "origin", "crs", "height_rules")
        assert all(getattr(other, key) == getattr(city, key) for key in described)
        with pytest.raises(AttributeError):
            other.name = "b"
