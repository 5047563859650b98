"""Who lives and who breeds, by each algorithm."""

import random
from dataclasses import replace

import naive
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from evocity.citymap import CityMap
from evocity.selection import algorithms as room
from evocity.selection.algorithms import algorithms
from evocity.selection.algorithms.algorithm import DistinctKeys, tournament
from evocity.selection.algorithms.ordered import MOST, HypervolumeContribution
from evocity.selection.backends.moocore import hypervolume
from evocity.selection.fronts import Scale, ranks_of
from evocity.selection.individual import Individual
from evocity.selection.thumbprints import SIDE, alike, distinct_first, look_of, most_distinct_first

RANKED = [kind for kind in algorithms().values() if issubclass(kind, room.Ranked)]
DRAWN = st.tuples(st.integers(1, 4), st.integers(1, 16), st.integers(0, 2**32))


def some(goals, count, seed, broken=0.3):
    """Individuals with whole losses, in no order of their ids."""
    rng = np.random.default_rng(seed)
    losses = rng.integers(-3, 4, (count, goals)).astype(float).tolist()
    violations = np.where(rng.random(count) < broken, rng.integers(1, 3, count), 0).tolist()
    ids = rng.permutation(100 + count)[:count].tolist()
    return [
        Individual(id=one, genome=None, values={}, losses=tuple(row), violation=float(far))
        for one, row, far in zip(ids, losses, violations, strict=True)
    ]


def drawing():
    return np.random.default_rng(0)


def unseen(one):
    raise AssertionError("nobody needs a map")


def ids_of(individuals):
    return [one.id for one in individuals]


@pytest.mark.parametrize("kind", RANKED, ids=lambda kind: kind.name)
@given(drawn=DRAWN, size=st.integers(1, 16))
@settings(deadline=None)
def test_lower_fronts_live_whatever_the_order(kind, drawn, size):
    candidates = some(*drawn)
    search = kind(size, kind.Keys(distinct=0))
    living = search.survivors(candidates, unseen, drawing())
    losses, far = (
        np.array([getattr(one, key) for one in candidates]) for key in ("losses", "violation")
    )
    ranks = dict(zip(ids_of(candidates), ranks_of(losses, far).tolist(), strict=True))
    assert [ranks[one.id] for one in living] == sorted(ranks.values())[:size]
    assert len(set(ids_of(living))) == len(living)
    shuffled = np.random.default_rng(0).permutation(len(candidates))
    assert search.survivors([candidates[i] for i in shuffled], unseen, drawing()) == living
    # a run that is taken up again knows those who lived, and judges them alike
    bare = [replace(one, rank=0, marks={}) for one in living]
    assert search.judged(bare[::-1]) == living
    assert all(set(one.marks) == set(kind.marks) for one in living)
    assert [one.rank for one in living] == sorted(one.rank for one in living)


@pytest.mark.parametrize("kind", RANKED, ids=lambda kind: kind.name)
def test_none_live_of_none(kind):
    assert kind(4).survivors([], unseen, drawing()) == []


@given(seed=st.integers(0, 2**32), goals=st.integers(2, 3), size=st.integers(1, 9))
@settings(deadline=None)
def test_dropping_the_least_contributor_keeps_the_most_hypervolume_of_one_less(seed, goals, size):
    """Where one is too many, no other choice of a front leaves more."""
    candidates = some(goals, 40, seed, broken=0)
    losses = np.array([one.losses for one in candidates])
    front = [candidates[i] for i in np.flatnonzero(ranks_of(losses) == 0)][: size + 1]
    if len(front) < 2:
        return
    search = HypervolumeContribution(len(front) - 1, DistinctKeys(distinct=0))
    living = search.survivors(front, unseen, drawing())
    scale = Scale(np.array([one.losses for one in front]))

    def volume(individuals):
        return hypervolume(scale(np.array([one.losses for one in individuals])), scale.reference)

    left = [[one for one in front if one is not other] for other in front]
    assert volume(living) == pytest.approx(max(map(volume, left)))


def test_crowding_stands_for_contributions_where_these_cost_too_much():
    count = MOST[7] + 1
    many = some(7, count, 0, broken=0)
    by_crowding = algorithms()["nsga2"](9, DistinctKeys(distinct=0)).survivors(
        many, unseen, drawing()
    )
    chosen = HypervolumeContribution(9, DistinctKeys(distinct=0)).survivors(many, unseen, drawing())
    assert set(ids_of(chosen)) == set(ids_of(by_crowding))


# -- individuals that differ ----------------------------------------------------------------------


