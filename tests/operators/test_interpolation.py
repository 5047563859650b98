"""Interpolation, lifs by lifs and step by step: what lies between two codes."""

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import isometries, read_map
from evocity.coding import decode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import NUCLEOTIDES, Genome, refined
from evocity.operators.lambda_crossover import Interpolation

FORMS = [
    {"stepwise": stepwise, "repair": repair} for stepwise in (False, True) for repair in (None, 0.5)
]


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def map_of(genome: Genome) -> np.ndarray:
    return decode(genome).city.heights


def rms(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2, dtype=float)))


@pytest.fixture(scope="module")
def genomes() -> list[Genome]:
    return [uniformly(draw_town(seed)).genome for seed in (1, 2)]


@pytest.fixture(scope="module")
def coarse() -> Genome:
    return uniformly(draw_town(2), block=8).genome


@pytest.fixture(scope="module")
def cities() -> dict[tuple[str, int], Genome]:
    return {
        (name, block): uniformly(read_map(name, pixels=128), block=block).genome
        for name in ("lyon-1er", "montpellier-pas-du-loup")
        for block in (4, 8)
    }


# -- from one parent to the other ------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "blocks"),
    [*((form, (4, 4)) for form in FORMS), (FORMS[2], (4, 8)), (FORMS[3], (8, 4))],
    ids=str,
)
def test_the_way_from_city_to_city_is_monotonic(cities, form, blocks):
    parents = [
        cities[name, block]
        for name, block in zip(("lyon-1er", "montpellier-pas-du-loup"), blocks, strict=True)
    ]
    ends = [map_of(parent) for parent in parents]
    whole = rms(*ends)
    path = []
    for share in np.linspace(0, 1, 11):
        decoding = decode(Interpolation(share=share, **form)(parents, generator(5)))
        assert decoding.converged
        path.append([rms(decoding.city.heights, end) / whole for end in ends])
    steps = np.diff(path, axis=0)
    assert (steps[:, 0] < 0.05).all()
    assert (steps[:, 1] > -0.05).all()
    assert path[0] == pytest.approx([1, 0], abs=1e-6)
    assert path[-1] == pytest.approx([0, 1], abs=1e-6)


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("as_list", [False, True])
def test_the_ends_are_the_parents(genomes, coarse, form, as_list):
    for second in [genomes[1], coarse] if form["stepwise"] else genomes[1:]:
        parents = [genomes[0], second]
        for share in (0, 1):
            lambdas = [float(share)] * len(parents[0]) if as_list else share
            child = Interpolation(share=lambdas, **form)(parents, generator())
            assert child == parents[1 - share]
            assert child.cities == tuple(parent.cities[0] for parent in parents)
            assert {child.cities[p] for p in child.parent} == set(parents[1 - share].cities)
            assert child.attribution == "drawn by seed 1; drawn by seed 2"


@pytest.mark.parametrize("form", FORMS, ids=str)
@settings(max_examples=4, deadline=None)
@given(share=st.floats(0, 1), seed=st.integers(0, 50))
def test_between_a_city_and_itself_there_is_nothing_else(form, share, seed):
    genome = uniformly(draw_town(seed, side=32, buildings=12)).genome
    assert Interpolation(share=share, **form)([genome, genome], generator()) == genome


@pytest.mark.parametrize("stepwise", [False, True])
def test_no_share_draws_one(genomes, stepwise):
    draw = Interpolation(share=None, stepwise=stepwise, repair=None)
    children = [draw(genomes, generator(seed)) for seed in (1, 1, 2)]
    assert children[0] == children[1] != children[2]
    assert children[0].made["share"] == pytest.approx(generator(1).random(), abs=1e-4)


