"""A small town's code, and fabric grown of it, that all tests of growth may use."""

import numpy as np
import pytest
from codes import uniformly
from towns import draw_town

from evocity.growth import grow


@pytest.fixture(scope="module")
def code():
    return uniformly(draw_town(1, side=96, buildings=90)).genome


@pytest.fixture(scope="module")
def fabric(code):
    return grow(code, 200, 264, np.random.default_rng(5))
