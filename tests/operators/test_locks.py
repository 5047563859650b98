"""What parents condense stands in every child, pixel for pixel, whatever the operator does."""

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from test_breeding_laws import VARIANTS, parents_for, renews
from towns import draw_town

from evocity.coding import decode
from evocity.condensation import Condensation, merged
from evocity.operators import LambdaCrossover, PavementFusion
from evocity.operators.crossover import Draft, Drafting


def quarter(seed: int, rows: slice, columns: slice) -> Condensation:
    city = draw_town(seed)
    mask = np.zeros(city.shape, bool)
    mask[rows, columns] = True
    return Condensation.cut(city, mask)


#: Two quarters that overlap, each of another town.
FIRST = quarter(7, slice(9, 39), slice(20, 53))
SECOND = quarter(8, slice(30, 50), slice(5, 30))


@pytest.fixture(scope="module")
def locked():
    return [uniformly(draw_town(seed), condensation=FIRST).genome for seed in (1, 2, 3)]


def kept(child, layer: Condensation) -> bool:
    heights = decode(child).city.heights
    return np.array_equal(heights[layer.mask], layer.heights[layer.mask])


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
@settings(max_examples=3, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_every_operator_keeps_what_its_parents_keep(operator, locked, seed):
    child = operator(parents_for(operator, locked), np.random.default_rng(seed))
    assert child.condensation == FIRST
    assert kept(child, FIRST)


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
def test_what_is_meant_to_be_laid_has_it_in_place(operator, locked):
    draft = operator.draft(parents_for(operator, locked), np.random.default_rng(3))
    assert np.array_equal(draft.intended[FIRST.mask], FIRST.heights[FIRST.mask])
    assert draft.intended.dtype == np.float32


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
def test_a_locked_city_bred_with_itself_gives_itself(operator, locked):
    if renews(operator):
        pytest.skip("changes a lone parent by design")
    child = operator([locked[0]] * operator.parents[0], np.random.default_rng(0))
    assert child == locked[0]


@pytest.mark.parametrize("operator", [PavementFusion(), LambdaCrossover(blend=0.5)], ids=str)
def test_a_child_keeps_what_any_parent_keeps_and_the_first_wins(operator, locked):
    second = uniformly(draw_town(2), condensation=SECOND).genome
    bare = uniformly(draw_town(3)).genome
    both = FIRST.over(SECOND)
    assert both != SECOND.over(FIRST)
    parents = [locked[0], second]
    for found, expected in (
        (parents, both),
        (parents[::-1], SECOND.over(FIRST)),
        ([bare, second], SECOND),
        ([second, bare], SECOND),
    ):
        child = operator(found, np.random.default_rng(1))
        assert child.condensation == expected
        assert kept(child, expected)
    assert merged(parent.condensation for parent in parents) == both


def test_bare_parents_have_bare_children(locked):
    bare = [genome.replace(condensation=None) for genome in locked]
    for operator in VARIANTS:
        child = operator(parents_for(operator, bare), np.random.default_rng(0))
        assert child.condensation is None


def test_an_operator_that_forgets_it_is_reminded(locked):
    class Forgetful(Drafting):
        name, parents, repair = "forgetful", (1, 1), None

        def _draft(self, parents, rng):
            child = parents[0].replace(condensation=None, beta=parents[0].beta + 5)
            return Draft(child, np.zeros((64, 64), np.float32), {})

    child = Forgetful()(locked[:1], np.random.default_rng(0))
    assert kept(child, FIRST)
    meant = Forgetful().draft(locked[:1], np.random.default_rng(0)).intended
    assert np.array_equal(meant, FIRST.heights)
