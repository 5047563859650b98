"""The structure of the gradient against SciPy's filters, and on walls of known direction."""

import numpy as np
import pytest
from scipy import ndimage
from towns import draw_town

from evocity.citymap import CityMap
from evocity.views.orientation import structure


def binomial(field, passes):
    kernel = np.array([1.0])
    for _ in range(passes):
        kernel = np.convolve(kernel, [0.5, 0.5])
    along = ndimage.correlate1d(field.astype(np.float64), kernel, axis=0, mode="nearest")
    return ndimage.correlate1d(along, kernel, axis=1, mode="nearest")


@pytest.mark.parametrize("shape", [(64, 64), (61, 38), (3, 7), (1, 1)])
def test_it_is_the_smoothed_square_of_the_smoothed_gradient(shape):
    city = CityMap(draw_town(5).heights[: shape[0], : shape[1]], 2.0)
    dy, dx = (binomial(field, 8) for field in city.gradients)
    square = (dx + 1j * dy) ** 2
    expected = np.stack([binomial(square.real, 8), binomial(square.imag, 8)])
    assert city.structure == pytest.approx(expected, abs=1e-6 * np.abs(expected).max() + 1e-9)
    assert city.structure.dtype == np.float32


@pytest.mark.parametrize("degrees", [0, 10, 22.5, 45, 60, 90, 120, 175])
def test_its_angle_is_twice_that_of_the_gradient_of_a_wall(degrees):
    """A wall whose gradient points ``degrees`` from east towards south, drawn in pixels."""
    y, x = np.mgrid[:128, :128] - 63.5
    angle = np.radians(degrees)
    city = CityMap(9 * (x * np.cos(angle) + y * np.sin(angle) > 0.1), 2.0)
    real, imaginary = city.structure[:, 32:-32, 32:-32].sum(axis=(1, 2), dtype=float)
    found = np.degrees(np.arctan2(imaginary, real)) / 2
    assert (found - degrees + 90) % 180 - 90 == pytest.approx(0, abs=0.3)


def test_it_leaves_what_it_is_given(town):
    before = [field.copy() for field in town.gradients]
    structure(*town.gradients)
    assert all(np.array_equal(*pair) for pair in zip(before, town.gradients, strict=True))
    with pytest.raises(ValueError, match="read-only"):
        town.structure[0] = 0
    assert town.structure is town.structure
