"""What of a run's genomes is fabric, for what makes sense of that alone."""

from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import RunError
from evocity.genome import Genome
from evocity.store import Header


def fabric_of(header: Header, genome: Any, what: str) -> Genome:
    """What of a ``genome`` is fabric. Raises `RunError`, which tells ``what`` was asked for, if
    the run of this ``header`` breeds something else."""
    found = header.chromosome.fabric(genome)
    if found is None:
        raise RunError(
            f"{what} of a {header.kind}",
            "a run that breeds fabrics or sites: what is bred of stones of cities",
            "leave it out; its picture, its measures and its pedigree are there",
        )
    return found


def built_shares(fabric: Genome, city: CityMap) -> np.ndarray:
    """Float64 ``(len(fabric.cities),)``: the share of what is built on the ``city``, which the
    ``fabric`` decodes to, that is each source city's stone; they sum to 1, or are 0 where nothing
    is built."""
    return fabric.shares_of(fabric.pavement.sums(city.built.astype(np.float32)))


def told_share(share: float) -> str:
    """A share in words: of one that is neither nothing nor all, neither 0 % nor 100 %."""
    if 0 < share < 0.005:
        return "under 1%"
    return "over 99%" if 0.995 <= share < 1 else f"{share:.0%}"


__all__ = ["built_shares", "fabric_of", "told_share"]
