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
            np.where(city < 0, 0, (city.astype(np.int64) * tall + row) * wide + column + 1)
            for city, row, column in found
        ]
        self._counts = np.zeros(len(cities) * tall * wide + 1, np.int64)

    def count(self, stones: np.ndarray, step: int) -> None:
        """So many more of each of the ``stones`` stand on the map."""
        np.add.at(self._counts, stones, step)

    def stale(self, genome: int, built: np.ndarray, worth: float) -> np.ndarray:
        """What the cells of a genome that are ``built``, bool ``(R, C)``, count less: float32 ``(R,
        C)``, ``worth`` where the stone stands on the map already. The void is no stone."""
        from evocity.operators.street_blocks._kernels import stale_cells

        found = np.empty(built.shape, np.float32)
        stale_cells(built, self.of[genome], self._counts, np.float32(worth), found)
        return found


def _places(genome: Genome, grid: Pavement, cities: dict[str, int]) -> np.ndarray:
    """City, row and column of the stone of each cell, int32 ``(3, R, C)``; the city −1 for the
    void."""
    from evocity.operators.street_blocks._kernels import stones_of_cells

    pavement = genome.pavement
    numbers = np.array([cities.get(name, -1) for name in genome.cities], np.int32)
    found = np.empty((3, grid.rows, grid.columns), np.int32)
    stones_of_cells(
        pavement.index, *pavement.corners, pavement.side, genome.turn,
        numbers[genome.parent], *unpacked(genome.source), AFFINE, grid.block, found,
    )  # fmt: skip
    return found
