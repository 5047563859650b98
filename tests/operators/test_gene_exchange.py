"""Gene exchange: two by two, once at most, and no gene is lost."""

import numpy as np
import pytest
from codes import stones
from hypothesis import given, settings
from hypothesis import strategies as st
from rearranged import ODD, assert_genes_stay_as_they_are, assert_laws, assert_meant, odd_maps, town

from evocity.errors import OperatorError
from evocity.operators.rearrangements import GeneExchange

ANY_TWO = GeneExchange(rate=1, group=1, tolerance=None, change=0, choice=1, repair=None)


@pytest.mark.parametrize(
    "operator", [GeneExchange(rate=0.3), GeneExchange(group=1), ANY_TWO], ids=str
)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, seed):
    parent = town()
    child = assert_laws(operator, parent, seed)
    assert np.array_equal(np.sort(stones(child)), np.arange(len(parent)))
    assert np.array_equal(stones(child)[stones(child)], np.arange(len(parent)))  # two by two
    assert np.count_nonzero(stones(child) != np.arange(len(parent))) == (
        child.made["exchanged"] * (operator.group or 4) ** 2  # 32 m
    )
    draft = operator.draft([parent], np.random.default_rng(seed))
    assert_genes_stay_as_they_are(parent, draft.genome)
    assert_meant(parent, draft)


def test_rate_of_nothing_and_of_all():
    parent = town()
    assert GeneExchange(rate=0)([parent], np.random.default_rng(0)) == parent
    # about as many lead as follow; ground for ground is no exchange
    assert ANY_TWO([parent], np.random.default_rng(0)).made["exchanged"] > 0.85 * len(parent)


@pytest.mark.parametrize("rate", [0.1, 0.5])
def test_rate_is_the_share_of_groups_that_change_places(rate):
    operator = GeneExchange(rate=rate, group=1, tolerance=None, change=0, repair=None)
    made = [operator([town()], np.random.default_rng(s)).made["exchanged"] for s in range(20)]
    assert np.mean(made) == pytest.approx(rate * 256, rel=0.1)


def test_admissible_partners_alone_are_taken():
    parent, rng = town(), np.random.default_rng
    strict = GeneExchange(rate=1, tolerance=0.01, change=2.0).draft([parent], rng(0)).made
    loose = GeneExchange(rate=1, tolerance=None, change=0).draft([parent], rng(0)).made
    assert strict["exchanged"] < loose["exchanged"]
    assert GeneExchange(rate=1, change=1000.0)([parent], rng(0)) == parent


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("group", [1, 4, 99])
def test_ends_well_on_any_map(name, group):
    child = assert_laws(GeneExchange(rate=1, group=group), odd_maps()[name], 0)
    no_room = group == 99 and name != "narrow"
    if name in ("empty", "one roof") or no_room:
        assert child.made["exchanged"] == 0


def test_faults_are_told():
    with pytest.raises(OperatorError, match="rate = -1, group = 0"):
        GeneExchange(rate=-1, group=0)
