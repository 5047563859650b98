"""Where a child lies on Earth: where its parents lie, if all lie in one place, else nowhere."""

import numpy as np
import pytest
from codes import uniformly
from towns import draw_town

from evocity.coding import decode
from evocity.operators import OPERATORS, make

PLACES = ((651_000.0, 6_862_000.0), (770_000.0, 6_279_000.0))


@pytest.mark.parametrize("name", sorted(OPERATORS))
@pytest.mark.parametrize("same", [True, False])
def test_a_child_of_two_towns_lies_nowhere(name, same):
    operator = make(name)
    places = (PLACES[0],) * 2 if same else PLACES
    parents = [
        uniformly(draw_town(seed, side=32)).genome.replace(origin=place, crs="EPSG:2154")
        for seed, place in zip((1, 2), places, strict=True)
    ]
    child = operator(parents[: operator.parents[0]], np.random.default_rng(0))
    alone = same or operator.parents[0] == 1
    city = decode(child).city
    assert (city.origin, city.crs) == ((PLACES[0], "EPSG:2154") if alone else (None, None))
