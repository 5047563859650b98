"""Ranks, crowding, contributions and hypervolume against what they mean."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evocity.selection.backends.moocore import contributions, hypervolume, least_first
from evocity.selection.fronts import Hypervolume, Scale, crowding_of, ranks_of, volume_is_quick

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
    assert ranks_of(losses).tolist() == naive_ranks(losses).tolist()


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
    ranks = ranks_of(losses, violations)
    every = list(zip(losses, violations, strict=True))
    for i, one in enumerate(every):
        for j, other in enumerate(every):
            if better(one, other):
                assert ranks[i] < ranks[j]
    kept = violations == 0
    assert ranks[kept].tolist() == (naive_ranks(losses[kept]).tolist() if kept.any() else [])
    assert len(set(ranks.tolist())) == ranks.max() + 1


def test_crowding_is_debs():
    losses = np.array([[0.0, 4], [1, 3], [3, 1], [4, 0]])
    crowding = crowding_of(losses, ranks_of(losses))
    assert np.isinf(crowding[[0, 3]]).all()
    assert crowding[1:3] == pytest.approx([(3 / 4 + 3 / 4) / 2, (3 / 4 + 3 / 4) / 2])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_loss_that_is_not_finite_is_never_ranked(bad):
    with pytest.raises(ValueError, match="finite"):
        ranks_of(np.array([[1.0, 2.0], [bad, 0.0]]))


FRONTS = LOSSES.filter(lambda losses: len(losses) > 1).map(
    lambda losses: losses[ranks_of(losses) == 0]
)


@given(FRONTS)
@settings(deadline=None)
def test_contributions_are_what_is_lost_without_one(front):
    scale = Scale(front)
    scaled, reference = scale(front), scale.reference
    whole = hypervolume(scaled, reference)
    for row, found in enumerate(contributions(scaled, reference)):
        others = np.delete(scaled, row, axis=0)
        left = hypervolume(others, reference) if len(others) else 0.0
        assert found == pytest.approx(whole - left, abs=1e-9)


@given(FRONTS, st.data())
@settings(deadline=None)
def test_the_least_contributor_goes_first(front, data):
    """Against contributions measured anew for each that is dropped."""
    scale, count = Scale(front), data.draw(st.integers(0, len(front)))
    scaled, reference = scale(front), scale.reference
    dropped, found = least_first(scaled, reference, count)
    left = list(range(len(front)))
    for row in dropped.tolist():
        known = dict(zip(left, contributions(scaled[left], reference), strict=True))
        assert known[row] == pytest.approx(min(known.values()), abs=1e-9)
        assert found[row] == pytest.approx(known[row], abs=1e-9)
        left.remove(row)
    if left:
        assert found[left] == pytest.approx(contributions(scaled[left], reference), abs=1e-9)


@given(st.integers(0, 2**32), st.integers(1, 60), st.sampled_from(["wide", "coarse", "bent"]))
@settings(deadline=None)
def test_of_two_losses_all_is_as_if_measured_by_the_library(seed, count, kind):
    """To the bit, so that ties end alike."""
    rng = np.random.default_rng(seed)
    losses = rng.random((count, 2)) * [1e-9, 1e12]
    if kind == "coarse":
        losses = rng.integers(0, 9, (count, 2)).astype(float)
    elif kind == "bent":
        losses[:, 1] = (1 - losses[:, 0] / 1e-9) ** 3
        losses = np.concatenate([losses, losses[: count // 3]])
    ranks = ranks_of(losses)
    for rank in np.unique(ranks):
        front = losses[ranks == rank]
        scaled, reference = Scale(front)(front), Scale(front).reference
        dropping = int(rng.integers(len(front) + 1))
        dropped, known = least_first(scaled, reference, dropping)
        expected = naive.least_first(scaled, reference, dropping)
        assert (dropped.tolist(), known.tolist()) == (expected[0], expected[1].tolist())


def test_of_equal_contributors_the_last_goes_first():
    front = np.array([[0.0, 1], [1, 0], [0.5, 0.5], [0.5, 0.5], [0.5, 0.5]])
    assert least_first(front, np.array([1.1, 1.1]), 3)[0].tolist()[:2] == [4, 3]


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


@pytest.mark.parametrize(
    ("losses", "points"), [(12, 25), (12, 2000), (20, 17), (9, 61), (5, 10_001)]
)
def test_a_hypervolume_that_would_take_hours_is_not_taken(losses, points):
    assert volume_is_quick(points - 1, losses) == (points != 2000)
    first = np.random.default_rng(1).random((points, losses))
    assert np.isnan(Hypervolume(first)(first))


@pytest.mark.parametrize("losses", range(1, 5))
def test_of_up_to_four_losses_every_hypervolume_is_taken(losses):
    assert volume_is_quick(10**9, losses)
