"""Buildings of changed plans: moved genes keep buildings in place, fresh faces fit their lots."""

import dataclasses

import numpy as np
import pytest

import evocity
from evocity.citymap import BUILT_ABOVE
from evocity.fitness import street_distance
from evocity.operators.plans import (
    FaceGene,
    apply_changes,
    draw_change,
    fill_face,
    plan_of,
    renumbering,
)
from evocity.operators.plans.donor import donor_of
from evocity.operators.plans.laying import Lot, lay_piece
from evocity.operators.plans.rebuilding import move_gene, own_gene, rebuild

LYON, NEW_YORK = NAMES = "lyon-1er", "new-york-west-village"


@pytest.fixture(scope="module")
def cities():
    return {name: evocity.read_map(name) for name in NAMES}


@pytest.fixture(scope="module")
def plans(cities):
    return {name: plan_of(city) for name, city in cities.items()}


def filler(cities, rng):
    def fill(plan, face):
        results = (fill_face(plan, face, city, rng) for city in cities.values())
        return next((result for result in results if result is not None), None)

    return fill


def assert_rebuilt(old, rebuilt, heights, cities):
    plan, fresh = rebuilt.plan, sorted(rebuilt.fresh)
    kept = renumbering(old, plan)
    same = np.isin(old.lots, list(kept))
    assert np.array_equal(rebuilt.heights[same], heights[same])
    built = rebuilt.heights > BUILT_ABOVE
    changed = np.isin(plan.labels, fresh)
    assert not (built & changed & (plan.lots == 0)).any()
    for face in fresh:
        if plan.open[face - 1]:
            assert not (built & (plan.labels == face)).any()
            continue
        lot, gene = Lot(plan, face), rebuilt.genes[face]
        assert gene.face == face
        laid = lay_piece(lot, gene, donor_of(cities[gene.source]))
        assert np.array_equal(rebuilt.heights[lot.window][lot.mask], laid)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", [0, 1])
def test_twelve_changes_keep_the_streets_of_the_city(cities, plans, name, seed):
    rng, plan = np.random.default_rng(seed), plans[name]
    heights, genes, edited, done = plan.heights, {}, frozenset(), 0
    for _ in range(40):
        change = draw_change(("alley", "closing", "width")[rng.integers(3)], plan, rng)
        if change is None:
            continue
        result = rebuild(
            plan, apply_changes(plan, [change]), heights, genes, cities,
            city=name, edited=edited, fill=filler(cities, rng),
        )  # fmt: skip
        if result is None:
            continue
        assert_rebuilt(plan, result, heights, cities)
        plan, heights, genes, edited = result.plan, result.heights, result.genes, result.edited
        done += 1
        if done in (1, 4, 12):
            bred = cities[name].replace(heights)
            assert -0.05 <= street_distance(bred, reference=cities[name]) <= 0.05
        if done == 12:
            return
    pytest.fail(f"{done} changes of 12")


@pytest.mark.parametrize(("first", "second"), [NAMES, NAMES[::-1]])
def test_a_seam_has_the_buildings_of_both_cities(cities, plans, first, second):
    plan, pool = plans[first], {second: plans[second]}
    change = draw_change("seam", plan, np.random.default_rng(1), pool)
    new = apply_changes(plan, [change], pool)
    fresh = set(range(1, len(new) + 1)) - set(renumbering(plan, new).values())
    beyond = {face: own_gene(new, face, second) for face in fresh}
    result = rebuild(plan, new, plan.heights, {}, cities, city=first, beyond=beyond)
    assert_rebuilt(plan, result, plan.heights, cities)
    assert {gene.source for gene in result.genes.values()} == {second}
    bred = cities[first].replace(result.heights)
    assert street_distance(bred, reference=list(cities.values())) < 0.06
    built = (result.heights > BUILT_ABOVE).mean()
    assert abs(built - (new.heights > BUILT_ABOVE).mean()) < 0.03


def test_alleys_keep_buildings_in_place(cities, plans):
    plan, done = plans[LYON], 0
    for seed in range(12):
        new = apply_changes(plan, [draw_change("alley", plan, np.random.default_rng(seed))])
        result = rebuild(plan, new, plan.heights, {}, cities, city=LYON)
        if result is None:  # a wall of the court would stand along the alley
            continue
        done += 1
        for face in result.fresh:
            lot = new.lots == face
            before, after = (some > BUILT_ABOVE for some in (plan.heights, result.heights))
            assert (lot & before & after).sum() > 0.8 * (lot & before).sum()
            both = lot & before & after
            assert np.median(np.abs(plan.heights - result.heights)[both]) < 1.5
    assert done >= 2


@pytest.mark.parametrize("mirror", [False, True])
def test_a_moved_gene_lays_the_same_buildings(cities, plans, mirror):
    plan = plans[NEW_YORK]
    new = apply_changes(plan, [draw_change("alley", plan, np.random.default_rng(1))])
    old_face = new.changes[0]["face"]
    gene = FaceGene(old_face, LYON, 120.0, 130.0, 0.7, mirror, 1.1)
    for face in sorted(set(range(1, len(new) + 1)) - set(renumbering(plan, new).values())):
        moved, lot, whole = move_gene(gene, plan, new, face), Lot(new, face), Lot(plan, old_face)
        at = [row[0] + lot.window[axis].start for axis, row in enumerate((lot.rows, lot.columns))]
        first = moved.offsets(lot.down[:1], lot.along[:1])
        here = [
            (at[axis] - plan.centre[old_face - 1][axis]) * plan.metres_per_pixel for axis in (0, 1)
        ]
        second = gene.offsets(*(np.array([one]) for one in here))
        pixel = whole.pixel
        assert moved.row + first[0] / pixel == pytest.approx(gene.row + second[0] / pixel)
        assert moved.column + first[1] / pixel == pytest.approx(gene.column + second[1] / pixel)


def test_a_change_is_taken_back_where_nothing_fits(cities, plans):
    plan = plans[LYON]
    new = apply_changes(plan, [draw_change("alley", plan, np.random.default_rng(4))])
    edited = frozenset(range(1, len(plan) + 1))
    assert rebuild(plan, new, plan.heights, {}, cities, city=LYON, edited=edited) is None
    filled = rebuild(
        plan, new, plan.heights, {}, cities, city=LYON, edited=edited,
        fill=lambda changed, face: (
            FaceGene(face, LYON, 0.0, 0.0, 0.0),
            np.zeros(int((changed.lots == face).sum()), np.float32),
        ),
    )  # fmt: skip
    assert filled.edited == frozenset(renumbering(plan, new).values())
    assert dataclasses.is_dataclass(filled)
