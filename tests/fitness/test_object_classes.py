"""Measures of classes: shares of what stands there, and how many a hectare."""

import math

import numpy as np
import pytest
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.fitness import object_classes, object_counts
from evocity.fitness.types import CLASSES


def park():
    """A hectare: a house of 10 m × 9 m, a lawn of 40 m × 20 m, three lamps."""
    heights = np.zeros((100, 100))
    heights[5:14, 5:15] = 7
    heights[40:60, 30:70] = 0.2
    heights[80:82, 20:80:20] = heights[80:82, 21:80:20] = 6
    return CityMap(heights, 1.0, name="park")


def test_shares_are_of_what_stands_there():
    shares = object_classes(park())
    assert shares["ground"] == pytest.approx(800 / 902)
    assert shares["building"] == pytest.approx(90 / 902)
    assert shares["post"] == pytest.approx(12 / 902)
    assert sum(shares.values()) == pytest.approx(1)


def test_counts_are_a_hectare():
    assert object_counts(park()) == dict.fromkeys(CLASSES, 0.0) | {
        "building": 1.0,
        "ground": 1.0,
        "post": 3.0,
    }
    doubled = np.zeros((200, 100))
    doubled[:100] = park().heights
    assert object_counts(CityMap(doubled, 1.0))["post"] == 1.5


def test_an_empty_map_has_no_shares_and_no_objects():
    empty = CityMap(np.zeros((8, 8)), 2.0, name="empty")
    for share in object_classes(empty).values():
        assert math.isnan(share)
        assert "nothing stands" in share.reason
    assert set(object_counts(empty).values()) == {0.0}


def test_a_part_counts_what_is_its_own():
    west = park().within(np.arange(100)[None, :] < np.full((100, 1), 50))
    assert object_counts(west)["building"] == 2.0  # of half a hectare
    assert object_counts(west)["post"] == 4.0


def test_a_town_of_boxes_is_buildings():
    assert object_classes(draw_town(1))["building"] > 0.98


@pytest.mark.parametrize("name", evocity.cities())
def test_the_districts_are_buildings(name):
    shares = object_classes(evocity.read_map(name))
    assert shares["building"] + shares["shelter"] > 0.995
