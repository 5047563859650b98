"""Whole buildings and true maps: what a child keeps."""

import math

import naive
import numpy as np
import pytest
from towns import draw_town

from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.errors import FitnessError
from evocity.fitness._kernels import mark_whole
from evocity.fitness.heredity import _footings, heritability, integrity, integrity_of
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
    assert integrity_of(two_houses, [two_houses]) == 1
    assert integrity_of(two_houses, [one_house, two_houses]) == 1


def test_cut_buildings_are_not_whole(two_houses, one_house):
    owner = np.zeros((8, 8), int)
    owner[:2] = 1  # takes away the upper half of the larger house
    child = assembled([two_houses, one_house], owner.ravel())
    # left: lower half of the large house (32 px), the small one (32 px), nothing of b
    assert integrity_of(child, [two_houses, one_house]) == pytest.approx(32 / 64)
    owner[2:4, 5:] = 1  # half of b's house, rows 8…16
    child = assembled([two_houses, one_house], owner.ravel())
    assert integrity_of(child, [two_houses, one_house]) == pytest.approx((32 + 32) / (64 + 32))


def test_a_building_laid_elsewhere_is_whole(two_houses):
    rows = np.roll(np.arange(64).reshape(8, 8), 1, axis=1).ravel()  # one block to the east
    columns = {name: getattr(two_houses, name)[rows] for name in ("sigma", "beta", "dx", "dy")}
    columns |= {name: getattr(two_houses, name)[rows] for name in ("x", "y", "iso", "source")}
    moved = two_houses.replace(**columns, parent=two_houses.parent[rows])
    assert integrity_of(moved, [two_houses]) == 1


@pytest.mark.parametrize("seed", range(4))
def test_kernel_against_its_naive_twin(seed):
    rng = np.random.default_rng(seed)
    labels = rng.integers(-9, 4, (4, 5, 4)).clip(0)
    labels[rng.random((4, 5)) < 0.5] = 0
    stones = np.arange(20).reshape(4, 5)
    laid = rng.choice([-1, 30], (5, 6))
    laid[1:, 1:], laid[:3, 3:] = stones, stones[:3, :3]  # two copies, one over the other
    starts, members = _footings(labels.reshape(20, 4))
    whole = np.zeros((30, 4), bool)
    order = np.argsort(laid.ravel(), kind="stable")
    begins = stones.ravel()[members[starts[:-1]]]
    first, last = (np.searchsorted(laid.ravel()[order], begins, side) for side in ("left", "right"))
    mark_whole(
        starts, members, labels.reshape(20, 4), stones.ravel(), 5,
        order, first, last, laid.ravel(), 6, whole,
    )  # fmt: skip
    assert np.array_equal(whole.reshape(5, 6, 4), naive.mark_whole(labels, stones, laid))
    assert whole.any()


def test_the_measure_is_what_the_function_tells(two_houses, one_house):
    owner = np.zeros((8, 8), int)
    owner[:2] = 1
    parents = [two_houses, one_house]
    child = assembled(parents, owner.ravel())
    city = decode(child).city
    assert integrity(city, genome=child, parents=parents) == integrity_of(child, parents)
    bare = hamlet("bare")
    assert integrity(decode(bare).city, genome=bare, parents=[bare]).reason


def test_parents_that_share_stones_count_once(two_houses):
    empty = hamlet("empty")
    owner = np.zeros((8, 8), int)
    owner[:2] = 1
    child = assembled([two_houses, empty], owner.ravel())
    for parents in ([two_houses, empty], [two_houses, empty, two_houses]):
        assert integrity_of(child, parents) == pytest.approx(32 / 64)
    twice = make("relocation", mode="copy", shape="square", repair=None, tolerance=None)
    copied = twice([encode(draw_town(1)).genome], np.random.default_rng(0))
    assert integrity_of(copied, [copied]) == 1


def test_bare_ground_has_no_integrity(two_houses):
    bare = hamlet("bare")
    assert math.isnan(integrity_of(bare, [bare]))


def test_a_stranger_among_the_stones_is_told(two_houses, one_house):
    with pytest.raises(FitnessError, match="64 lifs from a"):
        integrity_of(two_houses, [one_house])


def test_smaller_macro_blocks_cut_more():
    parents = [encode(draw_town(seed, side=128)).genome for seed in (1, 2)]
    kept = {
        size: np.mean(
            [
                integrity_of(fusion(parents, np.random.default_rng(seed)), parents)
                for seed in range(3)
            ]
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
