"""Macro-blocks that a user draws: the first parent is the base, the second fills what is drawn."""

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity.errors import OperatorError
from evocity.operators import make
from evocity.operators.pavement_fusion import PavementFusion
from evocity.operators.region_fusion import RegionFusion


@settings(deadline=None, max_examples=15)
@given(
    st.sets(st.tuples(st.integers(0, 7), st.integers(0, 7)), max_size=64),
    st.sampled_from([PavementFusion, RegionFusion]),
)
def test_drawn_macro_blocks_may_cover_the_whole_map(corners, kind):
    """Each drawn block is of the second parent, also beyond half of the map."""
    parents = [uniformly(draw_town(seed, side=64)).genome for seed in (21, 22)]
    drawn = {"side_min": 16.0, "side_max": 16.0, "margin": 0.0, "tolerance": 1000.0}
    places = [(16.0 * row, 16.0 * column) for row, column in sorted(corners)]
    rng = np.random.default_rng(1)
    if kind is RegionFusion:
        child = kind(**drawn, places=places, fill=1.0, base=1, tries=None, repair=None)(
            parents, rng
        )
        assert child.made["fill_reached"][1] <= 1
        return
    child = kind(**drawn, places=places, fill=1.0, base=1, repair=None)(parents, rng)
    expected = np.zeros((16, 16), bool)
    for row, column in corners:
        expected[2 * row : 2 * row + 2, 2 * column : 2 * column + 2] = True
    assert np.array_equal((child.parent == 1).reshape(16, 16), expected)
    assert child.made["fill_reached"][1] == pytest.approx(expected.mean(), abs=1e-4)
    if expected.mean() <= 0.5:  # as without a base
        half = kind(**drawn, places=places, fill=0.5, repair=None)(parents, rng)
        assert half == child


@pytest.mark.parametrize("base", [0, 3, 1.5])
def test_the_base_is_a_parent(base):
    parents = [uniformly(draw_town(seed, side=64)).genome for seed in (21, 22)]
    with pytest.raises(OperatorError, match="base"):
        make("pavement_fusion", base=base)(parents, np.random.default_rng(0))