@pytest.mark.parametrize("kind", RANKED, ids=lambda kind: kind.name)
@given(drawn=DRAWN, share=st.sampled_from([0.25, 0.5, 1.0]))
@example(drawn=(4, 10, 11666), share=1.0)  # niches begin with those that differ from the fewest
@settings(deadline=None)
def test_so_many_differ_as_are_asked_for_if_there_are(kind, drawn, share):
    candidates = some(*drawn)
    rng, size = np.random.default_rng(drawn[2]), 6
    looks = {one.id: rng.choice([0, 100], 12, p=[0.8, 0.2]).astype(np.uint16) for one in candidates}
    search = kind(size, kind.Keys(distinct=share, apart=0.2))
    living = search.survivors(candidates, lambda one: looks[one.id], drawing())
    kept = [one for one in candidates if not one.violation]
    assert len(living) == min(size, len(candidates))
    assert sum(not one.violation for one in living) == min(size, len(kept))
    if len(kept) <= size:
        return

    def seen(individuals):
        return [looks[one.id] for one in individuals]

    if kind.name == "nsga3":
        possible = naive.most_distinct(seen(kept), 0.2)
    else:  # each the best that differs, in the order in which they are judged
        possible = len(naive.distinct(seen(search.judged(kept)), 0.2))
    assert naive.most_distinct(seen(living), 0.2) >= min(round(share * size), possible)


@given(seed=st.integers(0, 2**32), count=st.integers(0, 8), apart=st.sampled_from([0.0, 0.3, 0.6]))
@settings(deadline=None)
def test_the_best_that_differ_come_first(seed, count, apart):
    looks = np.random.default_rng(seed).choice([0, 100], (9, 7)).astype(np.uint16)
    order = distinct_first(looks, apart, count).tolist()
    chosen = naive.distinct_in_turn(looks, apart, count)
    assert order == chosen + [i for i in range(9) if i not in chosen]


@given(seed=st.integers(0, 2**32), count=st.integers(0, 8), apart=st.sampled_from([0.0, 0.3, 0.6]))
@settings(deadline=None)
def test_the_most_that_differ_come_first(seed, count, apart):
    looks = np.random.default_rng(seed).choice([0, 100], (9, 7)).astype(np.uint16)
    order = most_distinct_first(looks, apart, count).tolist()
    assert sorted(order) == list(range(9))
    most = min(naive.most_distinct(looks, apart), count)
    assert len(naive.distinct(looks[order[:most]], apart)) == most
    in_turn = distinct_first(looks, apart, count)
    if len(naive.distinct(looks[in_turn[:most]], apart)) == most:
        assert order == in_turn.tolist()


def test_a_storey_more_in_a_share_of_the_cells_is_no_likeness():
    look = np.full(100, 90, np.uint16)
    for cells, height, same in (
        (21, 121, False),
        (20, 121, True),
        (100, 120, True),
        (21, 59, False),
    ):
        other = look.copy()
        other[:cells] = height
        assert alike(other, look[None], 0.2) is same
        assert alike(look, np.stack([np.full(100, 65535, np.uint16), other]), 0.2) is same
    assert not alike(look, np.empty((0, 100), np.uint16), 0.2)


