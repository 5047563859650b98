"""What tests of operators on one parent share: towns, and the laws of lifs taken elsewhere."""

from functools import cache

import numpy as np
import skimage.data
from codes import stones, uniformly
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.coding.collage_map import CollageMap
from evocity.genome import FIELDS, Genome


@cache
def town(seed: int = 1) -> Genome:
    return uniformly(draw_town(seed)).genome


@cache
def district(name: str, pixels: int = 128) -> Genome:
    return uniformly(evocity.read_map(name, pixels=pixels)).genome


#: The names of `odd_maps`.
ODD = ("camera", "empty", "one roof", "narrow")


@cache
def odd_maps() -> dict[str, Genome]:
    """Parents on which nothing can be wished for: no city, nothing built, nothing else."""
    camera = skimage.data.camera()[100:356:4, 180:436:4].astype(np.float32) / 10
    maps = {
        "camera": camera,
        "empty": np.zeros((64, 64), np.float32),
        "one roof": np.full((64, 64), 9, np.float32),
        "narrow": draw_town(5).heights[:8],
    }
    return {
        name: uniformly(CityMap(heights, 2.0, name=name), reach=None).genome
        for name, heights in maps.items()
    }


def assert_laws(operator, parent: Genome, seed: int) -> Genome:
    """Those of every operator; returns the child."""
    before = parent.digest
    child = operator([parent], np.random.default_rng(seed))
    assert parent.digest == before
    assert operator([parent], np.random.default_rng(seed)) == child
    assert decode(child).converged
    assert child.made["operator"] == operator.name
    return child


def assert_genes_stay_as_they_are(parent: Genome, child: Genome) -> None:
    """Without repair, every lifs is the one its source names, domain and all."""
    for name in FIELDS:
        assert np.array_equal(getattr(child, name), getattr(parent, name)[stones(child)]), name


def assert_meant(parent: Genome, draft) -> None:
    """What is meant to be laid is the parent's decoded map, each block where its lifs now is;
    and one step of the drafted code on the parent's map, whose domain blocks it calls."""
    pavement, heights = parent.pavement, decode(parent).city.heights
    wanted = pavement.raster(pavement.blocks(heights)[stones(draft.genome)])
    assert np.array_equal(draft.intended, wanted)
    step = np.maximum(CollageMap(draft.genome)(decode(parent).attractor), 0)
    assert np.abs(step - wanted).max() < 0.02
