"""Niches of plans: who lives, which births are twins, which parents cross; shares of parents."""

from collections import Counter
from dataclasses import replace

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import evocity
from evocity.citymap import CityMap
from evocity.errors import RecipeError
from evocity.fitness import Constraint, smallest_share
from evocity.operators.plan_crossing import PlanCrossing
from evocity.search.breeding.birth_plans import choose_mates
from evocity.search.breeding.island import plan_name
from evocity.search.calibration.guard import calibrate_bound, parents_target
from evocity.search.preparation.constraints import ParentConstraint, describe_unkept
from evocity.selection.algorithms import algorithms
from evocity.selection.cells import ranges_around
from evocity.selection.individual import Individual
from evocity.selection.niches import Twins, choose_by_plan, source_of, thin_out
from evocity.selection.thumbprints import look_of

PLANS = ((None, False), ("a", False), ("b", False), ("a+1", True), ("b+2", True), ("b+3", True))
DRAWN = st.lists(st.sampled_from(PLANS), max_size=24)


def living(plans, losses=None, violations=None):
    """Individuals with these plans, the first the best."""
    return [
        Individual(
            id=k,
            genome=None,
            values={},
            losses=(float(k if losses is None else losses[k]),),
            violation=0.0 if violations is None else float(violations[k]),
            plan=name,
            changed=changed,
        )
        for k, (name, changed) in enumerate(plans)
    ]


