"""Parents: the best of a few drawn."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_search_algorithms import DRAWN, RANKED, ids_of, some

from evocity.selection.algorithms.algorithm import tournament


def of(kind, drawn, count):
    """An algorithm with a tournament of so many, and its living."""
    search = kind(len(some(*drawn)) or 1, kind.Keys(tournament=count))
    return search, search.judged(some(*drawn))


@given(st.integers(0, 2**32), st.integers(1, 30))
def test_a_tournament_of_one_draws_evenly(seed, size):
    rngs = np.random.default_rng(seed), np.random.default_rng(seed)
    (chosen,) = tournament(size, lambda at: at, 1, rngs[0], 1)
    assert chosen == rngs[1].integers(size)


@pytest.mark.parametrize("kind", RANKED, ids=lambda kind: kind.name)
@given(drawn=DRAWN, count=st.integers(1, 9), seed=st.integers(0, 2**32))
@settings(deadline=None)
def test_no_breaker_of_bounds_is_chosen_beside_a_keeper(kind, drawn, count, seed):
    search, living = of(kind, drawn, count)
    (chosen,) = search.parents(living, 1, np.random.default_rng(seed))
    rng = np.random.default_rng(seed)
    if kind.name == "nsga3":
        rng.permutation(len(living))  # its parents win by chance
    seen = [living[int(rng.integers(len(living)))] for _ in range(count)]
    assert living[chosen] in seen
    assert living[chosen].violation == 0 or all(one.violation > 0 for one in seen)
    assert living[chosen].violation == min(one.violation for one in seen)
    if kind.name != "nsga3":
        assert living[chosen].rank == min(one.rank for one in seen)


@pytest.mark.parametrize("kind", RANKED, ids=lambda kind: kind.name)
@given(drawn=DRAWN, count=st.integers(1, 9), seed=st.integers(0, 2**32))
@settings(deadline=None)
def test_parents_follow_from_the_generator_and_not_from_the_order(kind, drawn, count, seed):
    search, living = of(kind, drawn, count)
    chosen = [search.parents(living, 2, np.random.default_rng(seed)) for _ in range(2)]
    assert chosen[0] == chosen[1]
    other = search.judged(living[::-1])
    assert ids_of(other) == ids_of(living)
    assert search.parents(other, 2, np.random.default_rng(seed)) == chosen[0]


@given(st.integers(1, 40), st.integers(1, 8), st.integers(0, 2**32))
def test_who_is_drawn_besides_makes_no_parent_worse(size, count, seed):
    few, more = (
        tournament(size, lambda at: at, 1, np.random.default_rng(seed), drawn)
        for drawn in (count, count + 1)
    )
    assert more <= few
