"""Collage repair of codes on leaves: what strays is split and matched again, and nothing else."""

from functools import cache

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import draw_pavement
from towns import draw_town

from evocity import isometries
from evocity.coding import decode, encode
from evocity.condensation import Condensation
from evocity.genome import NUCLEOTIDES, Genome, refined
from evocity.operators import collage_repair
from evocity.operators._kernels import find_strays
from evocity.operators.pavement_fusion import DirectFusion, PavementFusion
from evocity.pavement import Pavement, common_refinement


@cache
def coded(seed: int, finest: int = 2, root: int = 16, lifs: int | None = None, side=64) -> Genome:
    how = {"block": (finest, root), "lifs": lifs, "fit": False, "settle": False}
    return encode(draw_town(seed, side=side), **how).genome


@cache
def crossed(seed: int) -> tuple[Genome, np.ndarray]:
    """A child whose lifs read what now stands where their domains lay; and what is meant."""
    draft = PavementFusion(tolerance=100).draft([coded(1), coded(2)], np.random.default_rng(seed))
    return draft.genome, draft.intended


def raw(genome: Genome) -> np.ndarray:
    return np.maximum(decode(genome).attractor, 0)


def errors(genome: Genome, intended: np.ndarray) -> np.ndarray:
    """Root mean square error of each leaf, metres: one by one."""
    gap = (raw(genome).astype(float) - intended) ** 2
    top, left = genome.pavement.corners
    places = zip(top.tolist(), left.tolist(), genome.pavement.side.tolist(), strict=True)
    return np.array([np.sqrt(gap[y : y + s, x : x + s].mean()) for y, x, s in places])


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32), threshold=st.sampled_from([0.2, 0.5, 2.0]))
def test_the_child_comes_closer_to_what_is_meant(seed, threshold):
    child, intended = crossed(seed)
    repaired, count = collage_repair(child, intended, threshold=threshold)
    before, after = (np.sqrt(np.mean((raw(one) - intended) ** 2)) for one in (child, repaired))
    assert after <= before
    strayed = errors(child, intended) > threshold
    if strayed.any():
        assert count > 0
        assert after < 0.5 * before
    # nearly all range blocks come to be within the threshold
    area = repaired.pavement.area
    assert area[errors(repaired, intended) > threshold].sum() < 0.1 * area.sum()


@pytest.mark.parametrize("seed", range(3))
def test_lifs_are_split_only_where_they_strayed(seed):
    child, intended = crossed(seed)
    strayed = errors(child, intended) > 0.5
    assert 0 < strayed.mean() < 1
    repaired, _ = collage_repair(child, intended, threshold=0.5, rounds=1)
    assert common_refinement([child.pavement, repaired.pavement]) == repaired.pavement
    within = child.pavement.index[repaired.pavement.corners]
    split = child.pavement.side[within] > repaired.pavement.side
    assert split.any()
    # a leaf of 8 or 16 px can be within the threshold while a part of 4 px of it strays
    parts = Pavement(64, 64, 4)
    gap = parts.blocks((raw(child).astype(float) - intended) ** 2).mean(axis=(1, 2))
    wrong = np.where(
        child.pavement.raster(child.pavement.side) > 4,
        parts.raster(np.sqrt(gap) > 0.5),
        child.pavement.raster(strayed),
    )
    touched = np.zeros(len(child), bool)
    touched[child.pavement.index[wrong]] = True
    assert touched[within[split]].all()
    # and what did not stray is the same code, lifs by lifs
    kept = ~touched[within]
    same = refined(child, repaired.pavement)
    for name in NUCLEOTIDES:
        assert np.array_equal(getattr(repaired, name)[kept], getattr(same, name)[kept])
    for name in ("parent", "source", "turn"):  # whose stone it should be is never forgotten
        assert np.array_equal(getattr(repaired, name), getattr(same, name))


