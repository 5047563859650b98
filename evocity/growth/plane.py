"""The endless plane `Plane`: lays the regions of a requested window and caches them."""

import contextlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evocity import isometries
from evocity.citymap import CityMap
from evocity.growth._kernels import fabric_window, lay_groups
from evocity.growth.lattice import INSIDE, Lattice
from evocity.growth.repetition import Windows
from evocity.growth.shares import Shares

# Candidates whose outlines are cut in one go; places laid in one call.
_CANDIDATES, _BATCH = 20, 8
#: Regions in the cache: all of the largest possible map, some 80 MB.
_REGIONS = 1 << 14
# Coordinate of the original's north-west pixel, and the largest distance from it: no anchor is
# negative, and near the original each is unique.
_BASE, _FAR = 1 << 28, 1 << 27


@dataclass(frozen=True)
class Region:
    """A laid crossing, strip or tile, with its north-west cell at ``corner``: the original's cell
    at each cell (``stones``, int32, see `evocity.growth._kernels`), the mean step along the outline
    of each group (``steps``, metres), and the number of groups that repeat a window."""

    corner: tuple[int, int]
    stones: np.ndarray
    steps: np.ndarray
    repeated: int


class Plane:
    """An endless fabric, a function of seed and place, from maps of the originals with sides of
    whole cells; the first stands at (0, 0). ``shares`` are those of the originals at each place;
    the rest is as in `grow`.

    For kernels, ``brought`` and ``sides`` are the originals' heights and sizes.
    """

    def __init__(
        self,
        heights: list[np.ndarray],
        cell: int,
        lattice: Lattice,
        shares: Shares,
        seed: int,
        *,
        tolerance: float,
        candidates: int,
        turned: bool,
    ):
        self.cell, self.lattice, self.shares, self.seed = cell, lattice, shares, seed
        self.tolerance, self.candidates = tolerance, candidates
        isos = np.arange(isometries.COUNT if turned else 1)
        heights = [raster + np.float32(0) for raster in heights]  # −0 would differ from 0
        self.brought = np.concatenate([raster.ravel() for raster in heights])
        counts = np.array([np.array(raster.shape) // cell for raster in heights])
        self.sides = np.column_stack([counts, np.cumsum([0, *counts.prod(axis=1)])[:-1]])
        self.windows = Windows(heights, isos, _BASE)
        self._fixed = {  # arguments of `lay_groups` that no region changes
            "brought": self.brought,
            "sides": self.sides,
            "lays": isometries.AFFINE,
            "isos": isos,
            "cell": cell,
            "tolerance": tolerance,
            "kept": _CANDIDATES,
            "surplus": np.concatenate([_surplus(raster, cell) for raster in heights]),
            "common": self.windows.common,
            "allowed": self.windows.allowed,
        }
        self._regions: OrderedDict[tuple[int, int, int], Region] = OrderedDict()

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Compute float32 ``(height, width)`` heights from pixel (top, left) on."""
        cell = self.cell
        first, west = top // cell, left // cell
        stones = self.stones(first, west, -(-(top + height) // cell), -(-(left + width) // cell))
        out = np.empty((height, width), np.float32)
        at = top - first * cell, left - west * cell
        fabric_window(stones, self.brought, self.sides, isometries.AFFINE, cell, *at, out)
        return out

    def stones(self, top: int, left: int, bottom: int, right: int) -> np.ndarray:
        """Compute the int32 stones of a rectangle of cells."""
        out = np.empty((bottom - top, right - left), np.int32)
        for i, j in self.tiles(top, left, bottom, right):
            region = self.region(INSIDE, i, j)
            paste(out, region.stones, region.corner[0] - top, region.corner[1] - left)
        return out

    def tiles(self, top: int, left: int, bottom: int, right: int) -> list[tuple[int, int]]:
        """List the tiles that a rectangle of cells touches, row by row."""
        if bottom <= top or right <= left:
            return []
        rows, columns = (
            range(self.lattice.tile_of(axis, first), self.lattice.tile_of(axis, last - 1) + 1)
            for axis, (first, last) in enumerate(((top, bottom), (left, right)))
        )
        return [(i, j) for i in rows for j in columns]

    def account(
        self,
        top: int,
        left: int,
        bottom: int,
        right: int,
        progress: Callable[[int, int], None] | None = None,
    ) -> dict:
        """Report on the tiles that a rectangle of cells touches, see `Growth.account`."""
        tiles = self.tiles(top, left, bottom, right)
        keys = {}
        for done, (i, j) in enumerate(tiles):
            for key in ((INSIDE, i, j), *self.lattice.prerequisites(INSIDE, i, j)):
                keys[key] = self.region(*key)
            if progress is not None:
                progress(done + 1, len(tiles))
        steps = np.concatenate([np.empty(0), *(region.steps for region in keys.values())])
        return {
            "groups": steps.size,
            "step": round(float(steps.mean()), 4) if steps.size else 0.0,
            "forced": int((steps > self.tolerance).sum()),
            "repeated": sum(region.repeated for region in keys.values()),
        }

    def region(self, kind: int, i: int, j: int) -> Region:
        """Return a crossing, strip or tile from the cache, or lay it now."""
        key = (kind, i, j)
        region = self._regions.get(key)
        if region is None:
            region = self._lay_region(*key)
            self._regions[key] = region
            while len(self._regions) > _REGIONS:
                self._regions.popitem(last=False)
        with contextlib.suppress(KeyError):  # another thread may have dropped it
            self._regions.move_to_end(key)
        return region

    def _lay_region(self, kind: int, i: int, j: int) -> Region:
        context = self.lattice.context(kind, i, j)
        # its corner on an anchor, whatever the cell
        corner = context[0] // 8 * 8, context[1] // 8 * 8
        stones = np.full((context[2] - corner[0], context[3] - corner[1]), -1, np.int32)
        known = stones[context[0] - corner[0] :, context[1] - corner[1] :]
        rows, columns, _ = self.sides[0]
        original = 8 * np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
        paste(known, original, -context[0], -context[1])
        for key in self.lattice.prerequisites(kind, i, j):
            region = self.region(*key)
            paste(
                known, region.stones, region.corner[0] - context[0], region.corner[1] - context[1]
            )
        top, left, bottom, right = self.lattice.extent(kind, i, j)
        if kind == INSIDE:  # the whole tile, with the halves of its strips
            top, bottom = (self.lattice.line(0, k) for k in (i, i + 1))
            left, right = (self.lattice.line(1, k) for k in (j, j + 1))
        cells = stones[top - corner[0] : bottom - corner[0], left - corner[1] : right - corner[1]]
        steps, repeated = np.empty(0), 0
        if (cells < 0).any():
            steps, repeated = self._lay(stones, corner, kind, i, j)
        cells = cells.copy()
        cells.setflags(write=False)
        return Region((top, left), cells, steps, repeated)

    def _lay(self, stones: np.ndarray, corner, kind: int, i: int, j: int):
        """Lay the groups of a region into ``stones``, from cell ``corner`` on."""
        which = (2 * k if k >= 0 else -2 * k - 1 for k in (i, j))  # entropy cannot be negative
        rng = np.random.default_rng([self.seed, kind, *which])
        places = self.lattice.places(kind, i, j, rng)
        middles = (places[:, :2] + places[:, 2:] / 2) * self.cell
        owners = self.shares.owners(middles, rng.random(len(places)))
        places[:, :2] -= corner
        first = self.sides[0]
        original = np.array([-corner[0], -corner[1], first[0] - corner[0], first[1] - corner[1]])
        count = self.brought.size // self.cell**2
        uses = 1 + np.bincount(stones[stones >= 0] >> 3, minlength=count)
        table = self.windows.table()
        at = tuple(int(np.clip(k * self.cell, -_FAR, _FAR)) + _BASE for k in corner)
        steps, twice = np.empty(len(places)), np.empty(len(places), bool)
        for start in range(0, len(places), _BATCH):
            some = slice(start, start + _BATCH)
            count = len(places[some])
            draws = rng.integers(0, 1 << 62, (count, self.candidates))
            table.make_room(count)
            grown = lay_groups(
                **self._fixed,
                stones=stones,
                original=original,
                places=places[some],
                owners=owners[some],
                draws=draws,
                uses=uses,
                coarse=table.coarse,
                fine=table.fine,
                corner=at,
                steps=steps[some],
                twice=twice[some],
            )
            table.filled = [old + new for old, new in zip(table.filled, grown, strict=True)]
        return steps[np.isfinite(steps)], int(twice.sum())


def paste(out: np.ndarray, piece: np.ndarray, top: int, left: int) -> None:
    """Copy ``piece`` into ``out`` at (top, left), as far as ``out`` reaches."""
    bottom, right = top + piece.shape[0], left + piece.shape[1]
    within = out[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    y, x = max(-top, 0), max(-left, 0)
    within[:] = piece[y : y + within.shape[0], x : x + within.shape[1]]


def _surplus(heights: np.ndarray, cell: int) -> np.ndarray:
    """Compute the excess of each cell's built share, row by row, over the whole map's."""
    built = CityMap(heights, 1.0).built
    shares = built.reshape(built.shape[0] // cell, cell, -1, cell).mean(axis=(1, 3)).ravel()
    return shares - shares.mean()
