"""Matches: the best domain block of each range block, decided in float64."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity import isometries
from evocity.coding.matching.candidates import RangeCodes, Shapes
from evocity.coding.matching.d4 import d4_codes
from evocity.coding.matching.domains import DomainPool
from evocity.coding.matching.exact_scores._kernels import conclude, rank, settle
from evocity.coding.parameters import Coding
from evocity.coding.topology import Candidates

#: Gains closer than this share of the range block's energy are a tie; the lowest (D, y, x, iso)
#: wins it.
TIE = 1e-9
#: The error of float32 gains, as a share of the energy; closer gains get a score in float64. Sums
#: of blocks above `_SIDE` round more, about in proportion to B.
UNSURE, _SIDE = 2e-5, 16
#: Domain blocks kept for each range block until the best is known.
_ROOM = 16


@dataclass(frozen=True, eq=False)
class Matches:
    """The best domain block of each of n range blocks, arrays ``(n,)``: multiple (D/B), y, x (px),
    iso, sigma, beta (m), the gain (the part of ‖r̃‖² that it explains, m²) and the energy ‖r̃‖².
    Without a domain block, multiple, sigma and gain are 0 and beta is the block's mean."""

    multiple: np.ndarray
    y: np.ndarray
    x: np.ndarray
    iso: np.ndarray
    sigma: np.ndarray
    beta: np.ndarray
    gain: np.ndarray
    energy: np.ndarray

    def nucleotides(self, side: int) -> dict[str, np.ndarray]:
        """Collect the nucleotides of lifs with these matches; their range blocks have ``side``
        px."""
        extent = self.multiple * side
        columns = {name: getattr(self, name) for name in ("sigma", "beta", "x", "y", "iso")}
        return columns | {"dx": extent, "dy": extent}


class Search:
    """The state of a search for n range blocks ``(n, B²)``, updated pool after pool: their D4
    ``codes`` (``ranges``, with norms of parts) and ``energy`` ‖r̃‖², m², made zero-mean; the
    largest gain so far, ``best``, and its error, ``unsure``, float32 ``(n,)``."""

    def __init__(self, flat: np.ndarray, coding: Coding):
        count, pixels = flat.shape
        self.block, self.reach = int(np.sqrt(pixels)), coding.reach
        self.cap = float(np.float32(coding.sigma_max))
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
        """Compute the float32 gains from which a domain block may be the best of its range block,
        or within ``tolerance`` (a share of the range block's energy) of the best."""
        less = self.unsure[part] + (tolerance * self.energy[part]).astype(np.float32)
        return np.maximum(self.best[part] - less, np.float32(1e-30))

    def settle(self, pool: DomainPool, part: slice, which, y, x) -> None:
        """Keep the best of the domain blocks of ``pool`` at (y, x) of the map for the
        ``which``-th range blocks of ``part``."""
        settle(
            which, y, x, pool.shrunk, pool.multiple, self.block,
            self.centred[part], isometries.sources(self.block), self.cap,
            TIE * self.energy[part], self.records[part], self.places[part], self.count[part],
        )  # fmt: skip

    def _rank(self, which, multiple, y, x, centred: np.ndarray) -> tuple[np.ndarray, ...]:
        """Compute gain and σ under each isometry, ``(m, 8)``, and mean height of the domain blocks
        (multiple, y, x) for the ``which``-th of zero-mean blocks; 0 without a domain block."""
        gains, slopes, levels = *np.zeros((2, len(y), 8)), np.zeros(len(y))
        for step, shrunk in self.shrunk.items():
            (hit,) = np.nonzero(multiple == step)
            scores = np.empty((hit.size, 8)), np.empty((hit.size, 8)), np.empty(hit.size)
            rank(
                which[hit], y[hit], x[hit], shrunk, step, self.block, centred,
                isometries.sources(self.block), self.cap, *scores,
            )  # fmt: skip
            gains[hit], slopes[hit], levels[hit] = scores
        return gains, slopes, levels

    def score(self, which, multiple, y, x, flat: np.ndarray, least: np.ndarray) -> Candidates:
        """Select the domain blocks (multiple, y, x), under all isometries, that explain at least
        ``least`` (n,) of the ``which``-th of blocks ``flat`` (n, B²). ``which`` ascends."""
        means = flat.mean(axis=1)
        gains, slopes, levels = self._rank(which, multiple, y, x, flat - means[:, None])
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
        """Build the result for all blocks ``(n, B, B)`` from the search of their ``shapes``."""
        if len(self.shrunk) == 1:
            return self._matches_in_one_pool(blocks, shapes)
        return self._matches(blocks, shapes)

    def _matches_in_one_pool(self, blocks: np.ndarray, shapes: Shapes) -> Matches:
        """Do as `_matches` by one kernel, where one pool was searched."""
        ((step, shrunk),) = self.shrunk.items()
        multiple, y, x = np.empty((3, len(blocks)), np.int64)
        iso = np.empty(len(blocks), isometries.LOWEST.dtype)
        sigma, beta, gain = np.empty((3, len(blocks)))
        means = blocks.reshape(len(blocks), self.block**2).mean(axis=1, dtype=np.float64)
        conclude(
            self.records, self.places, self.count, self.energy, TIE, shrunk, step, self.block,
            self.centred, isometries.sources(self.block), self.cap, means, shapes.of, shapes.iso,
            shapes.sign, isometries.LOWEST, isometries.COMPOSITION, isometries.INVERSE,
            multiple, y, x, iso, sigma, beta, gain,
        )  # fmt: skip
        return Matches(multiple, y, x, iso, sigma, beta, gain, self.energy[shapes.of])

    def _matches(self, blocks: np.ndarray, shapes: Shapes) -> Matches:
        used = np.arange(_ROOM) < self.count[:, None]
        most = self.records.max(axis=1, initial=0, where=used)
        least = most - TIE * self.energy
        wins = used & (self.records >= np.maximum(least, TIE * self.energy)[:, None])
        first = self.places.min(axis=1, initial=np.iinfo(np.int64).max, where=wins)
        matched = wins.any(axis=1)
        place = np.where(matched, first, 0)
        multiple, y, x = place >> 42, place >> 21 & 0x1FFFFF, place & 0x1FFFFF
        every = np.arange(len(place))
        gains, slopes, level = self._rank(every, multiple, y, x, self.centred)
        enough = gains >= np.minimum(least, gains.max(axis=1))[:, None]
        of = shapes.of
        # of equal isometries, the lowest after turning the shape to the block
        iso = isometries.LOWEST[shapes.iso, np.packbits(enough, axis=1, bitorder="little")[of, 0]]
        own = isometries.COMPOSITION[isometries.INVERSE[shapes.iso], iso]
        slope = np.where(matched[of], shapes.sign * slopes[of, own], 0.0)
        flat = blocks.reshape(len(blocks), self.block**2)
        return Matches(
            multiple=multiple[of],
            y=y[of],
            x=x[of],
            iso=iso,
            sigma=slope,
            beta=flat.mean(axis=1, dtype=np.float64) - slope * level[of],
            gain=np.where(matched[of], gains[of, own], 0.0),
            energy=self.energy[of],
        )


def list_places(kernel, columns: int, *arguments) -> np.ndarray:
    """Call a kernel such as list_tiles, with room for all it lists: int64 ``(columns, n)``."""
    room = 1 << 15
    while True:
        places = np.empty((columns, room), np.int64)
        count = kernel(*arguments, *places)
        if count <= room:
            return places[:, :count]
        room = count