@pytest.mark.parametrize("shape", [(16, 24), (64, 64), (65, 200), (256, 256)])
def test_a_look_is_what_every_so_many_pixels_show(shape):
    rng = np.random.default_rng(0)
    heights = np.where(rng.random(shape) < 0.5, rng.uniform(3, 40, shape), 0)
    heights[0, 0] = 7000
    look = look_of(CityMap(heights, 2.0))
    step = [-(-side // SIDE) for side in shape]
    seen = heights[:: step[0], :: step[1]]
    assert look.size == seen.size <= SIDE**2
    assert look[0] == 65535
    assert np.abs(look[1:] / 10 - seen.ravel()[1:]).max() <= 0.05 + 1e-4


# -- one goal, and many ---------------------------------------------------------------------------


def test_of_one_goal_the_best_live_and_nothing_is_lost():
    single = algorithms()["single"](3, DistinctKeys(distinct=0))
    candidates = [
        Individual(id=k, genome=None, values={}, losses=(loss,), violation=far)
        for k, (loss, far) in enumerate([(5.0, 0), (1.0, 2), (3.0, 0), (3.0, 0), (0.0, 1)])
    ]
    living = single.survivors(candidates, unseen, drawing())
    assert ids_of(living) == [2, 3, 0]
    assert [one.rank for one in living] == [0, 0, 1]
    assert living[0].marks == {}
    assert ids_of(algorithms()["single"](5).survivors(candidates, unseen, drawing())) == [
        2,
        3,
        0,
        4,
        1,
    ]


def test_niches_around_reference_points_are_filled_one_after_another():
    """Of three clusters of a front, each near an axis, one of each lives before a second does."""
    kind = algorithms()["nsga3"]
    rng = np.random.default_rng(2)
    corners = np.repeat(np.eye(3), [30, 5, 2], axis=0)
    losses = corners + 0.05 * rng.random((37, 3))
    losses /= losses.sum(axis=1, keepdims=True)
    front = [
        Individual(id=k, genome=None, values={}, losses=tuple(row.tolist()))
        for k, row in enumerate(losses)
    ]
    for size in (3, 6):
        living = kind(size, kind.Keys(distinct=0, divisions=1)).survivors(front, unseen, drawing())
        nearest = np.array([one.losses for one in living]).argmax(axis=1)
        assert np.bincount(nearest, minlength=3).tolist() == [size // 3] * 3
        assert [one.marks["niche_distance"] for one in living] == sorted(
            one.marks["niche_distance"] for one in living
        )


def test_what_deap_draws_is_drawn_from_the_generator_handed_down():
    kind = algorithms()["nsga3"]
    losses = np.random.default_rng(0).random((60, 3))
    losses /= losses.sum(axis=1, keepdims=True)
    front = [
        Individual(id=k, genome=None, values={}, losses=tuple(row.tolist()))
        for k, row in enumerate(losses)
    ]
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002
    before = random.getstate(), np.random.get_state()[1].tolist()  # noqa: NPY002
    search = kind(30, kind.Keys(distinct=0, divisions=2))
    chosen = [search.survivors(front, unseen, np.random.default_rng(k)) for k in (3, 3, 4, 5, 6)]
    assert chosen[0] == chosen[1]
    assert len({tuple(ids_of(one)) for one in chosen}) > 1
    assert before == (random.getstate(), np.random.get_state()[1].tolist())  # noqa: NPY002


@pytest.mark.parametrize(
    ("name", "keys", "goals", "population", "says"),
    [
        ("single", {}, 3, 40, "'single' with 3 goals"),
        ("nsga3", {"divisions": 12}, 3, 40, "91 reference points for 3 goals, and 40 individuals"),
        ("nsga3", {"divisions": 1000}, 8, 40, "search.divisions"),
        ("nsga3", {}, 8, 6, "8 or more, one for each goal"),
        ("nsga3", {"divisions": 1}, 8, 6, "8 or more, one for each goal"),
    ],
)
def test_what_an_algorithm_cannot_do_is_a_fault(name, keys, goals, population, says):
    kind = algorithms()[name]
    (fault,) = kind.faults(kind.Keys(**keys), goals, population)
    assert says in " ".join(fault)


@pytest.mark.parametrize(
    ("name", "keys", "goals", "population"),
    [("single", {}, 1, 4), ("nsga3", {"divisions": 7}, 3, 40), ("nsga3", {}, 8, 8)],
)
def test_what_it_can_do_is_none(name, keys, goals, population):
    kind = algorithms()[name]
    assert kind.faults(kind.Keys(**keys), goals, population) == []


# -- who breeds -----------------------------------------------------------------------------------


@given(st.integers(1, 9), st.integers(1, 4), st.integers(0, 99))
def test_parents_differ_while_they_can(n, count, seed):
    chosen = tournament(n, lambda k: (0, k), count, np.random.default_rng(seed))
    assert len(chosen) == count
    assert len(set(chosen)) == min(n, count)


def test_the_better_of_two_is_chosen_more_often():
    rng = np.random.default_rng(1)
    wins = [tournament(2, [(1, 0), (0, 1)].__getitem__, 1, rng)[0] for _ in range(400)]
    assert 0.7 < np.mean(wins) < 0.8  # both drawn twice: 3 in 4


@pytest.mark.parametrize(
    "kind", [algorithms()["nsga2"], HypervolumeContribution], ids=lambda kind: kind.name
)
def test_a_lower_front_breeds_first_and_then_what_is_worth_more(kind):
    (mark,) = kind.marks
    one, other, last = (
        Individual(id=k, genome=None, values={}, losses=(0.0,), rank=rank, marks={mark: worth})
        for k, (rank, worth) in enumerate([(0, 1.0), (0, 2.0), (1, 9.0)])
    )
    search = kind(3)
    drawn = [search.parents([one, other, last], 1, np.random.default_rng(k))[0] for k in range(300)]
    assert drawn.count(1) > drawn.count(0) > drawn.count(2) > 0


# -- algorithms of other packages -----------------------------------------------------------------


class _Entry:
    value = "elsewhere:Algorithm"

    def __init__(self, name, kind):
        self.name, self._kind = name, kind

    def load(self):
        return self._kind


def test_other_packages_add_theirs(monkeypatch):
    class Other(HypervolumeContribution):
        name = "other"

    entries = [_Entry("other", Other), _Entry("nsga2", Other), _Entry("wrong", dict)]
    monkeypatch.setattr("evocity.plugins.entry_points", lambda group: entries)
    room._load_all.cache_clear()
    try:
        assert algorithms()["other"] is Other
        assert algorithms()["nsga2"] is not Other
        faults = room.algorithm_faults()
        assert len(faults) == 2
        assert "already" in faults[0]
        assert "subclass" in faults[1]
    finally:
        room._load_all.cache_clear()
