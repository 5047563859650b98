"""Refill of a genome's street blocks with buildings; origins of cells in the source cities."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from math import ceil

import numpy as np

from evocity.coding.decoding_cache import decoded
from evocity.genome import VOID, Genome, Pieces, laid, unpacked
from evocity.isometries import AFFINE
from evocity.operators.crossover import raw_heights
from evocity.operators.pavement_fusion import ground
from evocity.operators.street_blocks.blocks import StreetBlocks, street_blocks
from evocity.operators.street_blocks.placement import Fit, Room, best_place, sums_of
from evocity.pavement import Pavement

#: A donor has the same fabric in a street block if it shares more than this of its built cells.
_SAME = 0.5
#: A donor's fabric differs from the present one where heights differ by more, metres.
_OTHER = 1.0


class Origins:
    """The origins of some genomes' cells by numbers, and the number of each on a map.

    of : int64 ``(R, C)`` for each genome, the origin of each cell of the grid: equal numbers for
        the same square of the same source city, under any isometry; 0 for the void. Cells are as
        fine as the finest range blocks, so each shows a part of a single range block.
    """

    def __init__(self, genomes: Sequence[Genome], grid: Pavement):
        names = dict.fromkeys(name for genome in genomes for name in genome.cities if name != VOID)
        cities = {name: k for k, name in enumerate(names)}
        places = [_places(genome, grid, cities) for genome in genomes]
        tall, wide = (1 + max(int(place[k].max()) for place in places) for k in (1, 2))
        self.of = [
            np.where(city < 0, 0, (city.astype(np.int64) * tall + row) * wide + column + 1)
            for city, row, column in places
        ]
        self._counts = np.zeros(len(cities) * tall * wide + 1, np.int64)
        self._known: dict[tuple[int, float], tuple[np.ndarray, np.ndarray]] = {}

    def count(self, origins: np.ndarray, step: int) -> None:
        """Add ``step`` to the number of each of the ``origins`` on the map."""
        np.add.at(self.counts, origins, step)

    @property
    def counts(self) -> np.ndarray:
        """The number of each origin on the map, int64 ``(k,)``, which the caller may change."""
        self._known.clear()
        return self._counts

    def stale(self, genome: int, built: np.ndarray, discount: float) -> np.ndarray:
        """Compute the discount of a genome's ``built`` cells, bool ``(R, C)``: float32 ``(R, C)``,
        ``discount`` where the origin stands on the map already. The void has no origin. The same
        array is returned until the next `count`."""
        from evocity.operators.street_blocks._kernels import stale_cells

        known = self._known.get((genome, discount))
        if known is not None and known[0] is built:
            return known[1]
        stale = np.empty(built.shape, np.float32)
        stale_cells(built, self.of[genome], self._counts, np.float32(discount), stale)
        self._known[genome, discount] = built, stale
        return stale

    def stand(self, genome: int, places: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Tell whether the origins of a genome's cells at these rows and columns stand on the map:
        bool ``(n,)``."""
        origins = self.of[genome][places]
        return (origins > 0) & (self._counts[origins] > 0)


def _places(genome: Genome, grid: Pavement, cities: dict[str, int]) -> np.ndarray:
    """Tabulate city (−1: void), row and column of each cell's origin, int32 ``(3, R, C)``."""
    from evocity.operators.street_blocks._kernels import stones_of_cells

    pavement = genome.pavement
    numbers = np.array([cities.get(name, -1) for name in genome.cities], np.int32)
    places = np.empty((3, grid.rows, grid.columns), np.int32)
    stones_of_cells(
        pavement.index, *pavement.corners, pavement.side, genome.turn,
        numbers[genome.parent], *unpacked(genome.source), AFFINE, grid.block, places,
    )  # fmt: skip
    return places


