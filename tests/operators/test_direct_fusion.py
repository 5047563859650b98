"""Direct fusion: lifs drawn one by one, and what comes of it."""

import numpy as np
import pytest
from codes import stones, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import read_map
from evocity.coding import decode
from evocity.errors import OperatorError
from evocity.fitness import crumbs
from evocity.genome import NUCLEOTIDES, Genome
from evocity.operators import PavementFusion
from evocity.operators.pavement_fusion import DirectFusion


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.fixture(scope="module")
def genomes() -> list[Genome]:
    return [uniformly(draw_town(seed)).genome for seed in (1, 2, 3)]


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 2**32), cut=st.floats(0, 1), rest=st.floats(0, 1))
def test_every_lifs_is_its_sources_own(genomes, seed, cut, rest):
    fill = (cut, (1 - cut) * rest, (1 - cut) * (1 - rest))
    child = DirectFusion(fill=fill, repair=None)(genomes, generator(seed))
    assert child.cities == tuple(genome.cities[0] for genome in genomes)
    assert np.array_equal(stones(child), np.arange(len(child)))
    for name in NUCLEOTIDES:
        every = np.stack([getattr(genome, name) for genome in genomes])
        assert np.array_equal(getattr(child, name), every[child.parent, stones(child)])
    reached = np.bincount(child.parent, minlength=3) / len(child)
    assert child.made["fill_reached"] == pytest.approx(reached, abs=1e-4)
    assert reached == pytest.approx(fill, abs=5 * np.sqrt(0.25 / len(child)))
    assert all(share > 0 for share, got in zip(fill, reached, strict=True) if got > 0)


@pytest.mark.parametrize("repair", [None, 0.5])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_the_whole_share_gives_a_parent(genomes, which, repair):
    fill = [0.0, 0.0, 0.0]
    fill[which] = 1.0
    assert DirectFusion(fill=fill, repair=repair)(genomes, generator()) == genomes[which]
    if which < 2:
        assert DirectFusion(fill=which, repair=repair)(genomes[:2], generator()) == genomes[which]


@pytest.mark.parametrize("count", [2, 3])
def test_a_city_fused_with_itself_is_itself(genomes, count):
    assert DirectFusion()([genomes[0]] * count, generator()) == genomes[0]


def test_lifs_are_drawn_independently_of_their_neighbours(genomes):
    alike = []
    for seed in range(20):
        owner = DirectFusion(fill=0.3, repair=None)(genomes[:2], generator(seed)).parent
        owner = owner.reshape(16, 16)
        alike += [(owner[1:] == owner[:-1]).mean(), (owner[:, 1:] == owner[:, :-1]).mean()]
    assert np.mean(alike) == pytest.approx(0.3**2 + 0.7**2, abs=0.03)


def test_blocks_are_meant_to_stay_as_they_were(genomes):
    draft = DirectFusion().draft(genomes, generator(4))
    owner = draft.genome.parent.reshape(16, 16).repeat(4, 0).repeat(4, 1)
    maps = np.stack([decode(genome).city.heights for genome in genomes])
    y, x = np.mgrid[:64, :64]
    assert np.array_equal(draft.intended, maps[owner, y, x])
    errors = [
        np.abs(
            decode(DirectFusion(repair=repair)(genomes, generator(4))).city.heights - draft.intended
        ).mean()
        for repair in (None, 0.5)
    ]
    assert errors[1] < 0.3 * errors[0]


def test_it_crumbles_as_the_papers_say():
    parents = [
        uniformly(read_map(name, pixels=128)).genome
        for name in ("new-york-west-village", "montpellier-pas-du-loup")
    ]
    own = max(crumbs(decode(parent).city) for parent in parents)
    for seed in range(3):
        direct, paved = (
            crumbs(decode(fuse(parents, generator(seed))).city)
            for fuse in (DirectFusion(repair=None), PavementFusion())
        )
        assert direct > 2 * max(own, paved)


def test_shares_must_suit_the_parents(genomes):
    for fill in (0.5, (0.5, 0.5), (0.5, 0.5, 0.5)):
        with pytest.raises(OperatorError, match="one share for each of 3 parents, summing to 1"):
            DirectFusion(fill=fill)(genomes, generator())
    DirectFusion(fill=0.5).check_count(2)
    with pytest.raises(OperatorError, match=r"direct_fusion: fill = 0\.5"):
        DirectFusion(fill=0.5).check_count(3)
    for wrong in (-0.1, 1.5, [], [0.5, 2]):
        with pytest.raises(OperatorError, match=r"0…1, or a list of such shares"):
            DirectFusion(fill=wrong)
