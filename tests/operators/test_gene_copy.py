"""Gene copy: what a copy is, where it may go, and what its rate says."""

import numpy as np
import pytest
from codes import stones
from hypothesis import given, settings
from hypothesis import strategies as st
from rearranged import ODD, assert_genes_stay_as_they_are, assert_laws, assert_meant, odd_maps, town

from evocity.errors import OperatorError
from evocity.operators.rearrangements import GeneCopy

ANYWHERE = GeneCopy(rate=1, group=1, tolerance=None, change=0, choice=1, repair=None)


@pytest.mark.parametrize("operator", [GeneCopy(rate=0.3), GeneCopy(group=1), ANYWHERE], ids=str)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, seed):
    assert_laws(operator, town(), seed)
    draft = operator.draft([town()], np.random.default_rng(seed))
    assert_genes_stay_as_they_are(town(), draft.genome)
    assert_meant(town(), draft)


def test_rate_of_nothing_and_of_all():
    parent = town()
    assert GeneCopy(rate=0)([parent], np.random.default_rng(0)) == parent
    child = ANYWHERE([parent], np.random.default_rng(0))
    assert child.made["copied"] == len(parent)
    assert (stones(child) != np.arange(len(parent))).mean() > 0.99  # a copy may be copied back
    assert len(np.unique(stones(child))) < 0.7 * len(parent)


@pytest.mark.parametrize("rate", [0.1, 0.5])
def test_rate_is_the_share_of_groups_replaced(rate):
    operator = GeneCopy(rate=rate, group=2, tolerance=None, change=0, repair=None)
    made = [operator([town()], np.random.default_rng(s)).made["copied"] for s in range(20)]
    assert np.mean(made) == pytest.approx(rate * 60, rel=0.2)  # 8 × 8 groups, or 7 on a side


def test_groups_are_copied_whole():
    operator = GeneCopy(rate=0.2, group=4, tolerance=None, change=0, repair=None)
    child = operator([town()], np.random.default_rng(2))
    row, column = np.divmod(stones(child), 16)
    down, along = row - np.arange(256) // 16, column - np.arange(256) % 16
    moved = ((down != 0) | (along != 0)).reshape(16, 16)
    assert moved.sum() == 16 * child.made["copied"]
    offsets = np.stack([down, along], axis=-1).reshape(16, 16, 2)
    corner = np.argwhere(moved)[0]
    group = offsets[corner[0] : corner[0] + 4, corner[1] : corner[1] + 4].reshape(-1, 2)
    assert (group == group[0]).all()


def test_admissible_copies_alone_are_made():
    parent, rng = town(), np.random.default_rng
    loose = GeneCopy(rate=1, tolerance=None, change=0).draft([parent], rng(0)).made
    strict = GeneCopy(rate=1, tolerance=0.01, change=2.0).draft([parent], rng(0)).made
    assert strict["copied"] < loose["copied"]
    none = GeneCopy(rate=1, change=1000.0)([parent], rng(0))
    assert none == parent
    assert none.made["copied"] == 0


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("group", [1, 4, 99])
def test_ends_well_on_any_map(name, group):
    child = assert_laws(GeneCopy(rate=1, group=group), odd_maps()[name], 0)
    if name in ("empty", "one roof"):
        assert child.made["copied"] == 0


def test_faults_are_told():
    with pytest.raises(OperatorError, match="rate = 2, group = 0, choice = 0"):
        GeneCopy(rate=2, group=0, choice=0)
