"""Collage repair, which makes fabric heritable: matches blocks again that decode wrongly.

A block crumbles when its domain block lies where another city now stands. Repair matches such
blocks with domain blocks of the intended map.
"""

from collections.abc import Sequence

import numpy as np

from evocity.citymap import BUILT_ABOVE
from evocity.coding.collage_map import CollageMap
from evocity.coding.matching import best_matches
from evocity.coding.matching.domains import DomainPool, domain_pools
from evocity.coding.parameters import Coding
from evocity.genome import Genome, split
from evocity.genome.genome import checked, derived
from evocity.operators._kernels import find_strays
from evocity.pavement import Pavement, touched

#: The cap on |σ| of new matches where the code has no cap below 1: the parent's own fabric tames
#: its steep lifs, the child's may not.
_CONTRACTIVE = 0.9
#: Larger range blocks, px, split before a new match: most of a large one may be right.
_GRAIN = 4
#: Ground that strays is lowered to this, metres; the number of rounds; range blocks that need more
#: lowering stay.
_GROUND, _ROUNDS, _MOST_LOWERED = 1.4, 2, 8.0
#: The least height of what is built in a lowered range block, metres.
_LOWEST = 2.5
#: Decoding ends when no pixel moves by more than a tenth of the threshold, within these, metres; by
#: the least where it may diverge.
_TOLERANCES = (0.01, 0.05)


