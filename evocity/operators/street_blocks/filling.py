"""A genome whose street blocks are filled with buildings, one after another."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from math import ceil

import numpy as np

from evocity.coding.decoded import decoded
from evocity.genome import Genome, Pieces, laid
from evocity.isometries import AFFINE
from evocity.operators.crossing import raw_heights
from evocity.operators.pavement_fusion import ground
from evocity.operators.street_blocks.blocks import StreetBlocks, street_blocks
from evocity.operators.street_blocks.fits import Fit, Room, best_place
from evocity.operators.street_blocks.stones import Stones
from evocity.pavement import Pavement

#: A donor has the same fabric in a street block if it shares more than this of its built cells.
_SAME = 0.5
#: A donor's fabric is other than what stands there where heights differ by more, metres.
_OTHER = 1.0


class Filling:
    """The first parent, as its street blocks are filled with buildings of its parents.

    grid : the cells that borders of street blocks follow.
    spread, density, facades, repeats : as in `evocity.operators.QuarterFusion`.
    widened : metres that a filled block gives to the streets around it.

    host : the first parent's `StreetBlocks`.
    given : int64 ``(R, C)``: which parent each cell's fabric is of; ``len(parents)`` is the void.
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
        self._blocks = blocks if layer is None else [_free(one, grid, layer.mask) for one in blocks]
        self._stones = Stones(parents, grid)
        self._stones.count(self._stones.of[0].ravel(), 1)
        self.given = np.zeros((grid.rows, grid.columns), np.int64)
        self._bare = np.zeros(self.given.shape, bool)
        self._iso = np.zeros(self.given.shape, np.uint8)
        self._own = np.indices(self.given.shape)
        self._from = self._own.copy()

    @property
    def void(self) -> int:
        """What stands for the void among donors: one more than the parents."""
        return len(self._parents)

    def numbers(self, area_min: float) -> np.ndarray:
        """The street blocks that may be filled: of ``area_min`` m² or more, with a building, and
        nothing in them locked."""
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
        """Fill a street block with buildings of a ``donor``, the first parent itself included;
        False if it keeps its own, since no others fit."""
        fit = None if donor == self.void else self.fit(number, donor, rng)
        if fit is None and donor != self.void:
            return False
        self.lay(number, donor, fit)
        return True

    def fit(self, number: int, donor: int, rng: np.random.Generator) -> Fit | None:
        """Where a ``donor`` fits best into a street block; None if nowhere."""
        room, theirs = self._room(number), self._blocks[donor]
        own = self._stones.of[0][room.within]
        # what stands here counts as well: laid again it would change nothing
        stale = self._stones.stale(donor, theirs.built, self._repeats)
        built = room.block & self.host.built[room.within]
        same = (own == self._stones.of[donor][room.within])[built]
        # where a donor has the same fabric here, its own place would win and nothing would change
        itself = donor == 0 or np.count_nonzero(same) > _SAME * same.size
        return best_place(room, theirs, stale, self._density, self._spread, rng, itself)

    def in_place(self, number: int, donor: int) -> Fit | None:
        """What a ``donor`` has in a street block's own place, if no building of it lies partly
        outside, it covers enough, and is other than what stands there; else None."""
        room, theirs = self._room(number), self._blocks[donor]
        fit = Fit(0, room.top, room.left, room.block)
        there = fit.seen(theirs.components)
        numbers, counts = np.unique(there[room.block], return_counts=True)
        here = numbers > 0
        whole = (counts[here] == theirs.covered[numbers[here]]).all()
        if not whole or counts[here].sum() < self._density * room.density * room.area:
            return None
        heights = self._heights
        apart = np.abs(heights[donor] - heights[0]).max(axis=(1, 2)).reshape(self.given.shape)
        if not (apart[room.within][room.block] > _OTHER).any():
            return None
        return replace(fit, kept=(there > 0) & room.block)

    def lay(self, number: int, donor: int, fit: Fit | None) -> None:
        """Lay what a ``fit`` of a ``donor`` shows into a street block; None leaves it bare."""
        room = self._room(number)
        whole = room.block | room.ring
        if fit is None:
            left_out = np.zeros(room.block.shape, bool)
        else:
            left_out = fit.seen(self._blocks[donor].built) & ~fit.kept
        self._lay(room, donor, fit, left_out)
        self._stones.count(self._stones.of[0][room.within][whole], -1)
        if fit is not None:
            self._stones.count(fit.seen(self._stones.of[donor])[fit.kept], 1)

    def _room(self, number: int) -> Room:
        return Room.of(self.host, number, self._facades, self._widened)

    @cached_property
    def _heights(self) -> np.ndarray:
        """What each parent decodes to in each cell, ``(parents, n, B, B)``, metres."""
        return np.stack([self._grid.blocks(raw_heights(parent)) for parent in self._parents])

    def _lay(self, room: Room, donor: int, fit: Fit | None, left_out: np.ndarray) -> None:
        """Lay what a ``fit`` of a ``donor`` shows; the void where buildings are ``left_out``, and
        where the streets are wider."""
        within = room.within
        if fit is not None:
            for kept, own in zip(self._from, self._own, strict=True):
                np.copyto(kept[within], fit.seen(own), where=room.block)
            self._iso[within][room.block] = fit.iso
        self.given[within][room.block | room.ring] = donor
        bare = room.ring | (left_out & room.block) | (room.block & (fit is None))
        self._bare[within] |= bare

    def genome(self) -> Genome:
        """The lifs of all, as they are laid."""
        bare = self._bare
        pieces = Pieces(
            self._grid.block,
            np.where(bare, self.void, self.given),
            *np.where(bare, self._own, self._from),
            np.where(bare, 0, self._iso).astype(np.uint8),
        )
        return laid([*self._parents, ground(self._parents[0])], pieces, carried=True).genome

    def intended(self) -> np.ndarray:
        """The map that is meant, float32 ``(H, W)``, metres."""
        from evocity.operators.street_blocks._kernels import lay_cells

        heights = np.stack([raw_heights(parent) for parent in self._parents])
        found = np.empty(heights.shape[1:], np.float32)
        whose = np.where(self._bare, self.void, self.given)
        lay_cells(heights, whose, *self._from, self._iso, AFFINE, self._grid.block, found)
        return found


def _free(blocks: StreetBlocks, grid: Pavement, mask: np.ndarray) -> StreetBlocks:
    """Street blocks of a donor, of which no building is laid that a ``mask`` (H, W) locks a pixel
    of: it would stand twice."""
    held = np.zeros(blocks.covered.size, bool)
    held[blocks.components.ravel()[grid.blocks(mask).any(axis=(1, 2))]] = True
    return replace(blocks, components=np.where(held[blocks.components], 0, blocks.components))
