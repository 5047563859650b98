"""Lattice of tiles on an endless plane: places of groups, and what each tile depends on.

Lines cut the plane into *tiles*, so that growth does not depend on a start. It first lays a group
on every crossing of two lines; then along each line a *strip* of groups between crossings; then the
inside of each tile. Groups stand astride the lines, so no seam follows them.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from evocity.growth._kernels import ANCHORED

#: Side of a tile outside the original, pixels.
TILE = 128
#: Largest side of a group, pixels: a group never repeats a whole window of `WINDOW`.
MAX_GROUP = ANCHORED - 1
#: Smallest side of a group, cells: a core between two rims, in which cuts run. The largest groups
#: have at least `LEAST_LARGEST`, so that a strip of them is wider than the laps of both its sides.
MIN_GROUP, LEAST_LARGEST = 3, 5
#: Bounds of a cell's side, pixels.
MIN_CELL, MAX_CELL = 2, MAX_GROUP // LEAST_LARGEST
#: Kinds of regions: the group on a crossing, the strip east or south of it, the tile south-east.
CROSSING, EAST, SOUTH, INSIDE = range(4)


@dataclass(frozen=True)
class Lattice:
    """The lines of an endless plane, in cells; the original's north-west cell is (0, 0).

    Lines follow the original's borders, and cross a large original. So regions beside it lap over
    it by half a strip. ``rows`` and ``columns`` are the original's; ``tile`` is the side of tiles;
    ``size_min`` and ``size_max`` are those of groups with their rims.
    """

    rows: int
    columns: int
    tile: int
    size_min: int
    size_max: int

    @property
    def rim(self) -> int:
        """Width of the lap of two groups, cells. A strip is wider than two rims, so a part of it
        stays between the laps of both its sides."""
        return max(1, min((self.size_min + 1) // 4, (self.size_max - 1) // 4))

    @property
    def offset(self) -> int:
        """Cells of a crossing's group before its lines."""
        return self.size_max // 2

    @property
    def strip(self) -> tuple[int, int]:
        """First cell of a strip across its line, and the first cell after it."""
        return self.rim - self.offset, self.size_max - self.rim - self.offset

    def line(self, axis: int, k: int) -> int:
        """Compute the first row (axis 0) or column (1) after line ``k``."""
        side, parts = self._parts(axis)
        if k < 0:
            return k * self.tile
        return k * side // parts if k <= parts else side + (k - parts) * self.tile

    def tile_of(self, axis: int, at: int) -> int:
        """Find the tile that contains row (axis 0) or column (1) ``at``."""
        side, parts = self._parts(axis)
        if at < 0:
            return at // self.tile
        if at >= side:
            return parts + (at - side) // self.tile
        return next(k for k in range(parts) if at < (k + 1) * side // parts)

    def _parts(self, axis: int) -> tuple[int, int]:
        side = (self.rows, self.columns)[axis]
        return side, max(1, round(side / self.tile))

    def prerequisites(self, kind: int, i: int, j: int) -> list[tuple[int, int, int]]:
        """List the regions that must stand first; later ones cover earlier ones."""
        if kind == CROSSING:
            return []
        if kind == EAST:
            return [(CROSSING, i, j), (CROSSING, i, j + 1)]
        if kind == SOUTH:
            return [(CROSSING, i, j), (CROSSING, i + 1, j)]
        crossings = [(CROSSING, i + di, j + dj) for di in (0, 1) for dj in (0, 1)]
        return [*crossings, (EAST, i, j), (EAST, i + 1, j), (SOUTH, i, j), (SOUTH, i, j + 1)]

    def extent(self, kind: int, i: int, j: int) -> tuple[int, int, int, int]:
        """Compute the rectangle (top, left, bottom, right) of a region, laps included."""
        first, end = self.strip
        lap = (first + self.rim, end - self.rim) if kind == INSIDE else (first, end)
        sides = []
        for axis, k in enumerate((i, j)):
            here, there = self.line(axis, k), self.line(axis, k + 1)
            if kind == CROSSING:
                sides.append((here - self.offset, here - self.offset + self.size_max))
            elif kind == (SOUTH, EAST)[axis] or kind == INSIDE:
                sides.append((here + lap[1], there + lap[0]))
            else:
                sides.append((here + first, here + end))
        (top, bottom), (left, right) = sides
        return top, left, bottom, right

    def context(self, kind: int, i: int, j: int) -> tuple[int, int, int, int]:
        """Compute the rectangle known to a region when it is laid; it is final outside of it."""
        first, end = self.strip
        sides = []
        for axis, k in enumerate((i, j)):
            here, there = self.line(axis, k), self.line(axis, k + 1)
            if kind == INSIDE:
                sides.append((here + first, there + end))
            else:
                last = there if kind == (SOUTH, EAST)[axis] else here
                sides.append((here - self.offset, last - self.offset + self.size_max))
        (top, bottom), (left, right) = sides
        return top, left, bottom, right

    def places(self, kind: int, i: int, j: int, rng: np.random.Generator) -> np.ndarray:
        """Draw the places of groups in order of laying, int64 ``(n, 4)``: top, left, tall, wide.

        Cores of drawn sides tile the bare cells, row by row to the south-east. Each group laps over
        its neighbours by a rim."""
        top, left, bottom, right = self.extent(kind, i, j)
        if kind == CROSSING:
            return np.array([(top, left, bottom - top, right - left)], np.int64)
        rim = self.rim
        bands = self._spans(top, bottom, rng) if kind != EAST else [(top, bottom)]
        places = []
        down, along = rim * (kind != EAST), rim * (kind != SOUTH)
        for north, south in bands:
            cores = self._spans(left, right, rng) if kind != SOUTH else [(left, right)]
            places += [
                (north - down, west - along, south - north + 2 * down, east - west + 2 * along)
                for west, east in cores
            ]
        return np.array(places, np.int64).reshape(-1, 4)

    def _spans(self, first: int, last: int, rng: np.random.Generator) -> list[tuple[int, int]]:
        """Draw lengths of cores between the rims of [first, last).

        The last of several is longer than two rims. A shorter one would vanish under its
        neighbour's rim, up to a strip or a crossing, and no step would be measured there."""
        shortest, longest = (max(1, side - 2 * self.rim) for side in (self.size_min, self.size_max))
        ends, last = [first + self.rim], last - self.rim
        while ends[-1] < last:
            end = ends[-1] + int(rng.integers(shortest, longest + 1))
            if end < last <= end + 2 * self.rim:
                end = last if last - ends[-1] <= longest else last - 2 * self.rim - 1
            ends.append(min(last, end))
        return list(itertools.pairwise(ends))
