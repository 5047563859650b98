"""Ancestry of pixels: shares of the source cities, decoded beside the heights to any depth."""

import numpy as np

from evocity.coding.collage_map import CollageMap
from evocity.coding.zoom import area_means, legal_zoom
from evocity.errors import GenomeError, check_number, keyword
from evocity.genome import Genome

#: Iterations in place of the limit: each halves the rest, and 2⁻¹² is below a step of colour.
LIMIT = 12

#: Iterations beyond this vanish in float32.
_DEEPEST = 40


def ancestry(genome: Genome, *, depth: int | None = None, zoom: float = 1) -> np.ndarray:
    """Compute the share of each source city in each pixel of a decoded map.

    The iteration of the decoder computes weights of the source cities in the same way as heights.
    Each lifs copies the weights c of its domain block to its range block. Each lifs averages the
    copied weights c of its domain block with the weights c_i of its own city: c ← ½·c_i + ½·c. The
    source is Tosan and others 2005 §4.2 and §5.1, who describe coupled maps (T_i, T̃_i). In the
    limit of many iterations, the shares of a range block depend on an endless chain of domain
    blocks. A lifs that interpolates two cities counts for one city with the weight λ, and for the
    other city with 1 − λ. A uniform range block has no domain block, so its pixels belong to the
    city of the range block's own lifs. A pixel of the condensation belongs to the city of its range
    block's lifs.

    Parameters
    ----------
    depth : number of iterations, a whole number of 0 or more. With a depth of 0, each range block
        belongs only to the city of its own lifs. With a depth of n, the shares follow a chain of n
        domain blocks, in which each block has half the weight of the block before. If ``depth`` is
        None, `LIMIT` iterations compute the shares to within 2⁻¹² of their limit.
    zoom : fractal zoom of the result, as in `evocity.decode`.

    Returns
    -------
    float32 ``(zH, zW, cities)`` : shares from 0 to 1 at the zoom z; the last axis has the order of
    ``genome.cities``. The shares of each pixel add up to 1, except for rounding.

    Raises
    ------
    GenomeError : ``depth`` is not a whole number from 0 upwards, or the ``zoom`` does not suit the
        genome.

    Each city and each iteration takes about 0.3 ms on a map of 256 × 256 px.
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
    if depth is None:
        return LIMIT
    expected = "a whole number of iterations, 0 or more"
    remedy = f"give 0 for each block's own city, or leave {keyword('depth')} out for the limit"
    check_number("depth", depth, 0, np.inf, expected, GenomeError, remedy, whole=True)
    return min(int(depth), _DEEPEST)
