"""Where groups lie: an endless lattice of tiles, each laid from what stands around it alone.

No order of laying can go through an endless plane and be the same wherever one begins. So the
plane is cut along lines into *tiles*, and laid in three phases, each of which knows a bounded
neighbourhood: a group on every crossing of two lines; then along each line a *strip* of groups from
crossing to crossing; then the inside of each tile, between its four strips. Groups stand astride
the lines, so that no seam runs along them.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from evocity.growth._kernels import ANCHORED

#: Side of a tile outside the original, pixels.
TILE = 128
#: Largest side of a group, pixels: what a group repeats is smaller than a window of `WINDOW`.
MAX_GROUP = ANCHORED - 1
#: Smallest side of a group, cells: a rim on either side to be cut in, and a core. The largest are
#: to be of `LEAST_LARGEST`, so that a strip of them is wider than the laps of both its sides.
MIN_GROUP, LEAST_LARGEST = 3, 5
#: Bounds of a cell's side, pixels.
MIN_CELL, MAX_CELL = 2, MAX_GROUP // LEAST_LARGEST
#: What is laid: a group on a crossing, the strip east or south of it, the tile south-east of it.
CROSSING, EAST, SOUTH, INSIDE = range(4)


@dataclass(frozen=True)
class Lattice:
    """The lines of an endless plane, in cells; the original's north-west cell is (0, 0).

    Lines run along the original's borders, and where it is large also through it. So what is laid
    beside it laps over it by half a strip.

    rows, columns : of the original.
    tile : side of the tiles, cells.
    size_min, size_max : sides of the groups, rims included, cells.
    """

    rows: int
    columns: int
    tile: int
    size_min: int
    size_max: int

    @property
    def rim(self) -> int:
        """By so many cells groups lap over each other. A strip is wider than two rims, so that
        what both its sides leave of it stays between them."""
        return max(1, min((self.size_min + 1) // 4, (self.size_max - 1) // 4))

    @property
    def before(self) -> int:
        """Cells of a crossing's group before its lines."""
        return self.size_max // 2

    @property
    def strip(self) -> tuple[int, int]:
        """First cell of a strip across its line, and the first one behind it."""
        return self.rim - self.before, self.size_max - self.rim - self.before

    def line(self, axis: int, k: int) -> int:
        """First row (axis 0) or column (1) behind line ``k``."""
        side, parts = self._parts(axis)
        if k < 0:
            return k * self.tile
        return k * side // parts if k <= parts else side + (k - parts) * self.tile

    def tile_of(self, axis: int, at: int) -> int:
        """The tile that holds row (axis 0) or column (1) ``at``."""
        side, parts = self._parts(axis)
        if at < 0:
            return at // self.tile
        if at >= side:
            return parts + (at - side) // self.tile
        return next(k for k in range(parts) if at < (k + 1) * side // parts)

    def _parts(self, axis: int) -> tuple[int, int]:
        side = (self.rows, self.columns)[axis]
        return side, max(1, round(side / self.tile))

    def needs(self, kind: int, i: int, j: int) -> list[tuple[int, int, int]]:
        """What must stand before, in the order in which one covers the other."""
        if kind == CROSSING:
            return []
        if kind == EAST:
            return [(CROSSING, i, j), (CROSSING, i, j + 1)]
        if kind == SOUTH:
            return [(CROSSING, i, j), (CROSSING, i + 1, j)]
        crossings = [(CROSSING, i + di, j + dj) for di in (0, 1) for dj in (0, 1)]
        return [*crossings, (EAST, i, j), (EAST, i + 1, j), (SOUTH, i, j), (SOUTH, i, j + 1)]

    def laid(self, kind: int, i: int, j: int) -> tuple[int, int, int, int]:
        """The rectangle (top, left, bottom, right) that may be laid, laps included."""
        first, behind = self.strip
        lap = (first + self.rim, behind - self.rim) if kind == INSIDE else (first, behind)
        sides = []
        for axis, k in enumerate((i, j)):
            here, there = self.line(axis, k), self.line(axis, k + 1)
            if kind == CROSSING:
                sides.append((here - self.before, here - self.before + self.size_max))
            elif kind == (SOUTH, EAST)[axis] or kind == INSIDE:
                sides.append((here + lap[1], there + lap[0]))
            else:
                sides.append((here + first, here + behind))
        (top, bottom), (left, right) = sides
        return top, left, bottom, right

    def seen(self, kind: int, i: int, j: int) -> tuple[int, int, int, int]:
        """The rectangle that is known when it is laid, and final as far as it is not laid."""
        first, behind = self.strip
        sides = []
        for axis, k in enumerate((i, j)):
            here, there = self.line(axis, k), self.line(axis, k + 1)
            if kind == INSIDE:
                sides.append((here + first, there + behind))
            else:
                last = there if kind == (SOUTH, EAST)[axis] else here
                sides.append((here - self.before, last - self.before + self.size_max))
        (top, bottom), (left, right) = sides
        return top, left, bottom, right

    def places(self, kind: int, i: int, j: int, rng: np.random.Generator) -> np.ndarray:
        """Places of groups, int64 ``(n, 4)``: top, left, tall, wide, in order of laying.

        Cores of drawn sides tile what is bare, row by row to the south-east, each lapped over its
        neighbours by a rim."""
        top, left, bottom, right = self.laid(kind, i, j)
        if kind == CROSSING:
            return np.array([(top, left, bottom - top, right - left)], np.int64)
        rim = self.rim
        bands = self._spans(top, bottom, rng) if kind != EAST else [(top, bottom)]
        places = []
        for first, last in bands:
            cores = self._spans(left, right, rng) if kind != SOUTH else [(left, right)]
            for west, east in cores:
                if kind != EAST:
                    north, south = first - rim, last + rim
                else:
                    north, south = first, last
                if kind != SOUTH:
                    west, east = west - rim, east + rim
                places.append((north, west, south - north, east - west))
        return np.array(places, np.int64).reshape(-1, 4)

    def _spans(self, first: int, last: int, rng: np.random.Generator) -> list[tuple[int, int]]:
        """Cores of drawn lengths between the rims of [first, last).

        The last is longer than two rims, if it is not the only one: what is left in front of a
        strip would else be covered by its neighbour's rim, up to where the strip or a crossing
        begins, and no step be measured there."""
        shortest, longest = (max(1, side - 2 * self.rim) for side in (self.size_min, self.size_max))
        ends, last = [first + self.rim], last - self.rim
        while ends[-1] < last:
            end = ends[-1] + int(rng.integers(shortest, longest + 1))
            if end < last <= end + 2 * self.rim:
                end = last if last - ends[-1] <= longest else last - 2 * self.rim - 1
            ends.append(min(last, end))
        return list(itertools.pairwise(ends))
