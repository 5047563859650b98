"""Plan change and plan seam: children inherit other streets, with buildings that fit them."""

import numpy as np
import pytest
from codes import uniformly
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.coding.decoding_cache import decoded
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.fitness import repetition, source_shares, street_distance
from evocity.genome import Genome
from evocity.operators import PlanChange, PlanFusion, PlanSeam, make
from evocity.operators.plans import apply_changes, changed_child, lay, plan_of, renumbering
from evocity.operators.plans.inheritance import find_plan, plan_key

NEW_YORK, LYON = NAMES = "new-york-west-village", "lyon-1er"


@pytest.fixture(scope="module")
def sources() -> list[Genome]:
    """New York and Lyon, in windows of 320 m."""
    return [
        evocity.encode(evocity.read_map(name, pixels=160), reach=16, fit=False).genome
        for name in NAMES
    ]


@pytest.fixture(scope="module")
def founders(sources):
    return dict(zip(NAMES, sources, strict=True))


def cities_of(founders):
    return {name: decoded(genome).city for name, genome in founders.items()}


def plans_of(founders):
    return {name: plan_of(city) for name, city in cities_of(founders).items()}


def assert_plan(child, founders, intended=None):
    """The child's plan is that of its changes, and genes lay the buildings of changed faces."""
    plan, state = find_plan(child, founders)
    assert state is not None
    assert state.key == plan_key(child.made)
    plans = plans_of(founders)
    again = apply_changes(plans[state.city], state.changes, plans)
    assert np.array_equal(plan.labels, again.labels)
    assert np.array_equal(plan.lots, again.lots)
    assert set(state.genes) <= set(range(1, len(plan) + 1)) - set(np.flatnonzero(plan.open) + 1)
    if intended is not None:
        laid = lay(plan, state.all_genes, cities_of(founders))
        faces = [face for face in state.genes if face not in state.edited]
        lots = np.isin(plan.lots, faces)
        assert np.array_equal(intended[lots], laid[lots])
    return plan, state


@pytest.mark.parametrize("kind", ["alley", "closing", "width"])
def test_children_inherit_a_changed_plan(sources, founders, kind):
    operator, parents = PlanChange(kinds=[kind]), [sources[0], *sources]
    draft = operator.draft(parents, np.random.default_rng(3))
    child = operator(parents, np.random.default_rng(3))
    plan, state = assert_plan(child, founders, draft.intended)
    assert [change["kind"] for change in state.changes] == [kind]
    assert child.made["faces"] in (1, 2)
    own = plans_of(founders)[NEW_YORK]
    kept = renumbering(own, plan)
    assert len(own) - len(kept) in (1, 2)
    stays = np.isin(own.lots, list(kept))
    heights = decoded(sources[0]).attractor
    assert np.abs(draft.intended - np.maximum(heights, 0))[stays].max() == 0
    bred = decode(child).city
    error = np.sqrt(np.mean((decoded(child).attractor - draft.intended) ** 2))
    assert error < 0.5
    assert bred.built[(plan.labels == 0)].mean() < 0.02
    assert street_distance(bred, reference=decoded(sources[0]).city) < 0.1


def test_changes_follow_changes(sources, founders, tmp_path):
    child = sources[1]
    for seed in range(4):
        child = PlanChange(changes=2)([child, *sources], np.random.default_rng(seed))
    _, state = assert_plan(child, founders)
    assert len(state.changes) == 8
    child.write(tmp_path / "child.parquet")
    assert plan_key(evocity.read_genome(tmp_path / "child.parquet").made) == state.key
    filled = PlanFusion(faces=2)([child, *sources], np.random.default_rng(0))
    assert plan_key(filled.made) == state.key
    again = PlanChange(changes=2)([filled, *sources], np.random.default_rng(1))
    assert_plan(again, founders)
    assert PlanChange(changes=2)([filled, *sources], np.random.default_rng(1)) == again


def test_a_plan_has_few_changes(sources, founders, monkeypatch):
    monkeypatch.setattr(changed_child, "MOST_CHANGES", 2)
    child = PlanChange(changes=4)([sources[1], *sources], np.random.default_rng(0))
    _, state = assert_plan(child, founders)
    assert len(state.changes) == 2
    assert changed_child.count_changes([{"changes": [{}, {"changes": [{}]}]}, {}]) == 5


@pytest.mark.parametrize("order", [1, -1])
def test_seams_join_two_plans(sources, founders, order):
    parents = sources[::order]
    operator = PlanSeam()
    draft = operator.draft([*parents, *sources], np.random.default_rng(2))
    child = operator([*parents, *sources], np.random.default_rng(2))
    plan, state = assert_plan(child, founders, draft.intended)
    assert [change["kind"] for change in state.changes] == ["seam"]
    assert state.changes[0]["city"] == NAMES[::order][1]
    assert child.made["faces"] > 3
    own = plans_of(founders)[state.city]
    stays = np.isin(own.lots, list(renumbering(own, plan)))
    assert (draft.intended == np.maximum(decoded(parents[0]).attractor, 0))[stays].all()
    shares = source_shares(decode(child).city, child)
    assert min(shares.values()) > 0.1
    assert decode(child).city.built[plan.labels == 0].mean() < 0.02


