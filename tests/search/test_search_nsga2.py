"""Ranking, crowding, selection and tournament against what they mean."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evocity.search.nsga2 import Hypervolume, ranks_and_crowding, select, tournament

LOSSES = st.integers(1, 4).flatmap(
    lambda m: st.integers(1, 14).flatmap(
        lambda n: arrays(float, (n, m), elements=st.integers(-3, 3).map(float))
    )
)


def naive_ranks(losses):
    """Peel off, front by front, what nothing left dominates."""
    ranks, front = np.full(len(losses), -1), 0
    while (ranks < 0).any():
        left = [i for i in range(len(losses)) if ranks[i] < 0]
        free = [
            i
            for i in left
            if not any(
                (losses[j] <= losses[i]).all() and (losses[j] < losses[i]).any() for j in left
            )
        ]
        ranks[free] = front
        front += 1
    return ranks


@given(LOSSES)
@settings(deadline=None)
def test_ranks_are_those_of_peeling(losses):
    assert ranks_and_crowding(losses)[0].tolist() == naive_ranks(losses).tolist()


@given(LOSSES, st.data())
@settings(deadline=None)
def test_selection_prefers_lower_fronts_and_keeps_the_extremes(losses, data):
    ids = data.draw(st.permutations(range(100, 100 + len(losses))))
    count = data.draw(st.integers(1, len(losses)))
    chosen = select(ids, losses, count)
    ranks = naive_ranks(losses)
    assert len(set(chosen.tolist())) == count
    assert sorted(ranks)[:count] == [ranks[i] for i in chosen]
    shuffled = np.random.default_rng(0).permutation(len(losses))
    again = select(np.array(ids)[shuffled], losses[shuffled], count)
    assert [ids[i] for i in chosen] == [np.array(ids)[shuffled][i] for i in again]


def better(one, other):
    """Deb's rule: (losses, violation) dominates another."""
    (a, broken), (b, worse) = one, other
    if broken != worse:
        return broken < worse
    return not broken and bool((a <= b).all() and (a < b).any())


@given(LOSSES, st.data())
@settings(deadline=None)
def test_constrained_domination_is_debs(losses, data):
    count = len(losses)
    violations = np.array(
        data.draw(st.lists(st.sampled_from([0, 0, 0.5, 2]), min_size=count, max_size=count))
    )
    ranks, _ = ranks_and_crowding(losses, violations)
    every = list(zip(losses, violations, strict=True))
    for i, one in enumerate(every):
        for j, other in enumerate(every):
            if better(one, other):
                assert ranks[i] < ranks[j]
    kept = violations == 0
    assert ranks[kept].tolist() == (naive_ranks(losses[kept]).tolist() if kept.any() else [])
    assert len(set(ranks.tolist())) == ranks.max() + 1
    chosen = select(range(count), losses, max(1, int(kept.sum())), violations)
    assert violations[chosen].all() if not kept.any() else not violations[chosen].any()


def test_crowding_is_debs():
    losses = np.array([[0.0, 4], [1, 3], [3, 1], [4, 0]])
    crowding = ranks_and_crowding(losses)[1]
    assert np.isinf(crowding[[0, 3]]).all()
    assert crowding[1:3] == pytest.approx([(3 / 4 + 3 / 4) / 2, (3 / 4 + 3 / 4) / 2])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_loss_that_is_not_finite_is_never_ranked(bad):
    with pytest.raises(ValueError, match="finite"):
        ranks_and_crowding(np.array([[1.0, 2.0], [bad, 0.0]]))


@given(st.integers(1, 9), st.integers(1, 4), st.integers(0, 99))
def test_parents_differ_while_they_can(n, count, seed):
    rng = np.random.default_rng(seed)
    chosen = tournament(range(n), np.zeros(n), np.zeros(n), count, rng)
    assert len(chosen) == count
    assert len(set(chosen)) == min(n, count)


def test_the_better_of_two_is_chosen_more_often():
    rng = np.random.default_rng(1)
    wins = [tournament([7, 8], [1, 0], [0.0, 0.0], 1, rng)[0] for _ in range(400)]
    assert 0.7 < np.mean(wins) < 0.8  # both drawn twice: 3 in 4


@given(LOSSES.filter(lambda losses: losses.shape[1] < 4))
@settings(deadline=None)
def test_hypervolume_grows_with_what_is_not_dominated(losses):
    measure = Hypervolume(losses)
    volume = measure(losses)
    assert volume >= measure(losses[:1]) - 1e-12
    assert measure(np.vstack([losses, losses.min(axis=0) - 1])) > volume


def test_hypervolume_of_a_square():
    first = np.array([[0.0, 20.0], [2.0, 10.0]])
    assert Hypervolume(first)(np.array([[1.0, 15.0]])) == pytest.approx(0.6 * 0.6)
