"""Collage repair: what makes fabric heritable.

A block crumbles when its domain block lies where another city now stands. Only the blocks that
decode wrongly are matched again, on the map the operator meant to lay.
"""

from collections.abc import Sequence

import numpy as np

from evocity.citymap import BUILT_ABOVE
from evocity.coding.decode import CollageMap
from evocity.coding.encode import with_matches
from evocity.coding.fixed_point import fixed_point
from evocity.coding.matching import best_matches
from evocity.coding.matching.domains import DomainPool, domain_pools
from evocity.genome import Genome, split
from evocity.pavement import Pavement, touched

#: The cap on |σ| of what is matched again where the code has none below 1: a parent's steep lifs
#: are tamed by its own fabric, and a child has another.
_CONTRACTIVE = 0.9
#: Range blocks of more than this, px, are split before they are matched again: of a large one that
#: strays, most may be as it should.
_GRAIN = 4
#: Ground that strays is brought to this, metres, in so many turns; range blocks that would have to
#: be lowered by more are left.
_GROUND, _CLEARED, _MOST_LOWERED = 1.4, 2, 8.0
#: So high stays at least what is built in a range block that is lowered, metres.
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
    """Re-match the blocks of ``genome`` whose decoded content, before roofs are settled, strays
    from ``intended``.

    Leaves are split where they stray and matched in parts of 4 px; parts that no domain block
    explains to within the threshold are split again, down to the genome's finest side.

    Parameters
    ----------
    intended : float32 ``(H, W)`` heights the operator meant to lay, metres; where the genome's
        condensation covers, its heights stand in their place.
    threshold : root mean square difference of a block that is still tolerated, metres.
    reach, domains : where the new domain blocks are searched, as in `evocity.encode`.
    rounds : a repaired block can disturb those that read it, so decode and repair again, at
        most so often.
    clear : at last lower the range blocks in which ground would be built on.

    Returns
    -------
    The repaired genome (the same object if nothing strayed) and the number of lifs replaced.
    Parent and source of every lifs are kept: they name the stone the block should carry.
    """
    intended = np.ascontiguousarray(intended, np.float32)
    if genome.condensation is not None:
        intended = genome.condensation.laid(intended)
    matching = _Matching(genome, intended, threshold, reach, domains)
    replaced = np.zeros(intended.shape, bool)
    # with a cap below 1 nothing can diverge; else the last round looks for that alone
    heights = intended
    for turn in range(rounds + (genome.sigma_max >= 1)):
        heights, steep = _decoded(genome, heights, threshold)
        where = genome.pavement.raster(steep)
        if turn < rounds:
            error = (heights - intended) ** 2
            where |= _strayed(genome.pavement, matching.grain, error, threshold) & ~replaced
        if not where.any():
            break
        replaced |= where
        genome = split(genome, matching.grain, where)
        bad = _touched(genome.pavement, where)
        while bad.size:
            genome, bad = matching(genome, bad)
            if bad.size:  # what no domain block of that side explains: by four smaller ones
                here = np.zeros(len(genome), bool)
                here[bad] = True
                here = genome.pavement.raster(here)
                genome = split(genome, int(genome.pavement.side[bad].max()) // 2, here)
                bad = _touched(genome.pavement, here)
        heights = np.where(where, intended, heights)
    if clear:
        genome = _cleared(genome, intended, heights, threshold)
    return genome, _touched(genome.pavement, replaced).size


def _cleared(genome: Genome, intended: np.ndarray, heights: np.ndarray, threshold: float) -> Genome:
    """``genome`` with range blocks lowered so that ground stays ground; ``heights`` are about what
    it decodes to.

    A wall higher than any nearby is laid by one that σ cannot stretch enough. The ground before it
    then rises above `BUILT_ABOVE`, and settling roofs would make a buttress of it. The roof behind
    it can spare what β gives: settling brings it back.
    """
    ground = intended <= BUILT_ABOVE
    for _ in range(_CLEARED):
        heights, steep = _decoded(genome, heights, threshold)
        stray = ground & (heights > BUILT_ABOVE)
        if steep.any() or not stray.any():
            break
        index, lower = genome.pavement.index, np.zeros(len(genome), np.float32)
        np.maximum.at(lower, index[stray], heights[stray] - np.float32(_GROUND))
        lower[lower > _MOST_LOWERED] = 0
        # what is built there stays built
        built = ~ground & (lower[index] > 0)
        least = np.full(len(genome), _MOST_LOWERED, np.float32)
        np.minimum.at(least, index[built], heights[built] - np.float32(_LOWEST))
        lower = np.clip(lower, 0, np.maximum(least, 0))
        if not lower.any():
            break
        genome = genome.replace(beta=genome.beta - lower)
    return genome


class _Matching:
    """Matches lifs of one map again; of each side the domain blocks are folded once.

    grain : larger range blocks are split to this side, px, before they are matched.
    """

    def __init__(self, genome: Genome, intended, threshold: float, reach, domains):
        pavement = genome.pavement
        self.finest, self.grain = pavement.finest, pavement.coarsest
        while self.grain > max(_GRAIN, self.finest) and self.grain % 2 == 0:
            self.grain //= 2
        self._intended, self._threshold, self._domains = intended, threshold, set(domains)
        steepest = genome.sigma_max if genome.sigma_max < 1 else _CONTRACTIVE
        self._asked = {"reach": reach, "sigma_max": steepest}
        self._pools: dict[int, list[DomainPool]] = {}

    def __call__(self, genome: Genome, which: np.ndarray) -> tuple[Genome, np.ndarray]:
        """``genome`` with the lifs ``which`` matched again; and which of them still stray, though
        they could be split."""
        pavement = genome.pavement
        strayed = which[:0]
        for side in np.unique(pavement.side[which]).tolist():
            found = which[pavement.side[which] == side]
            if side not in self._pools:
                # in float32: good to 1e-7 of the highest roof, and there are many maps to fold
                pools = domain_pools(self._intended, side, self._domains, exact=False)
                self._pools[side] = list(pools)
            corners = tuple(corner[found] for corner in pavement.corners)
            blocks = pavement.squares(self._intended, found, side)
            matches = best_matches(self._pools[side], blocks, corners, **self._asked)
            genome = with_matches(genome, found, matches)
            if side > self.finest:
                left = matches.energy - matches.gain > (self._threshold * side) ** 2
                strayed = np.concatenate([strayed, found[left]])
        return genome, strayed


def _strayed(pavement: Pavement, grain: int, error: np.ndarray, threshold: float) -> np.ndarray:
    """Bool ``(H, W)``: range blocks, of larger ones than ``grain`` px the parts of that side, whose
    mean squared ``error`` (H, W) is above the threshold."""
    wrong = pavement.raster(pavement.sums(error) > threshold**2 * pavement.area)
    if pavement.coarsest > grain:
        parts = Pavement(pavement.height, pavement.width, grain)
        bad = parts.raster(parts.sums(error) > threshold**2 * parts.area)
        wrong = np.where(pavement.raster(pavement.side) > grain, bad, wrong)
    return wrong


def _touched(pavement: Pavement, where: np.ndarray) -> np.ndarray:
    """Which range blocks hold a true pixel of ``where``."""
    return np.flatnonzero(touched(where, *pavement.corners, pavement.side))


def _decoded(genome: Genome, start: np.ndarray, threshold: float) -> tuple[np.ndarray, np.ndarray]:
    """What the genome decodes to, as well as the ``threshold`` asks for, and which lifs are to be
    matched again whatever they decode to.

    Codes without a cap on σ may diverge once crossed: then one step from where decoding should
    ``start`` stands for the decoded map, and the lifs that do not contract are to blame.
    """
    collage = CollageMap(genome)
    least, most = _TOLERANCES
    tolerance = least if genome.sigma_max >= 1 else min(max(threshold / 10, least), most)
    found = fixed_point(collage.lay, start, tolerance=tolerance, again=collage.lay_again)
    if found.lost:
        return collage(start), np.abs(genome.sigma) >= 1
    return np.maximum(found.values, 0), np.zeros(len(genome), bool)
