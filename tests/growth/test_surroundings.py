"""The strip around a map of grown fabric, in which buildings at the border are whole."""

import numpy as np
import pytest

from evocity.citymap import CityMap
from evocity.growth import surroundings
from evocity.growth.surroundings import are_whole, map_with_margin


def test_chains_of_buildings_that_reach_into_the_map_end_in_the_strip():
    built = np.zeros((60, 60), bool)
    assert are_whole(built, 20)
    built[2:8, 2:50] = True  # never on the map
    built[25:30, 10:30] = True
    assert are_whole(built, 20)
    built[30:34, 4:10] = True  # touches by a corner
    assert are_whole(built, 20)
    built[33, 3] = True  # within 4 px of the outer border
    assert not are_whole(built, 20)
    assert are_whole(np.zeros((60, 60), bool), 20)


@pytest.mark.parametrize(("length", "margin"), [(100, 128), (140, 256), (250, 256), (900, 512)])
def test_the_strip_is_as_wide_as_the_longest_chain_needs(length, margin):
    class Straight:
        """A fabric with a wall to the east."""

        shape = (32, 32)

        def city(self, top, left, height, width):
            heights = np.zeros((height, width), np.float32)
            heights[-top + 10 : -top + 14, -left + 20 : -left + 32 + length] = 9
            return CityMap(heights, 2.0)

    city, found = map_with_margin(Straight())
    assert found == margin
    assert city.shape == (32 + 2 * margin,) * 2
    assert surroundings.MARGINS == (128, 256, 512)
