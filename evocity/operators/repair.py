"""Collage repair: what makes fabric heritable.

A block crumbles when its domain block lies where another city now stands. Only the blocks that
decode wrongly are matched again, on the map the operator meant to lay.
"""

from collections.abc import Sequence

import numpy as np

from evocity.coding.decode import CollageMap, decode
from evocity.coding.encode import with_matches
from evocity.coding.matching import best_matches
from evocity.coding.matching.domains import domain_pools
from evocity.errors import GenomeError
from evocity.genome import Genome

#: The cap on |σ| of what is matched again where the code has none below 1: a parent's steep lifs
#: are tamed by its own fabric, and a child has another.
_CONTRACTIVE = 0.9


def collage_repair(
    genome: Genome,
    intended: np.ndarray,
    *,
    threshold: float,
    reach: int | None = 24,
    domains: Sequence[int] = (2,),
    rounds: int = 3,
) -> tuple[Genome, int]:
    """Re-match the blocks of ``genome`` whose decoded content strays from ``intended``.

    Parameters
    ----------
    intended : float32 ``(H, W)`` heights the operator meant to lay, metres; where the genome's
        condensation covers, its heights stand in their place.
    threshold : root mean square difference of a block that is still tolerated, metres.
    reach, domains : where the new domain blocks are searched, as in `evocity.encode`.
    rounds : a repaired block can disturb those that read it, so decode and repair again, at
        most so often.

    Returns
    -------
    The repaired genome (the same object if nothing strayed) and the number of lifs replaced.
    Parent and source of every lifs are kept: they name the stone the block should carry.
    """
    pavement = genome.pavement
    if genome.condensation is not None:
        intended = genome.condensation.laid(intended)
    wanted = pavement.blocks(intended)
    pools = None
    replaced = np.zeros(len(pavement), bool)
    steepest = genome.sigma_max if genome.sigma_max < 1 else _CONTRACTIVE
    # with a cap below 1 nothing can diverge; else the last round looks for that alone
    for turn in range(rounds + (genome.sigma_max >= 1)):
        decoded, steep = _decoded(genome, intended)
        strayed = (pavement.blocks(decoded) - wanted) ** 2
        wrong = (strayed.mean(axis=(1, 2)) > threshold**2) & ~replaced
        bad = np.flatnonzero(steep | (wrong & (turn < rounds)))
        if bad.size == 0:
            break
        if pools is None:
            pools = list(domain_pools(intended, pavement.block, set(domains)))
        matches = best_matches(
            pools,
            wanted[bad],
            tuple(corner[bad] for corner in pavement.corners),
            reach=reach,
            sigma_max=steepest,
        )
        genome = with_matches(genome, bad, matches)
        replaced[bad] = True
    return genome, int(replaced.sum())


def _decoded(genome: Genome, intended: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What the genome decodes to, and which lifs are to be matched again whatever they decode to.

    Codes without a cap on σ may diverge once crossed: then one step from what is ``intended``
    stands for the decoded map, and the lifs that do not contract are to blame.
    """
    try:
        return decode(genome, start=intended).city.heights, np.zeros(len(genome), bool)
    except GenomeError:
        return CollageMap(genome)(intended), np.abs(genome.sigma) >= 1
