"""The fabric in a run's genomes, for questions about stones of cities."""

from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import RunError
from evocity.genome import Genome
from evocity.store import Header, RunLog

# Births whose genomes are held at a time.
_AT_A_TIME = 256


def fabric_of(header: Header, genome: Any, what: str) -> Genome:
    """Return the fabric in a ``genome``. Raises `RunError`, which names ``what`` was asked for, if
    the run of this ``header`` breeds other forms."""
    fabric = header.chromosome.fabric(genome)
    if fabric is None:
        raise RunError(
            f"{header.kind}s have no source cities for {what}",
            "a run that breeds fabrics or sites, whose parts come from source cities",
            "use the picture, the measures and the pedigree of the birth instead",
        )
    return fabric


def built_shares(fabric: Genome, city: CityMap) -> np.ndarray:
    """Return the share of each source city's stones in what is built on ``city``, the map of
    ``fabric``: float64 ``(len(fabric.cities),)``, together 1, or all 0 where nothing is built."""
    return fabric.shares_of(fabric.pavement.sums(city.built.astype(np.float32)))


def shares_of(run: RunLog, ids: np.ndarray) -> np.ndarray:
    """Return the share of each source city's stones in the maps of the births ``ids``, float64
    ``(n, cities)``; NaN for a birth without a genome."""
    shares = np.full((len(ids), len(run.header.cities)), np.nan)
    order = np.argsort(ids, kind="stable")  # births of a generation lie together in the log
    for rows in np.array_split(order, len(ids) // _AT_A_TIME + 1):
        for row, birth in zip(rows, run.individuals(ids[rows].tolist()), strict=True):
            if birth.genome is not None:
                shares[row] = fabric_of(run.header, birth.genome, "the ancestry").shares
    return shares


def share_text(share: float) -> str:
    """Return a share in words; a share between nothing and all is neither 0 % nor 100 %."""
    if 0 < share < 0.005:
        return "under 1%"
    return "over 99%" if 0.995 <= share < 1 else f"{share:.0%}"
