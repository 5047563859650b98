"""The papers' robustness cases: parents that are no cities, or towns that have nothing alike."""

import numpy as np
import pytest
from codes import uniformly
from skimage.data import camera
from towns import draw_town

from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.operators.content_fusion import AsymmetricFusion, SymmetricFusion
from evocity.operators.lambda_crossover import Interpolation
from evocity.operators.pavement_fusion import DirectFusion
from evocity.towns.patterns import chessboard_town, concentric_town

SIDE = 64
OPERATORS = [
    Interpolation(),
    Interpolation(repair=None),
    Interpolation(stepwise=True),
    Interpolation(stepwise=True, repair=None),
    DirectFusion(),
    DirectFusion(repair=None),
    AsymmetricFusion(),
    AsymmetricFusion(repair=None),
    AsymmetricFusion(isometries=True, alike=1.0),
    SymmetricFusion(),
    SymmetricFusion(choose=False, isometries=True, repair=None),
]


def photograph() -> CityMap:
    """A picture of no city at all: hardly a level block, and no two alike."""
    brightness = camera().reshape(SIDE, 512 // SIDE, SIDE, 512 // SIDE).mean(axis=(1, 3))
    return CityMap((255 - brightness) / 255 * 30, 2.0, name="photograph")


def circles() -> CityMap:
    y, x = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
    return CityMap(15.0 * (np.hypot(y, x) % 10 < 5), 2.0, name="circles")


def chessboard(square: int) -> CityMap:
    """Blocks alike by the hundred; squares that do not fit the range blocks."""
    y, x = np.mgrid[:SIDE, :SIDE] // square
    return CityMap(15.0 * ((y + x) % 2), 2.0, name=f"chessboard of {square}")


PAIRS = {
    "photograph and town": lambda: (photograph(), draw_town(1)),
    "circles and chessboard": lambda: (circles(), chessboard(5)),
    "chessboards": lambda: (chessboard(3), chessboard(7)),
    "concentric and chessboard town": lambda: (concentric_town(SIDE), chessboard_town(SIDE)),
}


@pytest.fixture(scope="module", params=PAIRS)
def parents(request):
    return [uniformly(city).genome for city in PAIRS[request.param]()]


@pytest.mark.parametrize("operator", OPERATORS, ids=str)
def test_every_child_decodes(parents, operator):
    highest = max(decode(parent).city.heights.max() for parent in parents)
    for order in (parents, parents[::-1]):
        child = operator(order, np.random.default_rng(0))
        decoding = decode(child)
        assert decoding.converged
        assert 0 < decoding.city.heights.max() < 3 * highest
        assert child.made["operator"] == operator.name
