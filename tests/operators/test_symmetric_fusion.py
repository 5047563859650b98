"""Symmetric fusion: which lifs of its pair has each range block?"""

import numpy as np
import pytest
from codes import stones, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity.coding import decode
from evocity.errors import OperatorError
from evocity.genome import NUCLEOTIDES, Genome
from evocity.operators.content_fusion import AsymmetricFusion, SymmetricFusion


def generator(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.fixture(scope="module")
def genomes() -> list[Genome]:
    return [uniformly(draw_town(seed)).genome for seed in (1, 2)]


@pytest.mark.parametrize("isometries", [False, True])
@pytest.mark.parametrize("choose", [False, True])
@pytest.mark.parametrize("repair", [None, 0.5])
def test_its_ends_are_the_asymmetric_fusions(genomes, choose, isometries, repair):
    how = {"isometries": isometries, "repair": repair}
    for share, order in ((0, genomes), (1, genomes[::-1])):
        child = SymmetricFusion(share=share, choose=choose, **how)(genomes, generator())
        other = AsymmetricFusion(side=0.0, **how)(order, generator())
        assert child == other
        assert np.array_equal(stones(child), stones(other))
        assert child.cities == tuple(genome.cities[0] for genome in genomes)
        assert {child.cities[p] for p in child.parent} == set(order[1].cities)


@settings(max_examples=6, deadline=None)
@given(
    seed=st.integers(0, 50),
    choose=st.booleans(),
    isometries=st.booleans(),
    share=st.floats(0, 1),
    repair=st.sampled_from([None, 0.5]),
)
def test_a_city_fused_with_itself_is_itself(seed, choose, isometries, share, repair):
    genome = uniformly(draw_town(seed, side=32, buildings=12)).genome
    fusion = SymmetricFusion(share=share, choose=choose, isometries=isometries, repair=repair)
    assert fusion([genome, genome], generator()) == genome


@pytest.mark.parametrize("grain", [1, 8])
def test_what_is_chosen_is_one_lifs_of_the_pair(genomes, grain):
    fusion = SymmetricFusion(share=0.4, grain=grain, repair=None)
    draft = fusion.draft(genomes, generator(3))
    child = draft.genome
    ends = [
        AsymmetricFusion(side=0.0).draft(order, generator()) for order in (genomes, genomes[::-1])
    ]
    chosen = (child.parent == 0).astype(int)  # the first parent's lifs build the second's plan
    assert chosen.mean() == pytest.approx(0.4, abs=0.002)
    for name in (*NUCLEOTIDES, "source"):
        pair = np.stack([getattr(end.genome, name) for end in ends])
        assert np.array_equal(getattr(child, name), pair[chosen, np.arange(len(child))])
    raster = child.pavement.raster(chosen).astype(bool)
    assert np.array_equal(draft.intended, np.where(raster, ends[1].intended, ends[0].intended))
    together = chosen.reshape(16, 16)
    neighbours = (together[:, 1:] == together[:, :-1]).mean()
    assert neighbours > 0.75 if grain == 8 else neighbours < 0.65


def test_what_is_interpolated_lies_between_the_pair(genomes):
    draft = SymmetricFusion(share=0.25, choose=False, repair=None).draft(genomes, generator(3))
    theirs, ours = (
        AsymmetricFusion(side=0.0).draft(order, generator()) for order in (genomes, genomes[::-1])
    )
    a, b, child = ours.genome, theirs.genome, draft.genome
    assert child.beta == pytest.approx(0.25 * a.beta + 0.75 * b.beta, abs=1e-4)
    assert child.sigma == pytest.approx(0.25 * a.sigma + 0.75 * b.sigma, abs=1e-5)
    both = ~a.uniform & ~b.uniform
    assert both.any()
    low, high = np.minimum(a.x, b.x)[both], np.maximum(a.x, b.x)[both]
    assert ((child.x[both] >= low) & (child.x[both] <= high)).all()
    assert ((child.iso == a.iso) | (child.iso == b.iso))[both].all()
    assert draft.intended == pytest.approx(0.25 * ours.intended + 0.75 * theirs.intended, abs=1e-4)
    assert np.array_equal(stones(child), stones(b))  # that of the larger share
    assert decode(child).converged


def test_it_is_drawn_by_the_generator_alone(genomes):
    fusion = SymmetricFusion(repair=None)
    children = [fusion(genomes, generator(seed)) for seed in (1, 1, 2)]
    assert children[0] == children[1] != children[2]


def test_parameters_at_fault_are_told():
    with pytest.raises(OperatorError, match=r"share = 1.5, grain = 0, alike = -1"):
        SymmetricFusion(share=1.5, grain=0, alike=-1)
    with pytest.raises(OperatorError, match=r"choose = 1.*\n.*choose true or false"):
        SymmetricFusion(choose=1)