# -- lifs by lifs ----------------------------------------------------------------------------


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_every_lifs_has_its_own_share(genomes, seed):
    first, second = genomes
    lambdas = generator(seed).choice([0, 0.2, 0.7, 1], len(first))
    child = Interpolation(share=lambdas, repair=None)(genomes, generator(seed))
    assert child.sigma == pytest.approx(
        lambdas * first.sigma + (1 - lambdas) * second.sigma, abs=1e-6
    )
    ours = lambdas >= 0.5
    assert np.array_equal(child.parent, np.where(ours, 0, 1))
    for name in NUCLEOTIDES:
        for share, parent in enumerate((second, first)):
            own = lambdas == share
            assert np.array_equal(getattr(child, name)[own], getattr(parent, name)[own])
    assert child.made["share"] == pytest.approx(lambdas.mean(), abs=1e-4)
    draft = Interpolation(share=lambdas).draft(genomes, generator(seed))
    weight = first.pavement.raster(lambdas)
    mixture = weight * map_of(first) + (1 - weight) * map_of(second)
    assert draft.intended == pytest.approx(mixture, abs=1e-4)


# -- step by step ----------------------------------------------------------------------------


def mixed_naively(parents, weight, steps=60, kept=None):
    heights = np.zeros(weight.shape)
    for _ in range(steps):
        once = [naive.collage(parent, heights) for parent in parents]
        heights = weight * once[0] + (1 - weight) * once[1]
        if kept is not None:
            heights = kept.laid(heights)
    return heights


@pytest.mark.slow
def test_what_is_meant_is_the_attractor_of_the_mixture(genomes, coarse):
    for second, share in ((genomes[1], 0.3), (coarse, 0.6), (coarse, generator().random(256))):
        parents = [genomes[0], second]
        draft = Interpolation(share=share, stepwise=True).draft(parents, generator())
        weight = np.broadcast_to(share, 256).reshape(16, 16).repeat(4, 0).repeat(4, 1)
        truth = np.maximum(mixed_naively(parents, weight), 0)
        assert draft.intended == pytest.approx(truth, abs=0.05)
        assert draft.genome.pavement == parents[0].pavement


def test_lifs_keep_their_domains_and_are_fitted_to_the_attractor(genomes, coarse):
    first, block = genomes[0], 4
    draft = Interpolation(share=0.5, stepwise=True).draft([first, coarse], generator())
    child = draft.genome
    for name in ("x", "y", "dx", "dy", "iso", "source"):
        assert np.array_equal(getattr(child, name), getattr(first, name))
    assert (child.parent == 0).all()
    attractor = mixed_naively([first, coarse], np.full((64, 64), 0.5))
    wanted = first.pavement.blocks(attractor).reshape(len(first), -1)
    fitted = 0
    for i in range(len(first)):
        if first.uniform[i]:
            assert child.beta[i] == pytest.approx(wanted[i].mean(), abs=0.05)
            continue
        domain = naive.shrunk(attractor, first.y[i], first.x[i], 2, 2, block)
        read = isometries.apply(int(first.iso[i]), domain).ravel()
        (sigma, beta), *_ = np.linalg.lstsq(np.stack([read, np.ones(16)], 1), wanted[i])
        error = wanted[i] - child.sigma[i] * read - child.beta[i]
        assert abs(error.mean()) < 0.05
        if np.ptp(read) > 1 and abs(sigma) < 0.85:
            fitted += 1
            best = wanted[i] - sigma * read - beta
            assert np.sqrt((error**2).mean()) < np.sqrt((best**2).mean()) + 0.05
    assert fitted > 50
    assert np.abs(child.sigma).max() <= np.float32(first.sigma_max)


def test_lifs_that_do_not_stray_stay_as_they_are(genomes):
    first = genomes[0]
    taller = first.beta.copy()
    taller[:16] += 3  # the northern row
    second = first.replace(beta=taller)
    child = Interpolation(stepwise=True, repair=None)([first, second], generator())
    same = (child.sigma == first.sigma) & (child.beta == first.beta)
    moved = first.pavement.blocks(np.abs(map_of(second) - map_of(first))).max(axis=(1, 2))
    assert not same[:16].any()
    assert same[moved == 0].all()
    assert (moved == 0).mean() > 0.5


