"""Whose stone stands where: source cities mixed along with the heights, to any depth."""

import operator

import numpy as np

from evocity.coding.decode import CollageMap
from evocity.coding.zoom import area_means, legal_zoom
from evocity.errors import GenomeError, keyword, setting
from evocity.genome import Genome

#: Iterations that stand for the limit: each halves what is left, 2⁻¹² is below a step of colour.
LIMIT = 12

#: Beyond so many, halves are lost in float32.
_DEEPEST = 40


def ancestry(genome: Genome, *, depth: int | None = None, zoom: float = 1) -> np.ndarray:
    """How much of each pixel comes from each source city.

    Weights of cities are decoded beside the heights: the lifs of city c_i lays the weights c of
    its domain block, shrunk and turned as the heights are, and pulls them half-way to its own
    city, c ← ½·c_i + ½·c (Tosan et al. 2005 §4.2, 5.1: the coupled maps (T_i, T̃_i)). The limit
    tells where each stone comes from, and where what it was made of came from, and so on. A lifs
    between two cities' (interpolation) is of both, λ and 1 − λ. What has no domain is its own
    city's alone: a uniform range block, and what a condensation keeps.

    Parameters
    ----------
    depth : iterations, 0 or more. 0 gives each block to the city of its own lifs; n looks back
        over n domain blocks, the k-th with half the weight of the one before. None for the
        limit, which `LIMIT` iterations reach within 2⁻¹².
    zoom : fractal zoom, as in `evocity.decode`.

    Returns
    -------
    float32 ``(zH, zW, cities)`` in the order of ``genome.cities``, 0…1; in each pixel they sum
    to 1 within rounding.

    Raises
    ------
    GenomeError : ``depth`` is no whole number of 0 or more, or the zoom is none.

    About 0.3 ms a city and iteration at 256².
    """
    steps = _checked(depth)
    legal = legal_zoom(genome.pavement, zoom)
    collage = CollageMap(genome.replace(condensation=None), legal)
    kept = None if genome.condensation is None else genome.condensation.resampled(*collage.shape)
    inherited = np.where(genome.uniform, np.float32(0), np.float32(0.5))
    weights = np.zeros((*collage.shape, len(genome.cities)), np.float32)
    for city in np.union1d(genome.parent, genome.other):  # no other has a part in it
        own = np.where(genome.parent == city, genome.part, 0)
        own = (own + np.where(genome.other == city, 1 - genome.part, 0)).astype(np.float32)
        pull = collage.recoded(inherited, (1 - inherited) * own)
        plain = share = collage.pavement.raster(own)
        for _ in range(steps):
            share = pull(share)
            if kept is not None:
                share[kept.mask] = plain[kept.mask]
        weights[..., city] = share
    if legal - zoom > 1e-9:
        parts = [area_means(weights[..., city], legal / zoom) for city in range(weights.shape[2])]
        weights = np.stack(parts, axis=2)
    return np.clip(weights, 0, 1, out=weights)


def _checked(depth: int | None) -> int:
    try:
        steps = LIMIT if depth is None else operator.index(depth)
    except TypeError:
        steps = -1
    if steps < 0 or isinstance(depth, bool):
        raise GenomeError(
            setting("depth", depth),
            "a whole number of iterations, 0 or more",
            "give 0 for the city of each block alone, or leave "
            f"{keyword('depth')} out for the limit",
        )
    return min(steps, _DEEPEST)


__all__ = ["LIMIT", "ancestry"]
