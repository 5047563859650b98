"""The best domain block of each range block, decided in float64 however it was found."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity import isometries
from evocity.coding.matching.d4 import d4_codes
from evocity.coding.matching.domains import DomainPool
from evocity.coding.matching.likeness import RangeCodes
from evocity.coding.matching.scoring import rank, settle
from evocity.coding.matching.shapes import Shapes
from evocity.coding.topology import Candidates

#: Gains closer than this share of the range block's energy are a tie, won by the lowest
#: (D, y, x, iso).
TIE = 1e-9
#: How far float32 gains may be off, as a share of the energy; closer ones are re-scored. Sums of
#: blocks above `_SIDE` round more, about in proportion to B.
UNSURE, _SIDE = 2e-5, 16
#: Domains remembered for each range block until the best is known.
_ROOM = 16


@dataclass(frozen=True, eq=False)
class Matches:
    """Best domain of each of n range blocks: arrays ``(n,)``.

    multiple (D/B), y, x (px), iso, sigma, beta (m); gain, energy (m², summed over the block):
    what the match explains of ‖r̃‖². Where nothing explains anything, multiple, sigma and
    gain are 0 and beta is the block's mean.
    """

    multiple: np.ndarray
    y: np.ndarray
    x: np.ndarray
    iso: np.ndarray
    sigma: np.ndarray
    beta: np.ndarray
    gain: np.ndarray
    energy: np.ndarray


class Search:
    """What is known of n range blocks ``(n, B²)`` while pool after pool goes by.

    codes : float32 ``(n, B²)``, D4 coordinates of the blocks made zero-mean, m.
    ranges : the same with the norms of their parts.
    energy : float64 ``(n,)``, ‖r̃‖², m².
    best : float32 ``(n,)``, the largest gain so far.
    unsure : float32 ``(n,)``, how far that may be off.
    """

    def __init__(self, flat: np.ndarray, sigma_max: float):
        count, pixels = flat.shape
        self.block, self.cap = int(np.sqrt(pixels)), float(np.float32(sigma_max))
        self.centred = flat - flat.mean(axis=1, keepdims=True)
        self.energy = np.einsum("nk,nk->n", self.centred, self.centred)
        self.codes = d4_codes(self.centred.astype(np.float32))
        self.unsure = (UNSURE * max(1, self.block / _SIDE) * self.energy).astype(np.float32)
        self.best = np.zeros(count, np.float32)
        self.records = np.zeros((count, _ROOM))
        self.places = np.zeros((count, _ROOM), np.int64)
        self.count = np.zeros(count, np.int64)
        self.shrunk: dict[int, np.ndarray] = {}

    @cached_property
    def ranges(self) -> RangeCodes:
        return RangeCodes.of(self.codes)

    def near(self, part: slice, tolerance: float = 0.0) -> np.ndarray:
        """Float32 gains from which on a domain may be the best of its range block, or within
        ``tolerance`` (a share of the range block's energy) of the best."""
        less = self.unsure[part] + (tolerance * self.energy[part]).astype(np.float32)
        return np.maximum(self.best[part] - less, np.float32(1e-30))

    def settle(self, pool: DomainPool, part: slice, which, y, x) -> None:
        """Keep the best of the domains of ``pool`` at (y, x) of the map for the ``which``-th of
        ``part``."""
        settle(
            which, y, x, pool.shrunk, pool.multiple, self.block,
            self.centred[part], isometries.sources(self.block), self.cap,
            TIE * self.energy[part], self.records[part], self.places[part], self.count[part],
        )  # fmt: skip

    def scored(self, which, multiple, y, x, flat: np.ndarray, least: np.ndarray) -> Candidates:
        """Of the domains (multiple, y, x) for the ``which``-th of blocks ``flat`` (n, B²), under
        all isometries, those that explain at least ``least`` (n,). ``which`` ascends."""
        means = flat.mean(axis=1)
        gains, slopes = np.empty((2, which.size, 8))
        levels = np.empty(which.size)
        for step, shrunk in self.shrunk.items():
            (hit,) = np.nonzero(multiple == step)
            found = np.empty((hit.size, 8)), np.empty((hit.size, 8)), np.empty(hit.size)
            rank(
                which[hit], y[hit], x[hit], shrunk, step, self.block, flat - means[:, None],
                isometries.sources(self.block), self.cap, *found,
            )  # fmt: skip
            gains[hit], slopes[hit], levels[hit] = found
        place, iso = np.nonzero(gains >= least[which, None])
        block, slope = which[place], slopes[place, iso]
        return Candidates(
            starts=np.searchsorted(block, np.arange(len(flat) + 1)),
            multiple=multiple[place],
            y=y[place],
            x=x[place],
            iso=iso,
            sigma=slope,
            beta=means[block] - slope * levels[place],
        )

    def matches(self, blocks: np.ndarray, shapes: Shapes) -> Matches:
        """The result for all blocks ``(n, B, B)``, whose ``shapes`` were searched."""
        kept = np.arange(_ROOM) < self.count[:, None]
        most = self.records.max(axis=1, initial=0, where=kept)
        least = most - TIE * self.energy
        wins = kept & (self.records >= np.maximum(least, TIE * self.energy)[:, None])
        first = self.places.min(axis=1, initial=np.iinfo(np.int64).max, where=wins)
        found = wins.any(axis=1)
        place = np.where(found, first, 0)
        multiple, y, x = place >> 42, place >> 21 & 0x1FFFFF, place & 0x1FFFFF
        gains, slopes, level = (
            np.zeros((len(place), 8)),
            np.zeros((len(place), 8)),
            np.zeros(len(place)),
        )
        for step, shrunk in self.shrunk.items():
            (hit,) = np.nonzero(multiple == step)
            ranked = np.empty((hit.size, 8)), np.empty((hit.size, 8)), np.empty(hit.size)
            rank(
                np.arange(hit.size), y[hit], x[hit], shrunk, step, self.block, self.centred[hit],
                isometries.sources(self.block), self.cap, *ranked,
            )  # fmt: skip
            gains[hit], slopes[hit], level[hit] = ranked
        enough = gains >= np.minimum(least, gains.max(axis=1))[:, None]
        of = shapes.of
        # of the isometries that match the shape as well, the lowest once it is turned to the block
        iso = isometries.LOWEST[shapes.iso, np.packbits(enough, axis=1, bitorder="little")[of, 0]]
        own = isometries.COMPOSITION[isometries.INVERSE[shapes.iso], iso]
        slope = np.where(found[of], shapes.sign * slopes[of, own], 0.0)
        flat = blocks.reshape(len(blocks), self.block**2)
        return Matches(
            multiple=multiple[of],
            y=y[of],
            x=x[of],
            iso=iso,
            sigma=slope,
            beta=flat.mean(axis=1, dtype=np.float64) - slope * level[of],
            gain=np.where(found[of], gains[of, own], 0.0),
            energy=self.energy[of],
        )


def listed(kernel, columns: int, *arguments) -> np.ndarray:
    """What a kernel of the kind of list_tiles lists: int64 ``(columns, n)``."""
    room = 1 << 15
    while True:
        found = np.empty((columns, room), np.int64)
        count = kernel(*arguments, *found)
        if count <= room:
            return found[:, :count]
        room = count