@pytest.mark.parametrize("seed", range(3))
def test_a_lifs_matched_again_is_the_best_of_its_side(seed):
    """In one round each is what an exact search on the map that is meant finds."""
    child, intended = crossed(seed)
    repaired, _ = collage_repair(child, intended, threshold=0.5, rounds=1, reach=6)
    pavement, same = repaired.pavement, refined(child, repaired.pavement)
    matched = [
        i
        for i in range(len(repaired))
        if any(getattr(repaired, name)[i] != getattr(same, name)[i] for name in NUCLEOTIDES)
    ]
    assert len(matched) > 20
    heights = intended.astype(float)
    for i in matched[:: len(matched) // 20]:
        side = int(pavement.side[i])
        y, x = (int(corner[i]) for corner in pavement.corners)
        part = heights[y : y + side, x : x + side]
        best = naive.best_match(heights, side, (y, x), (2,), 6, part, 0.9)
        laid = np.full((side, side), float(repaired.beta[i]))
        if repaired.dx[i]:
            domain = naive.shrunk(heights, repaired.y[i], repaired.x[i], 2, 2, side)
            laid += repaired.sigma[i] * isometries.apply(int(repaired.iso[i]), domain)
        energy = ((part - part.mean()) ** 2).sum()
        left = energy - (0 if best is None else best[0])
        assert ((laid - part) ** 2).sum() == pytest.approx(left, abs=1e-3 + 1e-4 * energy)


def test_leaves_are_no_finer_than_the_code_had():
    parents = [coded(seed, finest=4) for seed in (1, 2)]
    assert {parent.pavement.finest for parent in parents} == {4}
    for seed in range(3):
        child = DirectFusion(repair=0.05)(parents, np.random.default_rng(seed))
        assert child.pavement.finest == 4
    draft = DirectFusion().draft(parents, np.random.default_rng(0))
    repaired, _ = collage_repair(draft.genome, draft.intended, threshold=1e-6, rounds=5)
    assert repaired.pavement.finest == 4
    finer = DirectFusion(repair=0.05)([coded(1), coded(2)], np.random.default_rng(0))
    assert finer.pavement.finest == 2


def test_any_threshold_returns_the_same_object():
    child, intended = crossed(0)
    same, count = collage_repair(child, intended, threshold=np.inf)
    assert same is child
    assert count == 0
    city = coded(1)
    same, count = collage_repair(city, raw(city), threshold=0.5)
    assert same is city
    assert count == 0


def test_what_is_condensed_is_kept_bit_for_bit():
    mask = np.zeros((64, 64), bool)
    mask[10:31, 22:50] = True
    layer = Condensation.cut(draw_town(9), mask)
    child, intended = crossed(1)
    child = child.replace(condensation=layer)
    repaired, count = collage_repair(child, intended, threshold=0.5)
    assert count
    assert repaired.condensation == layer
    assert np.array_equal(decode(repaired).city.heights[mask], layer.heights[mask])
    target = layer.laid(intended)
    before, after = (np.sqrt(np.mean((raw(one) - target) ** 2)) for one in (child, repaired))
    assert after < 0.5 * before


def test_sides_that_do_not_halve_to_4_px_are_matched_as_they_are():
    parents = [coded(seed, 3, 6, side=48) for seed in (1, 2)]
    child = DirectFusion(repair=0.2)(parents, np.random.default_rng(0))
    assert set(np.unique(child.pavement.side)) == {3, 6}
    draft = DirectFusion().draft(parents, np.random.default_rng(0))
    apart = [np.sqrt(np.mean((raw(one) - draft.intended) ** 2)) for one in (draft.genome, child)]
    assert apart[1] < 0.5 * apart[0]


def test_blocks_of_one_side_stay_so():
    parents = [uniformly(draw_town(seed), block=8).genome for seed in (1, 2)]
    draft = DirectFusion().draft(parents, np.random.default_rng(0))
    repaired, count = collage_repair(draft.genome, draft.intended, threshold=0.5)
    assert count
    assert repaired.pavement == parents[0].pavement


def test_the_count_is_of_lifs_that_were_matched():
    child, intended = crossed(2)
    repaired, count = collage_repair(child, intended, threshold=0.5, rounds=1)
    same = refined(child, repaired.pavement)
    changed = np.logical_or.reduce(
        [getattr(repaired, name) != getattr(same, name) for name in NUCLEOTIDES]
    )
    assert changed.sum() <= count <= len(repaired)


def test_codes_that_diverge_on_leaves_are_tamed():
    parents = [
        encode(draw_town(seed), block=(2, 16), sigma_max=np.inf, fit=False, settle=False).genome
        for seed in (2, 3)
    ]
    for seed in range(3):
        child = DirectFusion()(parents, np.random.default_rng(seed))
        decode(child)  # raises if it diverges
        assert np.isinf(child.sigma_max)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("grain", [2, 4, 16])
def test_strays_against_their_naive_twin(seed, grain):
    pavement, rng = draw_pavement(seed), np.random.default_rng(seed)
    intended = rng.uniform(0, 9, (pavement.height, pavement.width)).astype(np.float32)
    heights = intended + rng.normal(0, 0.5, intended.shape).astype(np.float32)
    ignored, where = rng.random(intended.shape) < 0.2, np.zeros(intended.shape, bool)
    squares = (*pavement.corners, pavement.side, grain, 0.25, ignored)
    find_strays(heights, intended, *squares, where)
    assert np.array_equal(where, naive.strays(heights, intended, *squares))
    assert where.any()
