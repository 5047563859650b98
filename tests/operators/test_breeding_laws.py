"""Laws every operator obeys, and the special cases of each."""

import naive
import numpy as np
import pytest
import skimage.data
from codes import stones, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import OperatorError
from evocity.genome import FIELDS, Genome
from evocity.operators import (
    OPERATORS,
    AsymmetricFusion,
    BlockExchange,
    DirectFusion,
    GeneCopy,
    GeneExchange,
    HeightField,
    HeightScaling,
    Interpolation,
    LambdaCrossover,
    LambdaField,
    Mutation,
    PavementFusion,
    PlanChange,
    PlanCrossing,
    PlanFusion,
    PlanReturn,
    PlanSeam,
    PlanSpread,
    PlanStoreys,
    QuarterFusion,
    QuarterRefill,
    RegionFusion,
    Relocation,
    SymmetricFusion,
    make,
)
from evocity.operators._kernels import inject, outline_difference
from evocity.operators.lambda_crossover import interpolate
from evocity.operators.pavement_fusion import VOID


def lays_void(operator) -> bool:
    return bool(getattr(operator, "void", False) or getattr(operator, "lays_void", False))


@pytest.fixture(scope="module")
def genomes() -> list[Genome]:
    return [uniformly(draw_town(seed)).genome for seed in (1, 2, 3)]


VARIANTS = [
    PavementFusion(),
    PavementFusion(repair=None, size_min=1, tolerance=100),
    PavementFusion(void=True, fill=(0.3, 0.3, 0.4)),
    LambdaCrossover(),
    LambdaCrossover(blend=1.0, grain=1, repair=None),
    LambdaCrossover(blend=0.3, share=0.7),
    LambdaField(),
    LambdaField(side=2, values=(0.9, 0.1, 0.5, 1), repair=None, density=0.1, area_min=0),
    RegionFusion(),
    RegionFusion(repair=None, cut=1.0, tolerance=100),
    RegionFusion(isometries=True, tolerance=100),
    QuarterFusion(),
    QuarterFusion(repair=None, density=0.1, area_min=0),
    QuarterFusion(street_blocks=2, void=True, widened=4.0, facades=1.0, density=0),
    QuarterRefill(),
    QuarterRefill(repair=None, street_blocks=9, density=0.1, area_min=0, spread=0.1),
    PlanFusion(),
    PlanFusion(repair=None, faces=None, repeats=1.0, area_min=0, loss=1.0, slack=1.0),
    PlanChange(),
    PlanChange(changes=4, repair=None, repeats=1.0),
    PlanSeam(),
    PlanSeam(repair=None, loss=1.0, slack=1.0),
    PlanCrossing(),
    PlanCrossing(repair=None, share=1.0, neighbourhood=1.0, faces=None, area_min=0),
    PlanReturn(),
    PlanSpread(),
    PlanSpread(repair=None, faces=None, repeats=1.0, area_min=0, loss=1.0, slack=1.0),
    PlanStoreys(),
    PlanStoreys(repair=None, faces=None, near=3),
    DirectFusion(),
    DirectFusion(fill=0.2, repair=None),
    AsymmetricFusion(),
    AsymmetricFusion(isometries=True, repair=None),
    SymmetricFusion(),
    SymmetricFusion(choose=False, share=0.3, isometries=True, repair=None),
    Interpolation(),
    Interpolation(share=0.8, repair=None),
    Interpolation(stepwise=True),
    GeneCopy(rate=0.5),
    GeneCopy(rate=1.0, group=1, tolerance=None, repair=None),
    GeneExchange(rate=0.5),
    GeneExchange(rate=1.0, group=1, tolerance=None, repair=None),
    BlockExchange(),
    BlockExchange(count=9, tolerance=None, repair=None),
    HeightScaling(),
    HeightField(),
    HeightField(side=2, values=(0.5, 2, 1, 1.4), repair=None),
    HeightScaling(what="buildings", share=0.5, factors=(0.4, 2.5), repair=None),
    Relocation(),
    Relocation(mode="copy", shape="square", tolerance=None, repair=None),
    Relocation(isometries=True),
    Mutation(),
    Mutation(group=1, sigma=1, beta=1, x=1, y=1, dx=1, dy=1, iso=1, repair=None, move=80),
]


#: Operators that lay a stone elsewhere than where it stood, with any parameters.
MOVING = (
    PlanChange,
    PlanCrossing,
    PlanFusion,
    PlanReturn,
    PlanSeam,
    PlanSpread,
    PlanStoreys,
    QuarterFusion,
    QuarterRefill,
    LambdaField,
    AsymmetricFusion,
    SymmetricFusion,
    GeneCopy,
    GeneExchange,
    BlockExchange,
    Relocation,
)


