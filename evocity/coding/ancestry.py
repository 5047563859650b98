"""Ancestry of pixels: shares of the source cities, decoded beside the heights to any depth."""

import operator

import numpy as np

from evocity.coding.decode import CollageMap
from evocity.coding.zoom import area_means, legal_zoom
from evocity.errors import GenomeError, keyword, setting
from evocity.genome import Genome

#: Iterations in place of the limit: each halves the rest, and 2⁻¹² is below a step of colour.
LIMIT = 12

#: Iterations beyond this vanish in float32.
_DEEPEST = 40


def ancestry(genome: Genome, *, depth: int | None = None, zoom: float = 1) -> np.ndarray:
    """Compute the share of each source city in each pixel.

    Weights of cities are decoded together with the heights. A lifs of city c_i takes the weights c
    of its domain block, shrunk and turned like heights. It then moves them half-way to its own
    city: c ← ½·c_i + ½·c (Tosan et al. 2005 §4.2, 5.1: the coupled maps (T_i, T̃_i)). The limit
    follows the origin of each range block, then of its domain block, and so on. A lifs between two
    cities (interpolation) belongs to both, by λ and 1 − λ. A uniform range block has no domain
    block, and belongs only to its own city. The same holds for heights that a condensation keeps.

    Parameters
    ----------
    depth : number of iterations, 0 or more. With 0, each block belongs to the city of its own lifs.
        With n, the result looks back over n domain blocks; each has half the weight of the block
        before. None computes the limit; `LIMIT` iterations approach it within 2⁻¹².
    zoom : fractal zoom, as in `evocity.decode`.

    Returns
    -------
    float32 ``(zH, zW, cities)`` : shares 0…1, in the order of ``genome.cities``. In each pixel they
    add up to 1, except for rounding.

    Raises
    ------
    GenomeError : ``depth`` is not a whole number of 0 or more, or ``zoom`` is illegal.

    Each city and iteration takes about 0.3 ms at 256².
    """
    steps = _iterations(depth)
    legal = legal_zoom(genome.pavement, zoom)
    collage = CollageMap(genome.replace(condensation=None), legal)
    kept = None if genome.condensation is None else genome.condensation.resampled(*collage.shape)
    inherited = np.where(genome.uniform, np.float32(0), np.float32(0.5))
    weights = np.zeros((*collage.shape, len(genome.cities)), np.float32)
    for city in np.union1d(genome.parent, genome.other):  # other cities have no share
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


def _iterations(depth: int | None) -> int:
    try:
        steps = LIMIT if depth is None else operator.index(depth)
    except TypeError:
        steps = -1
    if steps < 0 or isinstance(depth, bool):
        raise GenomeError(
            setting("depth", depth),
            "a whole number of iterations, 0 or more",
            f"give 0 for each block's own city, or leave {keyword('depth')} out for the limit",
        )
    return min(steps, _DEEPEST)