class Filling:
    """The first parent, while buildings of its parents fill its street blocks.

    grid : the cells that borders of street blocks follow.
    spread, density, facades, repeats : as in `evocity.operators.QuarterFusion`.
    widened : metres that a filled block gives to the streets around it.

    host : the first parent's `StreetBlocks`.
    owner : int64 ``(R, C)``: the parent of each cell's fabric; ``len(parents)`` is the void.
    """

    def __init__(
        self,
        parents: Sequence[Genome],
        grid: Pavement,
        *,
        spread: float,
        density: float,
        facades: float,
        repeats: float,
        widened: float = 0.0,
    ):
        self._parents, self._grid = parents, grid
        self._spread, self._density = spread, density
        self._facades, self._repeats = facades, repeats
        self._widened = ceil(widened / (grid.block * parents[0].metres_per_pixel))
        blocks = [street_blocks(decoded(parent).city, grid) for parent in parents]
        self.host = blocks[0]
        layer = parents[0].condensation
        if layer is not None:
            blocks = [_drop_locked(donor, grid, layer.mask) for donor in blocks]
        self._blocks = blocks
        self._origins = Origins(parents, grid)
        self._origins.count(self._origins.of[0].ravel(), 1)
        self.owner = np.zeros((grid.rows, grid.columns), np.int64)
        self._sums: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._bare = np.zeros(self.owner.shape, bool)
        self._iso = np.zeros(self.owner.shape, np.uint8)
        self._cells = np.indices(self.owner.shape)
        self._sources = self._cells.copy()

    @property
    def void(self) -> int:
        """The number of the void among donors: one more than the parents."""
        return len(self._parents)

    def numbers(self, area_min: float) -> np.ndarray:
        """List the street blocks that may be filled: they have ``area_min`` m² or more, a building,
        and nothing locked."""
        cell = (self._grid.block * self._parents[0].metres_per_pixel) ** 2
        free = self.host.area * cell >= area_min
        free &= self.host.area > 0
        free[0] = False
        layer = self._parents[0].condensation
        if layer is not None:
            locked = self._grid.blocks(layer.mask).any(axis=(1, 2))
            free[self.host.labels.ravel()[locked]] = False
        return np.flatnonzero(free)

    def fill(self, number: int, donor: int, rng: np.random.Generator) -> bool:
        """Fill a street block with buildings of a ``donor``, which may be the first parent; returns
        False if none fit and it keeps its own."""
        fit = None if donor == self.void else self.fit(number, donor, rng)
        if fit is None and donor != self.void:
            return False
        self.lay(number, donor, fit)
        return True

    def fit(self, number: int, donor: int, rng: np.random.Generator) -> Fit | None:
        """Find the best place of a ``donor`` for a street block; None without one."""
        room, theirs = self._room(number), self._blocks[donor]
        here, there = (self._origins.of[k][room.within] for k in (0, donor))
        # the present fabric counts too: laid again it would change nothing
        stale = self._origins.stale(donor, theirs.built, self._repeats)
        built = room.block & self.host.built[room.within]
        same = (here == there)[built]
        # where a donor has the same fabric here, this very place would win and change nothing
        itself = donor == 0 or np.count_nonzero(same) > _SAME * same.size
        sums = self._sums_of(donor, stale)
        return best_place(room, theirs, stale, self._density, self._spread, rng, itself, sums)

    def _sums_of(self, donor: int, stale: np.ndarray) -> np.ndarray:
        """Sum the rows of a donor, once as long as the discount is the same array."""
        known = self._sums.get(donor)
        if known is None or known[0] is not stale:
            known = self._sums[donor] = stale, sums_of(self._blocks[donor], stale)
        return known[1]

    def in_place(self, number: int, donor: int) -> Fit | None:
        """Take a ``donor``'s fabric at a street block's own place, if no building lies partly
        outside, it covers enough, and differs from the present fabric; else None."""
        room, theirs = self._room(number), self._blocks[donor]
        fit = Fit(0, room.top, room.left, room.block)
        there = fit.view(theirs.components)
        numbers, counts = np.unique(there[room.block], return_counts=True)
        here = numbers > 0
        whole = (counts[here] == theirs.covered[numbers[here]]).all()
        if not whole or counts[here].sum() < self._density * room.density * room.area:
            return None
        heights = self._heights
        step = np.abs(heights[donor] - heights[0]).max(axis=(1, 2)).reshape(self.owner.shape)
        if not (step[room.within][room.block] > _OTHER).any():
            return None
        return replace(fit, kept=(there > 0) & room.block)

    def lay(self, number: int, donor: int, fit: Fit | None) -> None:
        """Lay a ``fit`` of a ``donor`` in a street block; None leaves it bare. The void replaces
        omitted buildings, and takes what wider streets gain."""
        from evocity.operators.street_blocks._kernels import lay_fit

        room = self._room(number)
        if fit is None:
            within, whole = room.within, room.block | room.ring
            self._origins.count(self._origins.of[0][within][whole], -1)
            self.owner[within][whole] = donor
            self._bare[within] |= whole
            return
        lay_fit(
            room.block, room.ring, fit.kept, room.top, room.left, donor, fit.iso, fit.top, fit.left,
            AFFINE, self._blocks[donor].built, self._origins.of[0], self._origins.of[donor],
            self._origins.counts, self.owner, self._iso, self._sources, self._bare,
        )  # fmt: skip

    def _room(self, number: int) -> Room:
        return Room.of(self.host, number, self._facades, self._widened)

    @cached_property
    def _heights(self) -> np.ndarray:
        """Decoded heights of each parent in each cell, ``(parents, n, B, B)``, metres."""
        return np.stack([self._grid.blocks(raw_heights(parent)) for parent in self._parents])

    def genome(self) -> Genome:
        """Lay the lifs of all parents."""
        bare = self._bare
        pieces = Pieces(
            self._grid.block,
            np.where(bare, self.void, self.owner),
            *np.where(bare, self._cells, self._sources),
            np.where(bare, 0, self._iso).astype(np.uint8),
        )
        return laid([*self._parents, ground(self._parents[0])], pieces, carried=True).genome

    def intended(self) -> np.ndarray:
        """Lay the intended map, float32 ``(H, W)``, metres."""
        from evocity.operators.street_blocks._kernels import lay_cells

        heights = np.stack([raw_heights(parent) for parent in self._parents])
        target = np.empty(heights.shape[1:], np.float32)
        owner = np.where(self._bare, self.void, self.owner)
        lay_cells(heights, owner, *self._sources, self._iso, AFFINE, self._grid.block, target)
        return target


def _drop_locked(blocks: StreetBlocks, grid: Pavement, mask: np.ndarray) -> StreetBlocks:
    """Drop the donor's buildings with a pixel locked by ``mask`` (H, W): they would stand twice."""
    held = np.zeros(blocks.covered.size, bool)
    held[blocks.components.ravel()[grid.blocks(mask).any(axis=(1, 2))]] = True
    return replace(blocks, components=np.where(held[blocks.components], 0, blocks.components))
