"""Shadows of pictures."""

import numpy as np
import pytest
from scipy import ndimage

from evocity.pictures.light import blur


@pytest.mark.parametrize("shape", [(7, 5), (1, 9), (3, 40), (96, 64)])
@pytest.mark.parametrize("sigma", [0.6, 0.6 * 2**0.5, 1.2])
def test_shadows_are_softened_by_scipys_gaussian(shape, sigma):
    depth = np.random.default_rng(3).random(shape, np.float32) * 30
    soft = blur(depth, sigma)
    assert soft.dtype == np.float32
    np.testing.assert_allclose(soft, ndimage.gaussian_filter(depth, sigma), rtol=1e-6)
