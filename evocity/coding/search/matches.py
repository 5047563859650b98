"""The best domain block of each range block, decided in float64 however it was found."""

from dataclasses import dataclass

import numpy as np

from evocity import isometries
from evocity.coding.search.domains import DomainPool, d4_matrix
from evocity.coding.search.scoring import rank, resolve, settle
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

    codes : float32 ``(n, B²)``, D4 coordinates of the blocks made zero-mean.
    energy : float64 ``(n,)``, ‖r̃‖², m².
    best : float32 ``(n,)``, the largest gain so far.
    unsure : float32 ``(n,)``, how far that may be off.
    """

    def __init__(self, flat: np.ndarray, sigma_max: float):
        count, pixels = flat.shape
        self.block, self.cap = int(np.sqrt(pixels)), float(np.float32(sigma_max))
        self.centred = flat - flat.mean(axis=1, keepdims=True)
        self.energy = np.einsum("nk,nk->n", self.centred, self.centred)
        self.codes = self.centred.astype(np.float32) @ d4_matrix(self.block).T
        self.unsure = (UNSURE * max(1, self.block / _SIDE) * self.energy).astype(np.float32)
        self.best = np.zeros(count, np.float32)
        self.records = np.zeros((count, _ROOM))
        self.places = np.zeros((count, _ROOM), np.int64)
        self.count = np.zeros(count, np.int64)
        self.shrunk: dict[int, np.ndarray] = {}

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

    def matches(self, every: np.ndarray, of: np.ndarray) -> Matches:
        """The result for all blocks ``(n, B²)``; block i has the shape of the of[i]-th searched."""
        kept = np.arange(_ROOM) < self.count[:, None]
        most = self.records.max(axis=1, initial=0, where=kept)
        least = most - TIE * self.energy
        wins = kept & (self.records >= np.maximum(least, TIE * self.energy)[:, None])
        first = self.places.min(axis=1, initial=np.iinfo(np.int64).max, where=wins)
        place = np.where(wins.any(axis=1), first, 0)[of]
        multiple, y, x = place >> 42, place >> 21 & 0x1FFFFF, place & 0x1FFFFF
        means = every.mean(axis=1)
        centred = every - means[:, None]
        iso = np.zeros(len(every), np.uint8)
        slope, level = np.zeros(len(every)), np.zeros(len(every))
        for step, shrunk in self.shrunk.items():
            (hit,) = np.nonzero(multiple == step)
            found = np.zeros(hit.size, np.uint8), np.zeros(hit.size), np.zeros(hit.size)
            resolve(
                shrunk, step, y[hit], x[hit], self.block, centred[hit],
                isometries.sources(self.block), self.cap, least[of[hit]], *found,
            )  # fmt: skip
            iso[hit], slope[hit], level[hit] = found
        return Matches(
            multiple=multiple,
            y=y,
            x=x,
            iso=iso,
            sigma=slope,
            beta=means - slope * level,
            gain=np.where(wins.any(axis=1), most, 0)[of],
            energy=np.einsum("nk,nk->n", centred, centred),
        )


def listed(kernel, *arguments) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What a kernel of the kind of list_tiles lists: which range, y and x ``(n,)``."""
    room = 4096
    while True:
        found = np.empty((3, room), np.int64)
        count = kernel(*arguments, *found)
        if count <= room:
            return tuple(found[:, :count])
        room = count
