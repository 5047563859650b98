"""What of a mask hangs together, and what lies beside it: as SciPy has both."""

import numpy as np
import pytest
from scipy import ndimage

from evocity.views.connected_components import dilate, pieces

AROUND = {False: ndimage.generate_binary_structure(2, 1), True: np.ones((3, 3), bool)}


def masks():
    rng = np.random.default_rng(7)
    for shape in [(0, 0), (1, 1), (1, 9), (9, 1), (5, 7), (64, 64)]:
        yield from (rng.random(shape) < share for share in (0, 0.2, 0.45, 0.6, 0.8, 1))
    comb = np.zeros((6, 12), bool)  # teeth that only the last row joins
    comb[:, ::2] = comb[-1] = True
    yield from (comb, comb.T, comb[::-1], ~comb, comb[:, ::3])


@pytest.mark.parametrize("corners", [False, True])
def test_pieces_and_their_order_are_those_of_scipy(corners):
    for mask in masks():
        labels, count = pieces(mask, corners=corners)
        expected, number = ndimage.label(mask, AROUND[corners])
        assert count == number
        assert labels.dtype == np.int32
        np.testing.assert_array_equal(labels, expected)


@pytest.mark.parametrize("corners", [False, True])
def test_a_mask_is_widened_as_scipy_does(corners):
    for mask in masks():
        expected = ndimage.binary_dilation(mask, AROUND[corners])
        np.testing.assert_array_equal(dilate(mask, corners=corners), expected)
