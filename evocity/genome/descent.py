"""What a child has of its parents besides their lifs: names, attribution, place, cap, settling."""

from collections.abc import Iterable, Sequence

import numpy as np

from evocity.errors import GenomeError
from evocity.genome.genome import Genome
from evocity.genome.nucleotides import MOST_PARENTS


def merged_cities(genomes: Iterable[Genome]) -> tuple[tuple[str, ...], list[np.ndarray], str]:
    """Common table of source cities for a child of ``genomes``.

    Returns the names (each once, in order of appearance), for each genome the place in them of
    each of its own cities, uint8, and the attributions joined.
    """
    genomes = list(genomes)
    names = list(dict.fromkeys(city for genome in genomes for city in genome.cities))
    if len(names) > MOST_PARENTS:
        raise GenomeError(
            f"{len(names)} source cities",
            f"at most {MOST_PARENTS}",
            "breed from genomes that share more of their cities",
        )
    number = {name: index for index, name in enumerate(names)}
    places = [np.array([number[city] for city in one.cities], np.uint8) for one in genomes]
    return tuple(names), places, joined(genome.attribution for genome in genomes)


def descended(genomes: Sequence[Genome]) -> tuple[list[dict[str, np.ndarray]], dict]:
    """What children of all ``genomes`` have in common, as `Genome.replace` takes it: ``cities``,
    ``attribution``, ``sigma_max``, ``settle`` (if any parent settles), and a place on Earth,
    ``origin`` and ``crs``, where all parents lie in one; and before it each genome's ``parent`` and
    ``other`` re-pointed into these cities."""
    cities, numbers, attribution = merged_cities(genomes)
    places = {(one.origin, one.crs) for one in genomes}
    origin, crs = places.pop() if len(places) == 1 else (None, None)
    pointers = [
        {"parent": number[one.parent], "other": number[one.other]}
        for number, one in zip(numbers, genomes, strict=True)
    ]
    return pointers, {
        "cities": cities,
        "attribution": attribution,
        "sigma_max": max(one.sigma_max for one in genomes),
        "origin": origin,
        "crs": crs,
        "settle": any(one.settle for one in genomes),
    }


def joined(attributions: Iterable[str]) -> str:
    """Several attributions as one; each of their lines, parted by "; ", once."""
    lines = (line for one in attributions for line in one.split("; ") if line)
    return "; ".join(dict.fromkeys(lines))
