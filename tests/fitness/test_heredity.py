"""Whole buildings and true maps: what a child keeps."""

import math

import numpy as np
import pytest
from towns import draw_town

from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.errors import FitnessError
from evocity.fitness.heredity import heritability, integrity
from evocity.operators import make
from evocity.operators.crossing import assembled


def hamlet(name, *footprints, side=32):
    """Genome of a map with buildings (top, left, tall, wide, height), px and m, coded exactly."""
    heights = np.zeros((side, side), np.float32)
    for top, left, tall, wide, height in footprints:
        heights[top : top + tall, left : left + wide] = height
    return encode(CityMap(heights, 2.0, name=name)).genome


@pytest.fixture(scope="module")
def two_houses():
    # on the pavement of B = 4: 4 lifs and 2 lifs
    return hamlet("a", (4, 4, 8, 8, 9), (20, 8, 4, 8, 12))


@pytest.fixture(scope="module")
def one_house():
    return hamlet("b", (8, 20, 8, 4, 6))


def test_a_parent_keeps_all_its_buildings(two_houses, one_house):
    assert integrity(two_houses, [two_houses]) == 1
    assert integrity(two_houses, [one_house, two_houses]) == 1


def test_cut_buildings_are_not_whole(two_houses, one_house):
    owner = np.zeros((8, 8), int)
    owner[:2] = 1  # takes away the upper half of the larger house
    child = assembled([two_houses, one_house], owner.ravel())
    # left: lower half of the large house (32 px), the small one (32 px), nothing of b
    assert integrity(child, [two_houses, one_house]) == pytest.approx(32 / 64)
    owner[2:4, 5:] = 1  # half of b's house, rows 8…16
    child = assembled([two_houses, one_house], owner.ravel())
    assert integrity(child, [two_houses, one_house]) == pytest.approx((32 + 32) / (64 + 32))


def test_a_building_laid_elsewhere_is_whole(two_houses):
    rows = np.roll(np.arange(64).reshape(8, 8), 1, axis=1).ravel()  # one block to the east
    columns = {name: getattr(two_houses, name)[rows] for name in ("sigma", "beta", "dx", "dy")}
    columns |= {name: getattr(two_houses, name)[rows] for name in ("x", "y", "iso", "source")}
    moved = two_houses.replace(**columns, parent=two_houses.parent[rows])
    assert integrity(moved, [two_houses]) == 1


def test_parents_that_share_stones_count_once(two_houses):
    empty = hamlet("empty")
    owner = np.zeros((8, 8), int)
    owner[:2] = 1
    child = assembled([two_houses, empty], owner.ravel())
    for parents in ([two_houses, empty], [two_houses, empty, two_houses]):
        assert integrity(child, parents) == pytest.approx(32 / 64)
    twice = make("relocation", mode="copy", shape="square", repair=None, tolerance=None)
    copied = twice([encode(draw_town(1)).genome], np.random.default_rng(0))
    assert integrity(copied, [copied]) == 1


def test_bare_ground_has_no_integrity(two_houses):
    bare = hamlet("bare")
    assert math.isnan(integrity(bare, [bare]))


def test_a_stranger_among_the_stones_is_told(two_houses, one_house):
    with pytest.raises(FitnessError, match="64 lifs from a"):
        integrity(two_houses, [one_house])


def test_smaller_macro_blocks_cut_more():
    parents = [encode(draw_town(seed, side=128)).genome for seed in (1, 2)]
    kept = {
        size: np.mean(
            [integrity(fusion(parents, np.random.default_rng(seed)), parents) for seed in range(3)]
        )
        for size in (2, 12)
        for fusion in [make("pavement_fusion", size_min=size, size_max=size, tolerance=50.0)]
    }
    assert kept[2] < kept[12] < 1


def test_repair_makes_children_true_to_what_was_meant():
    parents = [encode(draw_town(seed)).genome for seed in (1, 2)]
    fusion = make("pavement_fusion", tolerance=50.0)
    draft = fusion.draft(parents, np.random.default_rng(3))
    crumbled = heritability(draft.genome, draft.intended)
    repaired = heritability(fusion(parents, np.random.default_rng(3)), draft.intended)
    assert repaired.distance < crumbled.distance
    own = heritability(parents[0], decode(parents[0]).city.heights)
    assert (own.distance, own.crumbs) == (0, 0)