@given(DRAWN, st.integers(1, 16), st.integers(0, 4), st.floats(0, 1), st.integers(0, 2**32))
def test_niches_have_limits_and_places(plans, count, most, share, seed):
    rng = np.random.default_rng(seed)
    candidates = living(plans, violations=np.sort(rng.integers(0, 3, len(plans))))
    looks = rng.integers(0, 90, (len(plans), 12)).astype(np.uint16)
    chosen = choose_by_plan(candidates, count, most, share, rng.choice([None, 1]) and looks)
    assert chosen == sorted(set(chosen))
    assert len(chosen) <= count
    taken = [candidates[at] for at in chosen]
    lives = Counter(one.plan for one in taken if one.changed)
    assert not most or max(lives.values(), default=0) <= most
    sources = sorted({source_of(one) for one in candidates if one.plan})
    places = max(1, int(share * count / len(sources))) if share and sources else 0
    half = -(-places // 2)
    enough = places * len(sources) <= count
    for name in sources:
        kept = [one.id for one in candidates if one.plan == name and not one.violation]
        lives_on = [one for one in taken if one.plan == name]
        if enough and places:
            assert sum(not one.violation for one in lives_on) >= min(len(kept), half)
            assert lives_on or name not in {one.plan for one in candidates}
    if len(chosen) < count:  # only limits leave individuals out
        left = [one for at, one in enumerate(candidates) if at not in chosen]
        assert all(one.changed and lives[one.plan] == most for one in left)
    if not most and not places:
        assert chosen == list(range(min(count, len(plans))))


@given(DRAWN, st.integers(8, 16), st.floats(0.2, 1), st.integers(0, 2**32))
def test_no_child_that_breaks_constraints_has_the_place_of_one_that_keeps_them(
    plans, count, share, seed
):
    rng = np.random.default_rng(seed)
    candidates = living(plans, violations=np.sort(rng.integers(0, 2, len(plans))))
    kept = [at for at, one in enumerate(candidates) if not one.violation]
    chosen = choose_by_plan(candidates, count, 0, share)
    broken = [candidates[at] for at in chosen if candidates[at].violation]
    if len(kept) < count:
        return
    for one in broken:  # the only one of its plan, or a plan without any that keep them
        own = [candidates[at] for at in kept if candidates[at].plan == one.plan]
        related = [candidates[at] for at in kept if source_of(candidates[at]) == source_of(one)]
        assert not own
        assert not related or sum(other.plan == one.plan for other in broken) == 1


def test_a_source_city_holds_the_place_of_its_plan():
    plans = [("a", False)] * 6 + [("b+1", True)] + [("b", False)] * 3
    candidates = living(plans, violations=[0] * 7 + [1, 2, 3])
    candidates[-1] = replace(candidates[-1], founder=True)
    assert choose_by_plan(candidates, 6, 8, 1.0) == [0, 1, 2, 3, 6, 9]
    assert choose_by_plan(candidates[:-1], 6, 8, 1.0) == [0, 1, 2, 3, 6, 7]
    none = [*candidates[:6], *candidates[7:]]  # no change of the plan keeps the constraints
    assert choose_by_plan(none, 6, 8, 1.0) == [0, 1, 2, 3, 6, 8]
    assert choose_by_plan(none[:-1], 6, 8, 1.0) == [0, 1, 2, 3, 6, 7]


@given(st.integers(1, 20), st.integers(0, 20), st.integers(0, 2**32))
def test_thinning_keeps_the_best_half_and_those_that_differ(size, places, seed):
    rng = np.random.default_rng(seed)
    looks = (rng.integers(0, 3, (size, 16)) * 40).astype(np.uint16)
    pool = rng.permutation(size).tolist()
    stays = thin_out(pool, places, looks)
    assert len(stays) == min(size, places)
    assert stays == [at for at in pool if at in stays]
    assert stays[: -(-len(stays) // 2)] == pool[: -(-len(stays) // 2)]
    assert stays == naive.thin_out(pool, places, looks)
    assert thin_out(pool, places) == pool[:places]


def test_thinning_drops_copies_first():
    looks = np.array([[0] * 8, [0] * 8, [90] * 8, [90] * 4 + [0] * 4, [90] * 8], np.uint16)
    assert thin_out([0, 2, 1, 4, 3], 3, looks) == [0, 2, 3]


@given(DRAWN.filter(bool), st.integers(1, 4), st.integers(0, 2**32))
def test_cities_that_break_constraints_have_children(plans, count, seed):
    rng = np.random.default_rng(seed)
    losses, violations = rng.random(len(plans)), rng.integers(0, 2, len(plans))
    algorithm = algorithms()["single"](8, algorithms()["single"].Keys(source_plans=0.5))
    individuals = algorithm.judged(living(plans, losses, violations))
    chosen = algorithm.parents(individuals, count, np.random.default_rng(seed))
    kept = {source_of(one) for one in individuals if not one.violation}
    groups = [source_of(one) if source_of(one) not in kept else None for one in individuals]
    assert chosen == naive.tournament_within(groups, count, np.random.default_rng(seed))
    usual = algorithms()["single"](8).parents(individuals, count, np.random.default_rng(seed))
    assert len(set(groups)) > 1 or chosen == usual


@given(DRAWN, st.integers(1, 16))
def test_without_niches_the_best_live(plans, count):
    candidates = living(plans)
    assert choose_by_plan(candidates, count, 0, 0.0) == list(range(min(count, len(plans))))


def test_a_plan_of_a_source_lives_in_children_that_break_constraints():
    plans = [("a", False)] * 6 + [("b", False)] * 3
    candidates = living(plans, violations=[0] * 6 + [1, 2, 3])
    keys = {"distinct": 0.0, "source_plans": 0.5}
    for kind in (one for one in algorithms().values() if hasattr(one.Keys, "model_fields")):
        if "source_plans" not in kind.Keys.model_fields:
            continue
        chosen = kind(4, kind.Keys(**keys)).survivors(candidates, None, np.random.default_rng(0))
        assert [one.plan for one in chosen] == ["a", "a", "a", "b"]
        assert chosen[-1].id == 6
        everything = living([("a", False), ("b", False)] * 4, violations=[0] * 8)
        chosen = kind(4, kind.Keys(**keys)).survivors(everything, None, np.random.default_rng(0))
        assert not any(one.violation for one in chosen)


@given(st.integers(0, 2**32), st.sampled_from((0.002, 0.01, 0.05)))
@settings(deadline=None, max_examples=40)
def test_twins_differ_in_few_pixels(seed, share):
    rng = np.random.default_rng(seed)
    first = rng.integers(0, 9, (96, 128)).astype(np.float32)
    maps = []
    for _ in range(6):
        base = maps[rng.integers(len(maps))] if maps else first
        fresh, changed = base.copy(), rng.random(base.shape) < rng.choice([0.001, 0.008, 0.1])
        fresh[changed] += rng.choice([2.9, 3.1, 9.0])
        maps.append(fresh)
    cities = [CityMap(one, 2.0) for one in maps]
    plans = [(str(rng.choice(["a", "b"])), False) for _ in maps]
    own = living(plans, violations=rng.integers(0, 2, 6))

    def differing(one, other):
        return np.mean(np.rint(np.abs(maps[one.id] - maps[other.id]) * 10) > 30)

    entered = own[:2]
    for one in own[2:]:
        alike = [other for other in entered if differing(one, other) < share]
        worse = [other for other in alike if other.violation > one.violation]
        if all(other in worse and other.plan == one.plan for other in alike):
            entered = [other for other in entered if other not in alike] + [one]
    twins = Twins(share, lambda one: look_of(cities[one.id]), lambda one: cities[one.id])
    assert twins.sift(own[2:], own[:2]) == entered


@given(DRAWN.filter(bool), st.integers(1, 4), st.integers(0, 2**32))
def test_mates_have_the_plan_of_the_first_parent(plans, count, seed):
    individuals = living(plans)
    algorithm = algorithms()["single"](8)
    individuals = algorithm.judged(individuals)
    chosen = choose_mates(algorithm, individuals, count, np.random.default_rng(seed))
    assert len(chosen) == count
    first = individuals[chosen[0]]
    same = [k for k, one in enumerate(individuals) if one.plan and one.plan == first.plan]
    if len(same) >= count:
        assert {individuals[k].plan for k in chosen} == {first.plan}
        assert len(set(chosen)) == count
    elif len(individuals) >= count:
        assert len(set(chosen)) == count


def test_the_plan_of_a_genome_is_that_of_its_source_with_its_changes():
    heights = np.zeros((32, 32))
    heights[4:12, 4:20] = 9
    code = evocity.encode(CityMap(heights, 2.0, name="lone")).genome
    assert plan_name(code) == ("lone", False)
    bare = {"version": 1, "city": "lone", "faces": 1, "changes": [], "genes": [], "edited": []}
    child = code.replace(made={"operator": "plan_fusion", "plan": bare})
    assert plan_name(child) == ("lone", False)
    changed = bare | {"changes": [{"kind": "alley"}]}
    name, differs = plan_name(code.replace(made={"operator": "plan_change", "plan": changed}))
    assert name.startswith("lone+")
    assert differs
    assert plan_name(code.replace(made={"operator": "mutation"})) == (None, False)
    assert PlanCrossing.crosses_plans


# -- recipes ---------------------------------------------------------------------------------------


def recipe(parents=2, **sections):
    cities = ["lyon-1er", "montpellier-pas-du-loup", "villeurbanne-gratte-ciel"][:parents]
    fitness = sections.pop("fitness", ["alignment"])
    return evocity.Recipe(parents=cities, fitness=fitness, **sections)


@pytest.mark.parametrize(
    ("parents", "least", "says"),
    [
        (1, 0.2, "0.2 for smallest_share, with 1 parent"),
        (2, 0.51, "0.5 or less: each of 2 equal shares"),
        (3, 0.34, "0.33 or less: each of 3 equal shares"),
    ],
)
def test_a_share_that_no_child_can_have_is_refused(parents, least, says):
    with pytest.raises(RecipeError) as caught:
        recipe(parents, fitness=["alignment", {"name": "smallest_share", "min": least}])
    assert says in str(caught.value)
    assert "fitness[1].min" in caught.value.found
    assert caught.value.expected
    assert caught.value.remedy


def test_equal_shares_are_allowed():
    for parents, least in ((2, 0.5), (3, 1 / 3)):
        recipe(parents, fitness=["alignment", {"name": "smallest_share", "min": least}])


@pytest.mark.parametrize(
    ("key", "value"), [("per_plan", -1), ("source_plans", 1.5), ("twins", 1.0), ("mates", 2.0)]
)
def test_niches_have_ranges(key, value):
    assert recipe().search.settings[key] == 0
    assert not recipe().search.has_niches
    with pytest.raises(RecipeError, match=f"search.{key}"):
        recipe(search={key: value})


def test_only_fabrics_have_plans():
    sections = {"run": {"kind": "shape"}, "parents": [{"shape": "fern"}]}
    for key in ("per_plan", "source_plans", "mates"):
        with pytest.raises(RecipeError, match=f"search.{key}"):
            evocity.Recipe(**sections, fitness=["alignment"], search={key: 1})


def test_islands_have_the_mates_of_the_search():
    islands = [{"name": "one", "population": 8}, {"name": "two", "population": 8, "twins": 0.1}]
    several = recipe(islands=islands, search={"mates": 0.5, "per_plan": 3})
    assert [one.search.mates for one in several.local] == [0.5, 0.5]
    assert [one.search.settings["per_plan"] for one in several.local] == [3, 3]
    assert [one.search.settings["twins"] for one in several.local] == [0.0, 0.1]


def test_founders_need_not_have_the_smallest_share():
    bound = Constraint(smallest_share, 0.25)
    one = ParentConstraint(bound, {"left": 0.0, "right": 0.0}, True, True)
    assert describe_unkept([one]) == []
    with pytest.raises(RecipeError, match="no parent's own code keeps smallest_share"):
        describe_unkept([ParentConstraint(bound, {"left": 0.0, "right": 0.0}, True)])


def test_the_share_of_several_parents_spans_a_grid():
    assert ranges_around(("smallest_share",), [{"smallest_share": 0.0}] * 3, {}) == ((0.0, 1 / 3),)
    with pytest.raises(RecipeError, match="no ranges"):
        ranges_around(("smallest_share",), [{"smallest_share": 1.0}], {})


# -- the guard -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "least"), [(2, 0.25), (3, 0.17), (4, 0.13), (5, 0.1)])
def test_the_least_share_is_half_of_an_equal_share(count, least):
    values = {str(k): (0.0, 0.0) for k in range(count)}
    assert calibrate_bound(smallest_share, values).keys == {"min": least}
    assert calibrate_bound(smallest_share, {"lone": (1.0, 1.0)}) is None


def test_streets_and_densities_have_bounds_around_the_parents():
    fitness = evocity.fitness
    near = calibrate_bound(fitness.street_distance, {"a": (-0.04, -0.03), "b": (0.0, 0.02)})
    assert near.keys == {"max": 0.1}
    far = calibrate_bound(fitness.street_distance, {"a": (-0.04, 0.1), "b": (0.0, 0.02)})
    assert far.keys == {"max": 0.2}
    band = calibrate_bound(fitness.gsi, {"a": (0.5, 0.52), "b": (0.95, 0.94)})
    assert band.keys == {"min": 0.45, "max": 1.0}
    assert calibrate_bound(fitness.repetition, {"a": (0.0, 0.0)}).keys == {"max": 0.01}
    assert calibrate_bound(fitness.fsi, {"a": (1.0, float("nan"))}) is None


def test_targets_are_those_of_the_parents_or_the_law():
    law, crumbs = evocity.fitness.salingaros_law, evocity.fitness.crumbs
    assert parents_target(crumbs, {"a": (1.0, 9.0), "b": (2.0, 9.0)}) == 1.5
    assert parents_target(law, {"a": (0.5, 0.1), "b": (0.9, 0.1)}) == 0.7
    assert parents_target(law, {"a": (0.92, 0.1), "b": (0.9, 0.1)}) == 1.0
    assert parents_target(law, {"a": (float("nan"), 0.4)}) == 0.4


# -- runs ------------------------------------------------------------------------------------------

RUN = """
[run]
name = "niches"
seed = 5
population = 8
generations = 4
[map]
pixels = 80
[genome]
fit = false
reach = 8
[[parents]]
map = "new-york-west-village"
[[parents]]
map = "lyon-1er"
[operators]
plan_fusion = { weight = 1, draws = 20, repeats = 1.0 }
plan_crossing = { weight = 3, draws = 20, repeats = 1.0 }
plan_change = { weight = 1, draws = 20, repeats = 1.0 }
[search]
per_plan = 2
source_plans = 0.5
twins = 0.02
mates = 1.0
[[fitness]]
name = "alignment"
[[fitness]]
name = "smallest_share"
min = 0.05
[evaluation]
workers = 0
"""


def rows(path):
    run = evocity.open_run(path)
    columns = ["id", "parents", "operator", "genome", "made", "fitness.alignment"]
    return run.births(columns=columns).to_pylist(), [
        run.members(generation).to_pylist() for generation in run.generations
    ]


@pytest.mark.slow
def test_a_run_with_niches_is_resumed_and_replayed(tmp_path):
    (tmp_path / "niches.toml").write_text(RUN)
    recipe = evocity.read_recipe(tmp_path / "niches.toml")
    with evocity.Search(recipe, out=tmp_path / "whole") as search:
        last = list(search)[-1]
    plans = [plan_name(one.genome) for one in last.population]
    assert {"new-york-west-village", "lyon-1er"} <= {name for name, _ in plans}
    assert max(Counter(name for name, changed in plans if changed).values(), default=0) <= 2
    with evocity.Search(recipe, out=tmp_path / "parts") as search:
        for generation in search:
            if generation.number == 2:
                break
    with evocity.Search.resume(tmp_path / "parts") as search:
        for _ in search:
            pass
    assert rows(tmp_path / "parts") == rows(tmp_path / "whole")
    assert all(one.same for one in evocity.replay(tmp_path / "whole", range(20, 40)))
