"""Fixtures that many tests share."""

import pytest
from towns import draw_town

from evocity.citymap import CityMap


@pytest.fixture(scope="session")
def town() -> CityMap:
    return draw_town(1)


@pytest.fixture(scope="session")
def other_town() -> CityMap:
    return draw_town(2)
