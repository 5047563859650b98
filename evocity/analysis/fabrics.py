"""What of a run's genomes is fabric, for what makes sense of that alone."""

from typing import Any

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


__all__ = ["fabric_of"]