def test_repair_brings_the_child_to_that_attractor(genomes, coarse):
    errors = []
    for repair in (None, 0.5):
        mix = Interpolation(stepwise=True, repair=repair)
        child = mix([genomes[0], coarse], generator())
        errors.append(rms(map_of(child), mix.draft([genomes[0], coarse], generator()).intended))
    assert errors[1] < 0.5 * errors[0]


def test_what_is_condensed_stays_in_the_mixture(genomes, coarse):
    mask = np.zeros((64, 64), bool)
    mask[20:30, 5:50] = True
    kept = Condensation(np.full((64, 64), 40.0), mask)
    parents = [genomes[0], coarse.replace(condensation=kept)]
    draft = Interpolation(stepwise=True).draft(parents, generator())
    truth = np.maximum(mixed_naively(parents, np.full((64, 64), 0.5), kept=kept), 0)
    assert draft.intended == pytest.approx(truth, abs=0.05)
    child = Interpolation(stepwise=True)(parents, generator())
    assert (map_of(child)[mask] == 40).all()
    assert child.condensation == kept


def test_a_mixture_that_diverges_is_told(genomes):
    wild = genomes[0].replace(
        sigma=np.where(genomes[0].uniform, 0, 9.0), beta=genomes[0].beta + 1, sigma_max=np.inf
    )
    with pytest.raises(OperatorError, match=r"(?s)mixture of both decodings diverges.*sigma_max"):
        Interpolation(stepwise=True)([wild, genomes[1]], generator())


# -- who may be mixed ------------------------------------------------------------------------


def test_only_stepwise_takes_other_range_blocks(genomes, coarse):
    six, four = (uniformly(draw_town(2, side=48), block=block).genome for block in (6, 4))
    for parents in ([six, four], [four, six]):
        with pytest.raises(OperatorError, match=r"(?s)range blocks of [46].*halve, 4 and 2, not 6"):
            Interpolation()(parents, generator())
        child = Interpolation(stepwise=True, repair=None)(parents, generator())
        assert child.pavement == parents[0].pavement
    small = uniformly(draw_town(3, side=32)).genome
    near = uniformly(draw_town(3, pixel=1.0)).genome
    for other in (small, near):
        for stepwise in (False, True):
            with pytest.raises(OperatorError, match="same number and size of pixels"):
                Interpolation(stepwise=stepwise)([genomes[0], other], generator())


def test_sides_that_halve_meet_at_the_finer(genomes, coarse):
    parents = [coarse, genomes[0]]
    child = Interpolation(share=0.3).draft(parents, generator()).genome
    fine = refined(coarse, genomes[0].pavement)
    assert decode(fine).attractor == pytest.approx(decode(coarse).attractor, abs=0.05)
    assert child.pavement == fine.pavement
    assert child.sigma == pytest.approx(0.3 * fine.sigma + 0.7 * genomes[0].sigma, abs=1e-6)
    assert child.beta == pytest.approx(0.3 * fine.beta + 0.7 * genomes[0].beta, abs=1e-4)
    lambdas = np.repeat([0.0, 1.0], 32)
    each = Interpolation(share=lambdas).draft(parents, generator()).genome
    assert np.array_equal(each.sigma[:128], genomes[0].sigma[:128])  # one λ a lifs of the first
    assert np.array_equal(each.sigma[128:], fine.sigma[128:])


def test_parameters_at_fault_are_told(genomes):
    for wrong in (1.2, [], [0.5, -1], "half", True):
        with pytest.raises(OperatorError, match="interpolation: share ="):
            Interpolation(share=wrong)
    with pytest.raises(OperatorError, match="stepwise = 1"):
        Interpolation(stepwise=1)
    for stepwise in (False, True):
        mix = Interpolation(share=[0.5, 0.5], stepwise=stepwise)
        with pytest.raises(OperatorError, match="one for each of 256 lifs of the first parent"):
            mix(genomes, generator())
