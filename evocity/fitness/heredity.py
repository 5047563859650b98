"""What a child kept of its parents: whole buildings, and the map that breeding meant to lay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
    their edges; this says how many. Of children between two parents (interpolation, pairing of
    contents), whose lifs are named after one of them, it says nothing.

    Formula: Σ area of whole buildings / Σ built area of the stones (range blocks of the parents)
    that the child is laid of.
    Unit: none. Range: 0 to 1; NaN if no stone is built on. Raises `FitnessError` if a lifs of
    the child comes from none of the parents.
    Source: ours, see `evocity.operators` on crossing groups of lifs.
    """
    stones = _Stones(genome)
    pixels = genome.pavement.block**2
    whole, built = np.zeros((2, len(genome), pixels), bool)
    traced = np.zeros(len(genome), bool)
    for parent in parents:
        city = decode(parent).city
        keys = stones.keys_of(parent)
        blocks = parent.pavement.blocks(city.built).reshape(-1, pixels)
        order = np.argsort(keys, kind="stable")
        at = order[np.minimum(np.searchsorted(keys[order], stones.keys), keys.size - 1)]
        found = (keys[at] == stones.keys) & ~traced
        built[found], traced = blocks[at][found], traced | found
        labels = parent.pavement.blocks(city.labels).reshape(-1, pixels)
        for building, lifs in _buildings(labels):
            for places in stones.copies(keys, lifs, parent.pavement.columns):
                whole[places] |= labels[lifs] == building
    if not traced.all():
        strange = sorted({genome.cities[one] for one in np.unique(genome.parent[~traced])})
        raise FitnessError(
            f"{np.count_nonzero(~traced)} lifs from {', '.join(strange)}, of none of the parents",
            "the parents a child was bred from",
            "pass all its parents, or the sources of all its cities",
        )
    total = np.count_nonzero(built)
    return np.count_nonzero(whole & built) / total if total else math.nan


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

    def copies(self, keys: np.ndarray, lifs: np.ndarray, columns: int) -> np.ndarray:
        """Where the parent's ``lifs``, indices into ``keys``, lie together in the child: a row of
        range blocks ``(len(lifs),)`` each time."""
        row, column = np.divmod(lifs, columns)
        found = self.places.get(int(keys[lifs[0]]), np.empty(0, np.int64))
        down, across = np.divmod(found, self.columns)
        for k in range(1, lifs.size):
            i, j = down + row[k] - row[0], across + column[k] - column[0]
            inside = (i >= 0) & (i < self.shape[0]) & (j >= 0) & (j < self.shape[1])
            there = np.zeros(down.size, bool)
            there[inside] = self.keys[i[inside] * self.columns + j[inside]] == keys[lifs[k]]
            down, across = down[there], across[there]
        rows, sides = down[:, None] + row - row[0], across[:, None] + column - column[0]
        return rows * self.columns + sides


def _buildings(labels: np.ndarray):
    """(label, lifs it stands on) of each building of ``labels`` (n, B²)."""
    lifs, pixel = np.nonzero(labels)
    pairs = np.unique(np.stack([labels[lifs, pixel], lifs]), axis=1)
    starts = np.flatnonzero(np.diff(pairs[0], prepend=-1))
    for members in np.split(pairs, starts[1:], axis=1):
        if members.size:
            yield int(members[0, 0]), members[1]


__all__ = ["Heritability", "heritability", "integrity"]
