"""Plans are inherited: states in genomes, and the operators that keep a plan."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import evocity
from evocity.coding import decode
from evocity.coding.decoding_cache import decoded
from evocity.condensation import Condensation
from evocity.genome import Genome
from evocity.operators import (
    OPERATORS,
    HeightScaling,
    Mutation,
    PavementFusion,
    PlanCrossing,
    PlanFusion,
    PlanReturn,
    PlanSpread,
    PlanStoreys,
    QuarterRefill,
)
from evocity.operators.crossover import Drafting, raw_heights
from evocity.operators.face_filling import PlanDrafting
from evocity.operators.plan_crossing import grow_neighbourhood
from evocity.operators.plan_spread import alike, continue_gene
from evocity.operators.plans import FaceGene, InheritedPlan, find_plan, plan_key, plan_of
from evocity.operators.plans.inheritance import founder_name, founders_of
from evocity.operators.plans.laying import Lot, places_of

NEW_YORK, LYON = "new-york-west-village", "lyon-1er"


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.fixture(scope="module")
def sources() -> list[Genome]:
    """New York and Lyon, in windows of 320 m."""
    return [
        evocity.encode(evocity.read_map(name, pixels=160), reach=16, fit=False).genome
        for name in (NEW_YORK, LYON)
    ]


@pytest.fixture(scope="module")
def children(sources) -> list[Genome]:
    """Two children with the plan of New York: each has other faces of Lyon."""
    return [PlanFusion(faces=4)([sources[0], *sources], rng(seed)) for seed in (1, 2)]


def state_of(genome: Genome) -> InheritedPlan:
    state = InheritedPlan.from_made(json.loads(json.dumps(genome.made)))
    assert state is not None
    return state


genes = st.builds(
    FaceGene,
    st.just(1),
    st.text(),
    st.floats(0, 999),
    st.floats(0, 999),
    st.floats(-7, 7),
    st.booleans(),
    st.floats(0.1, 2),
)


@given(
    st.text(),
    st.dictionaries(st.integers(1, 50), genes),
    st.sets(st.integers(1, 50)),
    st.lists(st.tuples(st.integers(0, 99), st.integers(0, 99))),
    st.lists(st.fixed_dictionaries({"kind": st.text(), "faces": st.lists(st.integers(1, 9))})),
)
def test_a_state_is_the_same_after_json(city, faces, edited, touched, changes):
    known = {face: replace(gene, face=face) for face, gene in faces.items()}
    state = InheritedPlan(city, 50, tuple(changes), known, frozenset(edited), tuple(touched))
    again = InheritedPlan.from_made(json.loads(json.dumps({"plan": state.as_dict()})))
    assert again == state
    assert again.key == state.key == plan_key({"plan": state.as_dict()})
    assert state.key.startswith(city)


@given(st.recursive(st.none() | st.integers() | st.text() | st.floats(), lambda one: st.lists(one)))
@example("")
def test_a_strange_record_is_no_plan(value):
    assert InheritedPlan.from_made({"plan": value}) is None
    good = InheritedPlan("a", 9).as_dict()
    for key in good:
        read = InheritedPlan.from_made({"plan": good | {key: value}})
        assert read is None or read.as_dict()[key] == (
            sorted(set(value)) if key == "edited" else value
        )


@pytest.mark.parametrize(
    "gene",
    [
        {"face": 10, "source": "a", "row": 1, "column": 1, "angle": 0},
        {"face": 1, "source": 2, "row": 1, "column": 1, "angle": 0},
        {"face": 1, "source": "a", "row": "1", "column": 1, "angle": 0},
        {"face": 1, "source": "a", "row": 1, "column": 1, "angle": float("nan")},
        {"face": 1, "source": "a", "row": 1, "column": 1, "angle": 0, "scale": 0},
        {"face": 1, "source": "a", "row": 1, "column": 1, "angle": 0, "other": 1},
        {"face": 1},
        7,
    ],
)
def test_a_strange_gene_is_no_plan(gene):
    state = InheritedPlan("a", 9).as_dict() | {"genes": [gene]}
    assert InheritedPlan.from_made({"plan": state}) is None


def test_founders_are_codes_of_one_city(sources, children):
    assert founders_of([children[0], *sources]) == {NEW_YORK: 1, LYON: 2}
    assert founder_name(children[0]) is None
    assert founder_name(HeightScaling()(sources[:1], rng())) is None
    assert founder_name(sources[0].replace(made={"refined": {}})) is None
    assert founder_name(sources[0].replace(made={"operator": "source"})) == NEW_YORK


def test_a_child_inherits_the_plan_of_the_source_city(sources, children):
    plan = plan_of(decoded(sources[0]).city)
    known = {NEW_YORK: sources[0], LYON: sources[1]}
    for child in children:
        state = state_of(child)
        assert (state.city, state.faces) == (NEW_YORK, len(plan))
        assert set(state.genes) == {gene["face"] for gene in child.made["genes"]}
        assert find_plan(child, known) == (plan, state)
    later = PlanFusion(faces=2)([children[0], *sources], rng(9))
    state = state_of(later)
    assert set(state.genes) >= set(state_of(children[0]).genes)
    assert {gene.source for gene in state.genes.values()} <= {NEW_YORK, LYON}
    assert plan_key(later.made) == NEW_YORK


def test_a_genome_file_keeps_the_plan(children, tmp_path):
    children[0].write(tmp_path / "child.parquet")
    again = evocity.read_genome(tmp_path / "child.parquet")
    assert again.made["plan"] == children[0].made["plan"]


def test_children_of_children_have_no_drift(sources, children):
    """Streets of the source city stay open, however often faces are filled."""
    child, plan = children[0], plan_of(decoded(sources[0]).city)
    for seed in range(4):
        child = PlanFusion(faces=3)([child, *sources], rng(seed))
    bred = decode(child).city
    outside = (plan.lots == 0) & ~decoded(sources[0]).city.built
    assert bred.built[plan.labels == 0].mean() <= 0.01
    assert bred.built[outside].mean() <= 0.01


def test_plan_return_gives_the_own_buildings_back(sources, children):
    plan = plan_of(decoded(sources[0]).city)
    back = PlanReturn(faces=None)([children[0], *sources], rng())
    state = state_of(back)
    assert back.made["faces"] == len(state_of(children[0]).genes)
    assert not state.genes
    assert not state.edited
    error = raw_heights(back) - raw_heights(sources[0])
    assert np.sqrt(np.mean(error**2)) <= 1.0
    assert np.sqrt(np.mean(error[plan.lots > 0] ** 2)) <= 1.0
    bred = raw_heights(children[0]) - raw_heights(sources[0])
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.sqrt(np.mean(bred**2))


def test_plan_return_leaves_a_founder_as_it_is(sources):
    child = PlanReturn()([sources[0], *sources], rng())
    assert child.made["faces"] == 0
    assert child == sources[0]


@pytest.mark.parametrize("neighbourhood", [0, 1])
def test_crossing_a_parent_with_itself_gives_the_parent(sources, children, neighbourhood):
    operator = PlanCrossing(neighbourhood=neighbourhood)
    child = operator([children[0], children[0], *sources], rng())
    assert child == children[0]
    assert child.made["plan"] == children[0].made["plan"]


@pytest.mark.parametrize("neighbourhood", [0, 1])
def test_crossing_exchanges_whole_faces(sources, children, neighbourhood):
    plan = plan_of(decoded(sources[0]).city)
    operator = PlanCrossing(share=1.0, neighbourhood=neighbourhood, repeats=1.0)
    child = operator([*children, *sources], rng())
    draft = operator.draft([*children, *sources], rng())
    second = raw_heights(children[1])
    first, other = (state_of(one).genes for one in children)
    differing = {face for face in {*first, *other} if first.get(face) != other.get(face)}
    assert child.made["faces"] == len(differing)
    assert state_of(child).genes == other
    lots = np.isin(plan.lots, sorted(differing))
    assert np.array_equal(draft.intended[lots], second[lots])
    assert np.array_equal(draft.intended[~lots], raw_heights(children[0])[~lots])
    none = PlanCrossing(share=0.0)([*children, *sources], rng())
    assert none == children[0]


def test_crossing_repeats_no_place(sources, children):
    """A face whose buildings stand elsewhere on the first parent does not come."""
    plan = plan_of(decoded(sources[0]).city)
    child = PlanCrossing(share=1.0, repeats=0.01)([*children, *sources], rng())
    lyon = decoded(sources[1]).city
    used = np.zeros(lyon.shape, np.int64)
    for face, gene in state_of(child).genes.items():
        lot = Lot(plan, face)
        built = decoded(child).city.built[lot.window][lot.mask]
        rows, columns = (np.rint(at[built]).astype(int) for at in places_of(lot, gene, lyon))
        here = np.zeros_like(used, bool)
        here[rows, columns] = True
        used += here
    assert (used > 1).sum() <= 0.03 * (used > 0).sum()


def test_crossing_different_plans_fills_faces(sources, children):
    other = PlanFusion(faces=3)([sources[1], *sources], rng(5))
    child = PlanCrossing(faces=2)([children[0], other, *sources], rng())
    state = state_of(child)
    assert state.city == NEW_YORK
    assert child.made["faces"] == 2
    assert len(child.made["genes"]) == 2
    alone = PlanCrossing()(sources, rng())
    assert state_of(alone).city == NEW_YORK


def test_a_neighbourhood_hangs_together(sources):
    plan = plan_of(decoded(sources[0]).city)
    faces = np.arange(1, len(plan) + 1)
    beside = {tuple(pair) for pair in plan.neighbours.tolist()}
    for seed in range(20):
        grown = grow_neighbourhood(plan, faces, 0.4, rng(seed))
        assert len(set(grown)) == len(grown) <= round(0.4 * len(plan))
        for at, face in enumerate(grown[1:], 1):
            assert any(tuple(sorted((face, one))) in beside for one in grown[:at])
    assert grow_neighbourhood(plan, [], 0.4, rng()) == []
    assert grow_neighbourhood(plan, faces, 0.0, rng()) == []


def test_only_operators_that_keep_streets_pass_a_plan_on(sources, children):
    keeping = {name for name, kind in OPERATORS.items() if getattr(kind, "keeps_streets", False)}
    assert keeping == {"height_scaling", "height_field", "mutation"}
    for name, kind in OPERATORS.items():
        assert issubclass(kind, Drafting)
        operator = kind()
        count = operator.parents[0]
        parents = [children[0], *children[1:], *sources][: max(count, 1)]
        child = operator(parents, rng())
        kept = plan_key(child.made)
        if name in keeping or (issubclass(kind, PlanDrafting) and count > 1):
            assert kept in (NEW_YORK, None)
        assert (kept is not None) == (name in keeping), name


def test_touched_faces_are_edited(sources, children):
    known = {NEW_YORK: sources[0], LYON: sources[1]}
    plan = plan_of(decoded(sources[0]).city)
    scaled = HeightScaling(share=0.3)([children[0]], rng(3))
    state = state_of(scaled)
    assert state.genes == state_of(children[0]).genes
    _, settled = find_plan(scaled, known)
    step = np.abs(raw_heights(scaled) - raw_heights(children[0])) > 1
    changed = np.bincount(plan.labels[step], minlength=len(plan) + 1)
    assert settled.edited
    assert all(changed[face] for face in settled.edited)
    assert {face for face in range(1, len(changed)) if changed[face] > 40} <= settled.edited
    refilled = PlanFusion(faces=None)([scaled, *sources], rng(4))
    laid = {gene["face"] for gene in refilled.made["genes"]}
    assert state_of(refilled).edited == settled.edited - laid


def test_a_child_of_other_operators_may_keep_streets(sources):
    known = {NEW_YORK: sources[0], LYON: sources[1]}
    plan = plan_of(decoded(sources[0]).city)
    scaled = HeightScaling()(sources[:1], rng())
    assert "plan" not in scaled.made
    found, state = find_plan(scaled, known)
    assert found is plan
    assert state.edited
    assert not state.genes
    refilled = QuarterRefill(street_blocks=1)([sources[0], *sources], rng())
    assert find_plan(refilled, known)[1].city == NEW_YORK
    mixed = PavementFusion(fill=0.5, tolerance=100)(sources, rng())
    found, state = find_plan(mixed, known)
    assert state is None
    child = PlanFusion()([mixed, *sources], rng())
    assert "plan" not in child.made
    assert child.made["faces"] >= 1


def test_a_plan_without_its_founder_is_looked_for(sources, children):
    plan, state = find_plan(children[0], {LYON: sources[1]})
    assert state is None
    child = PlanFusion()([children[0], sources[1]], rng())
    assert "plan" not in child.made
    assert len(plan) > 3


def test_locked_faces_stay(sources, children):
    city = decoded(sources[0]).city
    mask = np.zeros(city.shape, bool)
    mask[:, : city.shape[1] // 2] = True
    layer = Condensation.cut(city, mask)
    parents = [one.replace(condensation=layer) for one in (*children, *sources)]
    plan = plan_of(decoded(sources[0]).city)
    crossed = PlanCrossing(share=1.0, repeats=1.0)(parents, rng())
    step = np.abs(raw_heights(crossed) - raw_heights(parents[0])) > 1
    assert not step[mask].any()
    held = set(np.unique(plan.labels[mask]).tolist())
    before, after = (state_of(one).genes for one in (children[0], crossed))
    for face in held:
        assert before.get(face) == after.get(face)


_ALL = PlanFusion(), PlanCrossing(), PlanSpread(), PlanReturn(), PlanStoreys(), Mutation()


def test_replay_is_bit_for_bit(sources, children):
    for operator in _ALL:
        parents = [*children, *sources] if operator.parents[1] is None else children[:1]
        one, two = (operator(parents, rng(11)) for _ in range(2))
        assert one == two
        assert one.made == two.made


def test_plan_spread_continues_a_neighbour(sources, children):
    plan = plan_of(decoded(sources[0]).city)
    beside = {tuple(pair) for pair in plan.neighbours.tolist()}
    before = state_of(children[0]).genes
    child = PlanSpread(faces=3, repeats=0.05)([children[0], *sources], rng(2))
    laid = [FaceGene(**gene) for gene in child.made["genes"]]
    assert 1 <= child.made["faces"] == len(laid) <= 3
    known = dict(before)
    for gene in laid:
        near = [one for face, one in known.items() if tuple(sorted((face, gene.face))) in beside]
        assert any(alike(gene, one) for one in near)
        known[gene.face] = gene
    assert state_of(child).genes == known


def test_a_continued_gene_shows_the_place_between(sources, children):
    """A gene and the gene that continues it show the same place for a point of the map."""
    plan = plan_of(decoded(sources[0]).city)
    for gene in state_of(children[0]).genes.values():
        for face in (1, len(plan)):
            other = continue_gene(plan, gene, face)
            here = np.array([20.0, 70.0])
            places = []
            for one in (gene, other):
                offsets = (here - plan.centre[one.face - 1]) * plan.metres_per_pixel
                down, along = one.offsets(*offsets)
                places.append([one.row + down / 2, one.column + along / 2])
            assert np.allclose(*places)


def test_plan_spread_needs_a_gene(sources):
    child = PlanSpread()([sources[0], *sources], rng())
    assert child.made["faces"] == 0
    assert child == sources[0]


def test_plan_storeys_keeps_to_the_heights_around(sources, children):
    plan = plan_of(decoded(sources[0]).city)
    parent = decoded(children[0]).city
    high = np.percentile(parent.buildings.height, 95)
    operator = PlanStoreys(faces=None)
    child = operator([children[0], *sources], rng(0))
    draft = operator.draft([children[0], *sources], rng(0))
    assert child.made["faces"] >= 1
    assert child.made["buildings"] >= child.made["faces"]
    step = np.abs(draft.intended - raw_heights(children[0]))
    changed = set(np.unique(plan.lots[step > 0.5]).tolist()) - {0}
    assert len(changed) == child.made["faces"]
    state, before = state_of(child), state_of(children[0])
    assert set(state.genes) == set(before.genes)
    for face in changed:
        assert face in state.edited or state.genes[face].highest is not None
    assert state.edited >= changed - set(state.genes)
    assert np.array_equal(draft.intended > 1.5, raw_heights(children[0]) > 1.5)
    assert (draft.intended > high + 1).sum() <= (raw_heights(children[0]) > high + 1).sum()
    assert np.sqrt(np.mean((raw_heights(child) - draft.intended) ** 2)) <= 1.5


@given(st.floats(0, 20), st.floats(0, 20), st.lists(st.floats(0, 60, width=32), max_size=9))
def test_a_gene_clamps_heights(low, more, values):
    heights = np.array(values, np.float32)
    gene = FaceGene(1, "a", 0, 0, 0.0, lowest=low, highest=low + more + 2)
    clamped = gene.clamp(heights)
    assert np.array_equal(clamped == 0, heights == 0) or low == 0
    assert (clamped <= np.float32(low + more + 2)).all()
    assert (clamped[heights > 0] >= np.float32(low)).all()
