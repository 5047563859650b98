"""What a child kept of its parents: whole buildings, and the map that breeding meant to lay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.coding.decode import decode
from evocity.coding.decoded import decoded
from evocity.errors import FitnessError
from evocity.fitness._kernels import mark_whole
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.fitness.sizes import crumbs
from evocity.genome import Genome


@dataclass(frozen=True)
class Heritability:
    """How truly a code carries the map it is meant to be.

    distance : root mean square difference of the decoded map from the one meant, metres.
    crumbs : how many more crumbs (`crumbs`, 1/ha) the decoded map has than the one meant;
        NaN where nothing is built in one of them.
    """

    distance: float
    crumbs: float


def heritability(genome: Genome, intended: np.ndarray) -> Heritability:
    """How far a child's decoded map is from what its operator meant to lay.

    intended : float32 ``(H, W)``, metres, as in the `Draft` of an operator.
    """
    decoded = decode(genome).city
    meant = decoded.replace(intended)
    distance = math.sqrt(float(np.mean((decoded.heights - meant.heights) ** 2, dtype=np.float64)))
    return Heritability(distance, float(crumbs(decoded)) - float(crumbs(meant)))


@fitness(goal="max", range=(0, 1))
def integrity(city: CityMap, genome: Genome, parents: Sequence[Genome]) -> float:
    """Share of what is built that belongs to parents' buildings still present whole.

    A building, a built component of a parent's decoded map, is whole where all range blocks it
    stands on came to the child together, each in its place beside the others: traced by
    ``parent`` and ``source``, wherever in the child that is. Macro-blocks cut buildings at
    their edges; this says how many. Of children between two parents (interpolation, pairing of
    contents), whose lifs are named after one of them, it says nothing.

    Formula: Σ area of whole buildings / Σ built area of the stones (range blocks of the parents)
    that the child is laid of.
    Unit: none. Range: 0 to 1. Empty map: NaN, no stone is built on.
    Source: ours, see `evocity.operators` on crossing groups of lifs.

    >>> heights = np.zeros((32, 32))
    >>> heights[4:12, 4:20] = 9
    >>> code = evocity.encode(CityMap(heights, 2.0)).genome
    >>> integrity(evocity.decode(code).city, genome=code, parents=[code])
    1.0
    """
    share = integrity_of(genome, parents)
    return Undefined("no stone is built on") if math.isnan(share) else share


def integrity_of(genome: Genome, parents: Sequence[Genome]) -> float:
    """The measure `integrity` of a child ``genome`` of ``parents``; NaN if no stone is built on.

    Raises `FitnessError` if a lifs of the child comes from none of the parents.
    """
    numbers = {name: number for number, name in enumerate(genome.cities)}
    laid = _stones(genome, numbers)
    order = np.argsort(laid, kind="stable")
    pixels = genome.pavement.block**2
    whole, built = np.zeros((2, len(genome), pixels), bool)
    traced = np.zeros(len(genome), bool)
    for parent in parents:
        city = decoded(parent).city
        stones = _stones(parent, numbers)
        blocks = parent.pavement.blocks(city.built).reshape(-1, pixels)
        by_stone = np.argsort(stones, kind="stable")
        at = by_stone[np.minimum(np.searchsorted(stones[by_stone], laid), stones.size - 1)]
        found = (stones[at] == laid) & ~traced
        built[found], traced = blocks[at][found], traced | found
        labels = parent.pavement.blocks(city.labels).reshape(-1, pixels)
        starts, members = _footings(labels)
        begins = stones[members[starts[:-1]]]
        first, last = (np.searchsorted(laid[order], begins, side) for side in ("left", "right"))
        mark_whole(
            starts, members, labels, stones, parent.pavement.columns,
            order, first, last, laid, genome.pavement.columns, whole,
        )  # fmt: skip
    if not traced.all():
        strange = sorted({genome.cities[one] for one in np.unique(genome.parent[~traced])})
        raise FitnessError(
            f"{np.count_nonzero(~traced)} lifs from {', '.join(strange)}, of none of the parents",
            "the parents a child was bred from",
            "pass all its parents, or the sources of all its cities",
        )
    total = np.count_nonzero(built)
    return np.count_nonzero(whole & built) / total if total else math.nan


def _stones(genome: Genome, numbers: dict[str, int]) -> np.ndarray:
    """One number a lifs for the stone it is, (city, source), the same in parent and child, whose
    cities are ``numbers``; negative for cities the child lacks."""
    cities = np.array([numbers.get(name, -1) for name in genome.cities], np.int64)
    return cities[genome.parent] << 32 | genome.source.astype(np.int64)


def _footings(labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lifs that each building of ``labels`` (n, B²) stands on: building b (label b + 1) on
    members[starts[b] : starts[b + 1]], ascending."""
    count = int(labels.max(initial=0))
    lifs, pixel = np.nonzero(labels)
    pairs = np.flatnonzero(np.bincount((labels[lifs, pixel] - 1) * len(labels) + lifs))
    building, members = np.divmod(pairs, len(labels))
    return np.searchsorted(building, np.arange(count + 1)), members


__all__ = ["Heritability", "heritability", "integrity", "integrity_of"]