def test_seams_bring_the_genes_of_the_second_parent(sources, founders):
    filled = PlanFusion(faces=6, area_min=0)([sources[1], *sources], np.random.default_rng(0))
    changed = PlanChange()([filled, *sources], np.random.default_rng(4))
    child = PlanSeam()([sources[0], changed, *sources], np.random.default_rng(1))
    _, state = assert_plan(child, founders)
    seam = state.changes[0]
    assert seam["kind"] == "seam"
    assert len(seam["changes"]) == len(changed.made["plan"]["changes"]) == 1


def test_no_place_stands_on_both_sides_of_a_seam(sources):
    filled = PlanFusion(faces=None)([*sources, *sources], np.random.default_rng(1))
    for seed in range(2):
        child = PlanSeam()([filled, sources[1], *sources], np.random.default_rng(seed))
        assert repetition(decoded(child).city, genome=child) <= 0.02


def test_halves_of_faces_follow_the_plan(sources, founders):
    filled = sources[1]
    for seed in range(4):
        operator = PlanFusion(faces=None, halved_min=0.0, draws=40, loss=0.3, slack=0.4)
        filled = operator([filled, *sources], np.random.default_rng(seed))
        if filled.made["plan"].get("halves") or any(
            gene["part"] for gene in filled.made["plan"]["genes"]
        ):
            break
    else:
        pytest.skip("no face has two halves")
    changed = PlanChange(changes=3)([filled, *sources], np.random.default_rng(1))
    assert_plan(changed, founders)
    joined = PlanSeam()([sources[0], filled, *sources], np.random.default_rng(1))
    assert_plan(joined, founders)


def test_equal_plans_meet_another_city(sources, founders):
    child = PlanSeam()([sources[0], sources[0], *sources], np.random.default_rng(3))
    _, state = assert_plan(child, founders)
    assert state.changes[0]["city"] == LYON
    alone = PlanSeam()([sources[0], sources[0]], np.random.default_rng(3))
    assert alone.made["faces"] == 0
    assert np.array_equal(alone.digest, sources[0].digest)


@pytest.mark.parametrize("operator", [PlanChange(changes=6), PlanSeam()], ids=["change", "seam"])
def test_locked_faces_stay(sources, operator):
    city = decoded(sources[0]).city
    mask = np.zeros(city.shape, bool)
    mask[40:100, 30:120] = True
    locked = sources[0].replace(condensation=Condensation.cut(city, mask))
    for seed in range(3):
        child = operator([locked, sources[1], *sources], np.random.default_rng(seed))
        assert np.array_equal(decode(child).city.heights[mask], city.heights[mask])
        plan, state = find_plan(child, dict(zip(NAMES, sources, strict=True)))
        own = plan_of(decoded(sources[0]).city)
        kept = list(renumbering(own, plan)) if state is not None and state.changes else own.labels
        assert np.isin(own.labels[mask & (own.labels > 0)], kept).all()


@pytest.mark.parametrize("height", [0.0, 9.0])
@pytest.mark.parametrize("name", ["plan_change", "plan_seam"])
def test_maps_without_streets_or_houses_breed(name, height):
    bare = uniformly(CityMap(np.full((64, 64), height), 2.0, name="bare")).genome
    town = uniformly(draw_town(2)).genome
    for parents in ([bare, town], [town, bare], [bare, bare]):
        child = make(name)(parents, np.random.default_rng(0))
        assert decode(child).converged


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ({"kinds": []}, "kinds"),
        ({"kinds": ["alley", "bridge"]}, "kinds"),
        ({"changes": 0}, "changes = 0"),
        ({"changes": 13}, "changes = 13"),
        ({"slack": 2}, "slack = 2"),
    ],
)
def test_parameters_at_fault_are_named(parameters, word):
    with pytest.raises(OperatorError, match=word):
        make("plan_change", **parameters)


RUN = """
[run]
seed = 5
population = 6
generations = 2
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
plan_change = { weight = 1, kinds = ["width", "closing"], draws = 60, repeats = 1.0 }
plan_seam = { weight = 1, draws = 60, repeats = 1.0 }
[[fitness]]
name = "fsi"
goal = "max"
[[fitness]]
name = "gsi"
goal = "min"
[evaluation]
workers = 0
"""


@pytest.mark.slow
def test_a_search_breeds_by_them_and_is_replayed(tmp_path):
    (tmp_path / "plans.toml").write_text(RUN)
    recipe = evocity.read_recipe(tmp_path / "plans.toml")
    with evocity.Search(recipe, out=tmp_path / "run", workers=0) as search:
        for _ in search:
            pass
    run = evocity.open_run(tmp_path / "run")
    births = run.births().to_pylist()
    bred = [one["id"] for one in births if one["operator"] in ("plan_change", "plan_seam")]
    kinds = {
        change["kind"]
        for id in bred
        for change in run[id].genome.made.get("plan", {}).get("changes", ())
    }
    assert "seam" in kinds
    assert len(kinds) > 1
    assert all(one.same for one in evocity.replay(tmp_path / "run", bred[-3:]))
