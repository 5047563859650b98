"""Lifs fitted to a map again: other σ and β, the same domain blocks."""

import numpy as np

from evocity.coding.decode import CollageMap
from evocity.genome import Genome

#: Pixels that change by no more than this have not changed, metres.
_SAME = 1e-3
#: σ stays where β alone fits to within this, metres, root mean square.
_CLOSE = 0.05
#: The cap on the |σ| of lifs fitted again where the code has none below 1, as of repair; a lifs
#: that is steeper already may be as steep as it was.
_CONTRACTIVE = 0.9


def refitted(genome: Genome, before: np.ndarray, after: np.ndarray) -> Genome:
    """The code of a map ``before`` as a code of ``after``: of every lifs whose range block or whose
    domain block changes, σ and β are fitted again by least squares.

    Where range block and domain block change by a constant each, the fit is exact, and σ stays. A
    range block in which a height changes along an edge is fitted as well as its domain block can.
    Domain blocks, isometries and provenance stay.

    before, after : float32 ``(H, W)``, metres; ``before`` is the attractor of ``genome``.
    """
    pavement, domain = genome.pavement, ~genome.uniform
    domains = CollageMap(genome).recoded(domain, np.zeros(domain.size))
    read, reads = domains(before), domains(after)
    moved = np.abs(after - before) + np.abs(reads - read)
    free = np.ones(after.shape)
    if genome.condensation is not None:
        free[genome.condensation.mask] = 0
    pixels = pavement.sums(free)
    changed = (pavement.maxima(moved * free) > _SAME) & (pixels > 0)
    pixels = np.maximum(pixels, 1)

    def mean(raster: np.ndarray) -> np.ndarray:
        return pavement.sums(raster * free) / pixels

    s, t = reads.astype(float), after.astype(float)
    mean_s, mean_t = mean(s), mean(t)
    variance, wanted = mean(s * s) - mean_s**2, mean(t * t) - mean_t**2
    together = mean(s * t) - mean_s * mean_t
    sigma = genome.sigma.astype(float)
    left = wanted - 2 * sigma * together + sigma**2 * variance
    steepest = genome.sigma_max
    if steepest >= 1:
        steepest = np.maximum(np.abs(sigma), _CONTRACTIVE)
    able = domain & (left > _CLOSE**2) & (variance > _SAME**2)
    best = np.divide(together, variance, out=sigma.copy(), where=able)
    sigma = np.clip(best, -steepest, steepest)
    beta = mean_t - sigma * mean_s
    return genome.replace(
        sigma=np.where(changed, sigma.astype(np.float32), genome.sigma),
        beta=np.where(changed, beta.astype(np.float32), genome.beta),
    )
