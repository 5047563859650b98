"""Maps below the zoom that range blocks allow."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import evocity
from evocity.coding.zoom import area_means, most_common


@given(
    st.integers(1, 20),
    st.integers(1, 20),
    st.sampled_from([1.0, 1.25, 1.5, 2.0, 3.0, 7.5]),
    st.integers(0, 2**32 - 1),
)
def test_most_common_is_a_value_of_the_square(height, width, step, seed):
    raster = np.random.default_rng(seed).integers(0, 3, (height, width)).astype(np.float32)
    found = most_common(raster, step)
    assert found.shape == area_means(raster, step).shape
    assert found.dtype == raster.dtype
    for (row, column), value in np.ndenumerate(found):
        rows = slice(int(row * step), int(np.ceil((row + 1) * step)))
        columns = slice(int(column * step), int(np.ceil((column + 1) * step)))
        assert value in raster[rows, columns]
    if step == 1:
        assert np.array_equal(found, raster)


def test_most_common_of_whole_squares():
    raster = np.array([[1, 1, 5, 6], [1, 2, 6, 6], [3, 4, 7, 8], [4, 3, 8, 7]], np.float32)
    assert most_common(raster, 2).tolist() == [[1, 6], [3, 7]]  # even: the north-western


def test_settled_roofs_stay_whole_below_the_least_zoom(town):
    code = evocity.encode(town).genome
    whole, half = (evocity.decode(code, zoom=zoom) for zoom in (1, 0.5))
    assert set(np.unique(half.city.heights)) <= set(np.unique(whole.city.heights))
    assert len(half.city.buildings) <= len(whole.city.buildings)
    means = area_means(whole.attractor, 2)
    assert np.allclose(half.attractor, means)
