"""What a child kept of its parents: whole buildings, and the map that breeding meant to lay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.coding.decode import decode
from evocity.errors import FitnessError
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


def integrity(genome: Genome, parents: Sequence[Genome]) -> float:
    """Share of the built area that belongs to a parent's building still present whole.

    A building, a built component of a parent's decoded map, is whole where all range blocks it
    stands on came to the child together, each in its place beside the others: traced by
    ``parent`` and ``source``, wherever in the child that is. Macro-blocks cut buildings at
    their edges; this says how many.

    Formula: Σ area of whole buildings / Σ built area of the stones (range blocks of the parents)
    that the child is laid of.
    Unit: none. Range: 0 to 1; NaN if no stone is built on. Raises `FitnessError` if a lifs of
    the child comes from none of the parents.
    Source: ours, see `evocity.operators` on crossing groups of lifs.
    """
    stones = _Stones(genome)
    whole = 0.0
    built = np.full(len(genome), -1.0)
    for parent in parents:
        city = decode(parent).city
        keys = stones.keys_of(parent)
        order = np.argsort(keys, kind="stable")
        at = np.minimum(np.searchsorted(keys[order], stones.keys), keys.size - 1)
        found = (keys[order][at] == stones.keys) & (built < 0)
        area = parent.pavement.blocks(city.built).sum(axis=(1, 2))
        built[found] = area[order][at][found]
        whole += sum(
            size * stones.copies(keys, lifs, parent.pavement.columns)
            for size, lifs in _buildings(city, parent)
        )
    if (built < 0).any():
        strange = sorted({genome.cities[one] for one in np.unique(genome.parent[built < 0])})
        raise FitnessError(
            f"{np.count_nonzero(built < 0)} lifs from {', '.join(strange)}, of none of the parents",
            "the parents a child was bred from",
            "pass all its parents, or the sources of all its cities",
        )
    total = float(built.sum())
    return min(whole / total, 1.0) if total else math.nan


class _Stones:
    """Where in a child each stone, (city, source), lies."""

    def __init__(self, child: Genome):
        self.cities = {name: number for number, name in enumerate(child.cities)}
        self.keys = self.keys_of(child)
        self.columns = child.pavement.columns
        self.shape = child.pavement.rows, child.pavement.columns
        order = np.argsort(self.keys, kind="stable")
        kinds, first = np.unique(self.keys[order], return_index=True)
        self.places = dict(zip(kinds.tolist(), np.split(order, first[1:]), strict=True))

    def keys_of(self, genome: Genome) -> np.ndarray:
        """One number a stone, the same in parent and child; negative for cities the child lacks."""
        numbers = np.array([self.cities.get(name, -1) for name in genome.cities], np.int64)
        return numbers[genome.parent] << 32 | genome.source.astype(np.int64)

    def copies(self, keys: np.ndarray, lifs: np.ndarray, columns: int) -> int:
        """How often the parent's ``lifs``, indices into ``keys``, lie together in the child."""
        row, column = np.divmod(lifs, columns)
        found = self.places.get(int(keys[lifs[0]]), np.empty(0, np.int64))
        down, across = np.divmod(found, self.columns)
        for k in range(1, lifs.size):
            i, j = down + row[k] - row[0], across + column[k] - column[0]
            inside = (i >= 0) & (i < self.shape[0]) & (j >= 0) & (j < self.shape[1])
            there = np.zeros(found.size, bool)
            there[inside] = self.keys[i[inside] * self.columns + j[inside]] == keys[lifs[k]]
            found, down, across = found[there], down[there], across[there]
        return found.size


def _buildings(city: CityMap, parent: Genome):
    """(built pixels, lifs it stands on) of each building of a parent's decoded map."""
    pavement = parent.pavement
    labels = pavement.blocks(city.labels).reshape(len(pavement), -1)
    lifs, pixel = np.nonzero(labels)
    which = labels[lifs, pixel]
    pairs, counts = np.unique(np.stack([which, lifs]), axis=1, return_counts=True)
    starts = np.flatnonzero(np.diff(pairs[0], prepend=-1))
    for members, sizes in zip(
        np.split(pairs[1], starts[1:]), np.split(counts, starts[1:]), strict=True
    ):
        if members.size:
            yield int(sizes.sum()), members


__all__ = ["Heritability", "heritability", "integrity"]
