"""Collage repair: what makes fabric heritable.

A block crumbles when its domain block lies where another city now stands. Only the blocks that
decode wrongly are matched again, on the map the operator meant to lay.
"""

from collections.abc import Sequence

import numpy as np

from evocity.coding.decode import decode
from evocity.coding.encode import with_matches
from evocity.coding.search import best_matches
from evocity.coding.search.domains import domain_pools
from evocity.genome import Genome


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
    for _ in range(rounds):
        decoded = decode(genome, start=intended).city.heights
        strayed = (pavement.blocks(decoded) - wanted) ** 2
        bad = np.flatnonzero((strayed.mean(axis=(1, 2)) > threshold**2) & ~replaced)
        if bad.size == 0:
            break
        if pools is None:
            pools = list(domain_pools(intended, pavement.block, set(domains)))
        matches = best_matches(
            pools,
            wanted[bad],
            tuple(corner[bad] for corner in pavement.corners),
            reach=reach,
            sigma_max=genome.sigma_max,
        )
        genome = with_matches(genome, bad, matches)
        replaced[bad] = True
    return genome, int(replaced.sum())