def collage_repair(
    genome: Genome,
    intended: np.ndarray,
    *,
    threshold: float,
    reach: int | None = 24,
    domains: Sequence[int] = (2,),
    rounds: int = 3,
    clear: bool = False,
) -> tuple[Genome, int]:
    """Find new domain blocks for range blocks of ``genome`` whose decoded heights, without
    flattened roofs, differ from ``intended``.

    If range blocks have different sides, blocks that differ from the intended map are split into
    parts of 4 px, and each part gets a new domain block. If no domain block matches a part of a
    block within the threshold, the part is split again, down to the genome's smallest side.

    Parameters
    ----------
    intended : heights that the operator intends, float32 ``(H, W)``, metres. Where the genome has a
        condensation, the heights of the condensation replace the intended heights.
    threshold : largest accepted difference of a block, root mean square, metres.
    reach, domains : limits of the search for new domain blocks, as in `evocity.encode`.
    rounds : largest number of repairs. Several repairs may be necessary, because a repaired block
        can disturb blocks that read the repaired block.
    clear : whether a last step lowers range blocks in which open ground would become built.

    Returns
    -------
    The function returns the repaired genome, and the number of replaced lifs. If no block differs
    from the intended map, the function returns the given genome object. The fields ``parent`` and
    ``source`` of every lifs do not change, because they name the origin of the intended content.
    """
    intended = np.ascontiguousarray(intended, np.float32)
    if genome.condensation is not None:
        intended = genome.condensation.laid(intended)
    steepest = genome.sigma_max if genome.sigma_max < 1 else _CONTRACTIVE
    matching = _Matching(genome, intended, threshold, Coding(reach, domains, steepest))
    replaced = np.zeros(intended.shape, bool)
    # with a cap below 1 nothing can diverge; else a last round checks only that
    heights = intended
    for turn in range(rounds + (genome.sigma_max >= 1)):
        heights, steep = _decode_roughly(genome, heights, threshold)
        where = np.zeros(intended.shape, bool) if steep is None else genome.pavement.raster(steep)
        if turn < rounds:
            p, limit = genome.pavement, float(threshold) ** 2
            squares = (*p.corners, p.side, matching.grain)
            find_strays(heights, intended, *squares, limit, replaced, where)
        if not where.any():
            break
        replaced |= where
        genome = split(genome, matching.grain, where)
        bad = _touched(genome.pavement, where)
        while bad.size:
            genome, bad = matching(genome, bad)
            if bad.size:  # no domain block of that side explains these; four smaller ones may
                here = np.zeros(len(genome), bool)
                here[bad] = True
                here = genome.pavement.raster(here)
                genome = split(genome, int(genome.pavement.side[bad].max()) // 2, here)
                bad = _touched(genome.pavement, here)
        heights = np.where(where, intended, heights)
    if clear:
        genome = _clear_ground(genome, intended, heights, threshold)
    return checked(genome), _touched(genome.pavement, replaced).size


def _clear_ground(
    genome: Genome, intended: np.ndarray, heights: np.ndarray, threshold: float
) -> Genome:
    """Lower range blocks so that ground stays ground; ``heights`` approximate the decoded map.

    σ cannot stretch a domain block enough for a wall higher than any nearby. The ground before it
    then rises above `BUILT_ABOVE`. Settling brings back what β takes from the roof behind it.
    """
    ground = intended <= BUILT_ABOVE
    for _ in range(_ROUNDS):
        heights, steep = _decode_roughly(genome, heights, threshold)
        stray = ground & (heights > BUILT_ABOVE)
        if steep is not None or not stray.any():
            break
        index, lower = genome.pavement.index, np.zeros(len(genome), np.float32)
        np.maximum.at(lower, index[stray], heights[stray] - np.float32(_GROUND))
        lower[lower > _MOST_LOWERED] = 0
        # buildings there stay built
        built = ~ground & (lower[index] > 0)
        least = np.full(len(genome), _MOST_LOWERED, np.float32)
        np.minimum.at(least, index[built], heights[built] - np.float32(_LOWEST))
        lower = np.clip(lower, 0, np.maximum(least, 0))
        if not lower.any():
            break
        genome = derived(genome, beta=genome.beta - lower)
    return genome


class _Matching:
    """Matching of lifs with the domain blocks of one map; it folds the blocks of each side once.

    grain : larger range blocks are split to this side, px, before a match.
    """

    def __init__(self, genome: Genome, intended: np.ndarray, threshold: float, coding: Coding):
        pavement = genome.pavement
        self.finest, self.grain = pavement.finest, pavement.coarsest
        while self.grain > max(_GRAIN, self.finest) and self.grain % 2 == 0:
            self.grain //= 2
        self._intended, self._threshold, self._coding = intended, threshold, coding
        self._pools: dict[int, list[DomainPool]] = {}

    def __call__(self, genome: Genome, which: np.ndarray) -> tuple[Genome, np.ndarray]:
        """Match the lifs ``which`` of a genome; returns the new genome, and those of them that
        still stray and can be split."""
        pavement = genome.pavement
        stray = which[:0]
        for side in np.unique(pavement.side[which]).tolist():
            lifs = which[pavement.side[which] == side]
            if side not in self._pools:
                # float32 is precise to 1e-7 of the highest roof, and there are many maps to fold
                pools = domain_pools(self._intended, side, self._coding.domains, exact=False)
                self._pools[side] = list(pools)
            corners = tuple(corner[lifs] for corner in pavement.corners)
            blocks = pavement.squares(self._intended, lifs, side)
            matches = best_matches(self._pools[side], blocks, corners, self._coding)
            columns = {}
            for name, values in matches.nucleotides(side).items():
                columns[name] = getattr(genome, name).copy()
                columns[name][lifs] = values
            genome = derived(genome, **columns)
            if side > self.finest:
                left = matches.energy - matches.gain > (self._threshold * side) ** 2
                stray = np.concatenate([stray, lifs[left]])
        return genome, stray


def _touched(pavement: Pavement, where: np.ndarray) -> np.ndarray:
    """List the range blocks with a true pixel of ``where``."""
    return np.flatnonzero(touched(where, *pavement.corners, pavement.side))


def _decode_roughly(
    genome: Genome, start: np.ndarray, threshold: float
) -> tuple[np.ndarray, np.ndarray | None]:
    """Decode a genome to the precision that the ``threshold`` demands; with a mask of lifs that
    need a new match in any case, None without any.

    A crossed code without a cap on σ may diverge. Then one step from ``start`` replaces the decoded
    map, and the mask holds the lifs that do not contract.
    """
    collage = CollageMap(genome)
    least, most = _TOLERANCES
    tolerance = least if genome.sigma_max >= 1 else min(max(threshold / 10, least), most)
    end = collage.fixed_point(start, tolerance=tolerance)
    if end.diverged:
        steep = np.abs(genome.sigma) >= 1
        return collage(start), steep if steep.any() else None
    return np.maximum(end.values, 0), None
