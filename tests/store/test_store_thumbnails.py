"""Thumbnails against an obvious twin, and what of them is taken from a stranger's file."""

import json

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from evocity.citymap import CityMap
from evocity.store import Header, Thumbnails
from evocity.store.thumbnails import _sums

SIDES = st.integers(1, 40)


@given(st.data(), st.integers(2, 9), SIDES, SIDES)
def test_a_thumbnail_has_the_mean_heights_of_its_cells(data, pixels, height, width):
    values = st.floats(0, 60, width=32)
    heights = data.draw(arrays.arrays(np.float32, (height, width), elements=values))
    made = Thumbnails(pixels, 40.0)
    content = made.packed(CityMap(heights, 2.0))
    small = made.unpacked(content, height, width, 2.0)
    means = naive.cell_means(heights, pixels)
    assert len(content) == means.size
    assert small.shape == means.shape == made.shape(height, width)
    assert small.metres_per_pixel == 2.0 * pixels
    assert np.abs(small.heights - np.minimum(means, 40.0)).max() <= 40 / 255 / 2 + 1e-4


@given(st.integers(1, 5000), st.integers(1, 5000))
def test_large_maps_have_thumbnails_of_at_most_128_cells(height, width):
    made = Thumbnails.of(height, width, 30.0)
    if max(height, width) <= 128:
        assert made is None
    else:
        longer = max(made.shape(height, width))
        assert 64 < longer <= 128


def header(**told) -> Header:
    of = 256, 192, 2.0, 0.9, ("town",), "", None, None, 7, 2, "hash", ("gsi",)
    return Header(*of, **told)


def test_a_header_tells_how_they_are_made():
    with_them = header(thumbnails=Thumbnails(2, 40.0))
    assert (with_them.schema_version, header().schema_version) == (10, 3)
    assert Header.from_json(with_them.to_json(), "run") == with_them
    assert "thumbnails" not in json.loads(header().to_json())


@pytest.mark.parametrize(
    "told",
    [
        {"pixels": 1, "metres": 40.0},
        {"pixels": 2, "metres": 0.0},
        {"pixels": 2, "metres": float("inf")},
        {"pixels": 2, "metres": float("nan")},
        {"pixels": 2, "metres": 1e300},
        {"pixels": "2", "metres": 40.0},
        {"pixels": 2},
        {"pixels": 2, "metres": 40.0, "more": 1},
        [2, 40.0],
        None,
    ],
)
def test_a_strange_header_is_refused(told):
    about = json.loads(header(thumbnails=Thumbnails(2, 40.0)).to_json())
    with pytest.raises(ValueError):
        Header.from_json(json.dumps(about | {"thumbnails": told}), "run")


def test_thumbnails_that_are_no_small_maps_are_refused():
    about = json.loads(header(thumbnails=Thumbnails(2, 40.0)).to_json())
    about |= {"height": 4096, "width": 4096}
    with pytest.raises(ValueError, match="thumbnails of 2048 × 2048 cells"):
        Header.from_json(json.dumps(about), "run")


@given(st.integers(2, 10), st.integers(1, 12), st.integers(1, 12), st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_sums_have_the_bits_of_numpys(step, rows, columns, seed):
    rng = np.random.default_rng(seed)
    size = (step * rows + seed % 2, step * columns)
    heights = rng.uniform(0, 30, size).astype(np.float32)
    for axis in (0, 1):
        expected = np.add.reduceat(heights, np.arange(0, size[axis], step), axis=axis)
        assert np.array_equal(_sums(heights, step, axis), expected)