def moves(operator) -> bool:
    return isinstance(operator, MOVING) or getattr(operator, "isometries", False)


def renews(operator) -> bool:
    """Whether a city bred with itself gives another: by void, or a part of it elsewhere, turned."""
    turned = isinstance(operator, RegionFusion) and operator.isometries
    return operator.parents[0] == 1 or lays_void(operator) or turned


def test_every_operator_is_held_to_the_laws():
    assert {operator.name for operator in VARIANTS} == set(OPERATORS)


def parents_for(operator, genomes):
    return genomes[: operator.parents[0]]


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, genomes, seed):
    parents = parents_for(operator, genomes)
    before = [parent.digest for parent in parents]
    child = operator(parents, np.random.default_rng(seed))  # bounds are checked by Genome
    assert [parent.digest for parent in parents] == before
    assert operator(parents, np.random.default_rng(seed)) == child
    assert child.made["operator"] == operator.name
    assert decode(child).converged
    truth = {city: parent for parent in parents for city in parent.cities}
    names = np.array(child.cities)[child.parent]
    assert set(names) <= set(truth) | {VOID}
    known = {
        (parent.cities[city], stone)
        for parent in parents
        for city, stone in zip(parent.parent, stones(parent), strict=True)
    }
    assert {
        (name, stone) for name, stone in zip(names, stones(child), strict=True) if name != VOID
    } <= known
    if not moves(operator):
        assert np.array_equal(stones(child), np.arange(len(child)))
    for parent in parents:
        for line in parent.attribution.split("; "):
            assert line in child.attribution


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
def test_a_city_bred_with_itself_gives_itself(operator, genomes):
    if renews(operator):
        pytest.skip("changes a lone parent by design")
    child = operator([genomes[0]] * operator.parents[0], np.random.default_rng(0))
    assert child == genomes[0]


@pytest.mark.parametrize("fill", [0, 1])
def test_fill_of_nothing_or_all_gives_a_parent(genomes, fill):
    child = PavementFusion(fill=fill)(genomes[:2], np.random.default_rng(0))
    assert child == genomes[fill]


@pytest.mark.parametrize("blend", [0, 0.5, 1])
@pytest.mark.parametrize("share", [0, 1])
def test_lambda_zero_and_one_give_a_parent(genomes, share, blend):
    child = LambdaCrossover(share=share, blend=blend)(genomes[:2], np.random.default_rng(0))
    assert child == genomes[1 - share]


def test_mutation_at_rate_zero_changes_nothing(genomes):
    still = dict.fromkeys(("sigma", "beta", "x", "y", "dx", "dy", "iso"), 0)
    assert Mutation(**still)(genomes[:1], np.random.default_rng(0)) == genomes[0]


@pytest.mark.parametrize("name", ["sigma", "beta", "x", "y", "dx", "dy", "iso"])
def test_each_nucleotide_mutates_by_its_own_rate(genomes, name):
    rates = {
        other: float(other == name) for other in ("sigma", "beta", "x", "y", "dx", "dy", "iso")
    }
    child = Mutation(**rates, repair=None)(genomes[:1], np.random.default_rng(0))
    changed = {
        field
        for field in FIELDS
        if not np.array_equal(getattr(child, field), getattr(genomes[0], field))
    }
    # a longer domain near the edge is pushed back inside the map
    assert changed - {"dx": {"x"}, "dy": {"y"}}.get(name, set()) == {name}
    assert np.array_equal(child.uniform, genomes[0].uniform)


def test_provenance_names_the_lifs_a_block_came_from(genomes):
    child = PavementFusion(repair=None, tolerance=100)(genomes, np.random.default_rng(1))
    by_name = {genome.cities[0]: genome for genome in genomes}
    for i in range(len(child)):
        stone = by_name[child.cities[child.parent[i]]]
        for name in ("sigma", "beta", "x", "y", "dx", "dy", "iso"):
            assert getattr(child, name)[i] == getattr(stone, name)[stones(child)[i]]


def test_fill_is_reached_within_the_margin_or_the_shortfall_told(genomes):
    for seed in range(5):
        fusion = PavementFusion(fill=0.4, margin=0.05, tolerance=100)
        child = fusion(genomes[:2], np.random.default_rng(seed))
        reached = np.bincount(child.parent, minlength=2) / len(child)
        assert child.made["fill_reached"] == pytest.approx(reached, abs=1e-4)
        assert reached[1] == pytest.approx(0.4, abs=0.05)
    strict = PavementFusion(fill=0.4, tolerance=0)(genomes[:2], np.random.default_rng(0))
    assert strict.made["fill_reached"][1] < 0.35


