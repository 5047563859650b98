"""Which stone stands in each cell of a map: the square of a source city that it shows."""

from collections.abc import Sequence

import numpy as np

from evocity.genome import VOID, Genome, unpacked
from evocity.isometries import AFFINE
from evocity.pavement import Pavement


class Stones:
    """The stones of some genomes by numbers, and how often each stands on a map.

    of : of each genome int64 ``(R, C)``, the stone in each cell of the grid: the same number for
        the same square of the same source city, however it is turned; 0 for the void. Cells are as
        fine as the finest range blocks, so each shows a part of one.
    """

    def __init__(self, genomes: Sequence[Genome], grid: Pavement):
        names = dict.fromkeys(name for genome in genomes for name in genome.cities if name != VOID)
        cities = {name: k for k, name in enumerate(names)}
        found = [_places(genome, grid, cities) for genome in genomes]
        tall, wide = (1 + max(int(one[k].max()) for one in found) for k in (1, 2))
        self.of = [
            np.where(city < 0, 0, (city * tall + row) * wide + column + 1)
            for city, row, column in found
        ]
        self._counts = np.zeros(len(cities) * tall * wide + 1, np.int64)

    def count(self, stones: np.ndarray, step: int) -> None:
        """So many more of each of the ``stones`` stand on the map."""
        np.add.at(self._counts, stones, step)

    def standing(self, genome: int) -> np.ndarray:
        """Bool ``(R, C)``: which stones of a genome stand on the map already."""
        there = self._counts > 0
        there[0] = False  # the void is no stone
        return there[self.of[genome]]


def _places(genome: Genome, grid: Pavement, cities: dict[str, int]) -> tuple[np.ndarray, ...]:
    """City, row and column of the stone of each cell, ``(R, C)`` each; the city −1 for the void."""
    side, pavement = grid.block, genome.pavement
    y, x = np.mgrid[: grid.height : side, : grid.width : side]
    lifs = pavement.index[y, x]
    top, left = (corner[lifs] for corner in pavement.corners)
    last, a = pavement.side[lifs] - 1, AFFINE.T[:, genome.turn[lifs]]
    places = []
    for k, source in enumerate(unpacked(genome.source)):
        # where the source shows the cell's first pixel, and how far off its last one
        first = a[k] * last + a[k + 2] * (y - top) + a[k + 4] * (x - left)
        across = (a[k + 2] + a[k + 4]) * (side - 1)
        places.append((source[lifs] + first + np.minimum(across, 0)) // side)
    numbers = np.array([cities.get(name, -1) for name in genome.cities])
    return numbers[genome.parent[lifs]], *places