def test_every_parent_has_its_turn():
    parents = [uniformly(draw_town(seed)).genome for seed in range(5)]
    for sizes in ({"size_min": 4, "size_max": 4}, {"size_min": 3, "size_max": 4}):
        fusion = PavementFusion(tolerance=100, repair=None, **sizes)
        child = fusion(parents, np.random.default_rng(0))
        assert min(child.made["fill_reached"]) > 0


@pytest.mark.parametrize("name", sorted(OPERATORS))
def test_codes_without_a_cap_are_mended(name):
    parents = [uniformly(draw_town(seed), sigma_max=np.inf).genome for seed in (2, 3)]
    operator = make(name)
    for seed in range(3):
        child = operator(parents[: operator.parents[0]], np.random.default_rng(seed))
        decode(child)  # raises if it diverges


def pattern_of(kind):
    y, x = np.mgrid[:64, :64]
    return {
        "camera": skimage.data.camera()[::8, ::8] / 8.0,
        "circles": 10 + 10 * np.sin(np.hypot(y - 31, x - 33) / 2),
        "chessboard": 12.0 * ((y // 9 + x // 9) % 2),
        "concentric town": 9.0 * (np.hypot(y - 31, x - 33) % 14 > 5),
        "chessboard town": 9.0 * ((y % 16 > 4) & (x % 16 > 4)),
    }[kind]


@pytest.mark.parametrize("name", sorted(OPERATORS))
@pytest.mark.parametrize(
    ("one", "other"),
    [("camera", None), ("circles", "chessboard"), ("concentric town", "chessboard town")],
)
def test_the_papers_own_patterns(genomes, name, one, other):
    """Robustness: whatever the parents are, breeding ends well and the child decodes."""
    first = uniformly(CityMap(pattern_of(one), 2.0, name=one)).genome
    second = uniformly(CityMap(pattern_of(other), 2.0, name=other)).genome if other else genomes[0]
    for repair in (0.5, None):
        operator = make(name, repair=repair)
        few = [first, second][: operator.parents[0]]
        child = operator(few, np.random.default_rng(1))
        assert decode(child).converged


def test_stitched_map_is_cut_from_the_parents(genomes):
    fusion = PavementFusion(tolerance=50)
    draft = fusion.draft(genomes, np.random.default_rng(3))
    owner = draft.genome.parent.reshape(16, 16)
    maps = np.stack([decode(genome).city.heights for genome in genomes])
    y, x = np.mgrid[:64, :64]
    assert np.array_equal(draft.intended, maps[owner.repeat(4, 0).repeat(4, 1), y, x])


def test_larger_tolerance_and_smaller_macro_blocks_mix_more(genomes):
    """Paper 000 §4.4: counted as sides of range blocks that lie between two owners."""

    def seams(tolerance, size):
        total = 0
        for seed in range(4):
            fusion = PavementFusion(
                size_min=size, size_max=size, tolerance=tolerance, fill=0.5, margin=0, repair=None
            )
            owner = fusion(genomes[:2], np.random.default_rng(seed)).parent.reshape(16, 16)
            total += (owner[1:] != owner[:-1]).sum() + (owner[:, 1:] != owner[:, :-1]).sum()
        return total

    assert seams(100, 1) > seams(100, 2) > seams(100, 6)
    assert seams(100, 2) > seams(4, 2) > seams(1, 2)


def test_repair_brings_the_child_to_the_stitched_map(genomes):
    generator = np.random.default_rng
    for seed in range(3):
        stitched = PavementFusion(tolerance=50).draft(genomes[:2], generator(seed)).intended
        errors = [
            np.abs(
                decode(
                    PavementFusion(tolerance=50, repair=repair)(genomes[:2], generator(seed))
                ).city.heights
                - stitched
            ).mean()
            for repair in (None, 0.5)
        ]
        assert errors[1] < 0.5 * errors[0]


def test_void_lays_bare_ground(genomes):
    child = PavementFusion(void=True, fill=(0.5, 0, 0.5), tolerance=100)(
        genomes[:2], np.random.default_rng(0)
    )
    bare = np.array(child.cities)[child.parent] == VOID
    assert 0.4 <= bare.mean() <= 0.6
    assert child.uniform[bare].all()
    assert (child.beta[bare] == 0).all()


def test_given_positions_are_used(genomes):
    fusion = PavementFusion(
        size_min=4, size_max=4, fill=0.1, margin=0.05, tolerance=1000, positions=[(2, 3), (99, 0)]
    )
    owner = fusion.draft(genomes[:2], np.random.default_rng(0)).genome.parent.reshape(16, 16)
    truth = np.zeros((16, 16), int)
    truth[2:6, 3:7] = 1
    assert np.array_equal(owner, truth)


def test_interpolation_mixes_convexly(genomes):
    first, second = genomes[:2]
    n = len(first)
    grid, lambdas = first.pavement, np.full(n, 0.25)
    child = interpolate("test", genomes[:2], grid, lambdas, np.random.default_rng(4))
    draws = np.random.default_rng(4).random(n)
    both = ~first.uniform & ~second.uniform
    assert child.sigma[both] == pytest.approx(
        0.25 * first.sigma[both] + 0.75 * second.sigma[both], abs=1e-6
    )
    assert child.beta == pytest.approx(0.25 * first.beta + 0.75 * second.beta, abs=1e-4)
    theirs = draws[both] >= 0.25  # the isometry is the first's with the chance λ
    assert 0.5 < theirs.mean() < 1
    assert np.array_equal(child.iso[both], np.where(theirs, second.iso[both], first.iso[both]))
    low, high = np.minimum(first.x, second.x)[both], np.maximum(first.x, second.x)[both]
    assert ((child.x[both] >= low) & (child.x[both] <= high)).all()


def test_kernels_against_their_naive_twins():
    rng = np.random.default_rng(7)
    current, brought = (
        (rng.random((24, 32)) * 10).astype("f4"),
        (rng.random((24, 32)) * 10).astype("f4"),
    )
    for box in [(0, 0, 8, 8), (4, 8, 8, 12), (16, 24, 8, 8), (0, 0, 24, 32), (5, 0, 1, 1)]:
        assert outline_difference(current, brought, *box) == pytest.approx(
            naive.outline_difference(current, brought, *box)
        )
    owner = rng.integers(0, 2, (6, 8))
    rows, columns = np.divmod(rng.permutation(5 * 7), 7)
    for told in [(3.4, 40, 48), (3.2, 30, 33), (0, 48, 48), (99, 10, 48)]:
        tolerance, least, most = map(float, told)
        truth = naive.inject(
            current, brought, owner, 1, 2, 4, rows, columns, tolerance, least, most
        )
        stitched, taken = current.copy(), owner.copy()
        owned = inject(stitched, brought, taken, 1, 2, 4, rows, columns, tolerance, least, most)
        assert np.array_equal(stitched, truth[0])
        assert np.array_equal(taken, truth[1])
        assert owned == truth[2]


@pytest.mark.parametrize("name", OPERATORS)
def test_wrong_parents_are_refused(genomes, name):
    operator = make(name)
    with pytest.raises(OperatorError, match="parents"):
        operator([], np.random.default_rng(0))
    with pytest.raises(OperatorError, match="parents have the type str"):
        operator(["lyon-1er"] * operator.parents[0], np.random.default_rng(0))
    with pytest.raises(OperatorError, match="is not a list but a Genome"):
        operator(genomes[0], np.random.default_rng(0))
    with pytest.raises(OperatorError, match=r"(?s)rng = 7.*default_rng\(seed\)"):
        operator(parents_for(operator, genomes), 7)
    small = uniformly(draw_town(4, side=32)).genome
    if operator.parents[0] > 1:
        with pytest.raises(OperatorError, match="same number and size of pixels"):
            operator([genomes[0], small], np.random.default_rng(0))


@pytest.mark.parametrize(
    ("name", "parameters", "word"),
    [
        ("pavment_fusion", {}, "pavement_fusion"),
        ("mutation", {"rate": 1}, "rate"),
        ("mutation", {"sigma": -0.1, "group": 0}, "sigma = -0.1, group = 0"),
        ("mutation", {"sigma": "much"}, "sigma = 'much'"),
        ("mutation", {"sgima": 0.5}, "did you mean sigma"),
        ("mutatoin", {}, "did you mean mutation"),
        ("pavement_fusion", {"size_min": 9, "size_max": 3}, "size_max"),
        ("pavement_fusion", {"fill": 1.5}, "fill"),
        ("pavement_fusion", {"repair": 0}, "repair"),
        ("lambda_crossover", {"share": 2}, "share"),
    ],
)
def test_parameters_at_fault_are_named(name, parameters, word):
    with pytest.raises(OperatorError, match=word):
        make(name, **parameters)


def test_shares_must_suit_the_parents(genomes):
    for fill in ((0.5, 0.5, 0.5), (0.2, 0.8), 0.5):
        with pytest.raises(OperatorError, match="one share for each of 3 parents"):
            PavementFusion(fill=fill)(genomes, np.random.default_rng(0))
