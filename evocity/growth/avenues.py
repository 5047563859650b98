"""Avenues of an endless plane: districts between avenues, and quarters between their streets.

Avenues run straight from crossing to crossing, and go on over each crossing with small turns. Each
district between four avenues has streets from avenue to avenue, and shorter streets across them.
All is a function of a seed and of the place.
"""

from dataclasses import dataclass

import numpy as np

#: Quarters along a side of a district.
QUARTERS = 3
#: Farthest shift of a crossing of avenues, as a share of a district's side.
SHIFT = 0.18
#: Range of the widths of avenues, of streets from avenue to avenue, and of those across, metres.
AVENUE, THROUGH, ACROSS = (12.0, 24.0), (8.0, 16.0), (8.0, 14.0)
#: Share of the districts whose streets across go on from avenue to avenue, too.
GRID = 0.6
# Kinds of draws.
_CROSSING, _WIDTH, _DISTRICT = 11, 12, 13


@dataclass(frozen=True, eq=False)
class District:
    """The quarters of a district, in the window around its four corners.

    corner : row and column of the window's north-west pixel on the plane.
    labels : int16 ``(h, w)``, the quarter of each pixel, 1…n; 0 beyond the district.
    lots : int16 ``(h, w)``, the quarter of each pixel that no street takes; 0 elsewhere.
    angle : float64 ``(n,)``, direction of each quarter's streets, from 0 to below π/2, from east
        towards south. colour : int ``(n,)``, 0…3; quarters beside each other differ.
    """

    corner: tuple[int, int]
    labels: np.ndarray
    lots: np.ndarray
    angle: np.ndarray
    colour: np.ndarray


class Avenues:
    """The avenues of a plane around an original of ``shape`` px that is a district of its own.

    sides : smallest and largest side of quarters, px. pixel : side of a pixel, metres. seed : seed
    of all draws. widths : widths of streets, metres, from which those of the plane are drawn.
    """

    def __init__(
        self, shape: tuple[int, int], sides: tuple[float, float], pixel: float, seed: int, widths
    ):
        self.shape, self.pixel, self.seed = shape, pixel, seed
        self.side = round(sum(sides) / 2)
        self._shift = (sides[1] - sides[0]) / sum(sides) / 2
        self.widths = np.sort(np.asarray(widths, float))

    @property
    def tile(self) -> int:
        """Side of a district, px, before its corners move."""
        return QUARTERS * self.side

    def line(self, axis: int, k: int) -> int:
        """Compute the first row (axis 0) or column (1) after line ``k``."""
        return k * self.tile if k <= 0 else self.shape[axis] + (k - 1) * self.tile

    def index_of(self, axis: int, at: int) -> int:
        """Find the line before row (axis 0) or column (1) ``at``."""
        if at < 0:
            return at // self.tile
        return 0 if at < self.shape[axis] else 1 + (at - self.shape[axis]) // self.tile

    def districts(self, top: int, left: int, bottom: int, right: int) -> list[tuple[int, int]]:
        """List the districts whose windows touch a rectangle of pixels, row by row."""
        if bottom <= top or right <= left:
            return []
        reach = int(SHIFT * self.tile) + 1
        rows, columns = (
            range(self.index_of(axis, first - reach), self.index_of(axis, last + reach) + 1)
            for axis, (first, last) in enumerate(((top, bottom), (left, right)))
        )
        window = np.array([[top, left], [bottom, right]])
        found = []
        for i in rows:
            for j in columns:
                corners = self.corners(i, j)
                if (corners.min(axis=0) < window[1]).all() and (
                    corners.max(axis=0) > window[0]
                ).all():
                    found.append((i, j))
        return found

    def crossing(self, i: int, j: int) -> tuple[int, int]:
        """Compute row and column of a crossing of avenues, whole px; the original's corners stay
        in place."""
        row, column = self.line(0, i), self.line(1, j)
        if i in (0, 1) and j in (0, 1):
            return row, column
        reach = int(SHIFT * self.tile)
        down, along = self.generator(_CROSSING, i, j).integers(-reach, reach + 1, 2).tolist()
        return row + down, column + along

    def corners(self, i: int, j: int) -> np.ndarray:
        """List the crossings around a district: north-west, north-east, south-west, south-east,
        int64 ``(4, 2)``."""
        return np.array([self.crossing(i + di, j + dj) for di in (0, 1) for dj in (0, 1)])

    def within(self, i: int, j: int, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Mark the pixels that lie in a district. Each pixel of the plane lies in one district."""
        corners = self.corners(i, j)
        base = corners[0]
        points = 2 * (corners - base)
        y, x = 2 * (rows - base[0]) + 1, 2 * (columns - base[1]) + 1

        def beyond(one: int, other: int) -> np.ndarray:
            (y0, x0), (y1, x1) = points[one].tolist(), points[other].tolist()
            return (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)

        south = (beyond(0, 1) >= 0) & (beyond(2, 3) < 0)
        return south & (beyond(0, 2) <= 0) & (beyond(1, 3) > 0)

    def district(self, i: int, j: int) -> District:
        """Draw the quarters of a district."""
        rng = self.generator(_DISTRICT, i, j)
        corners = self.corners(i, j)
        corner = corners.min(axis=0)
        height, width = (corners.max(axis=0) - corner).tolist()
        flip = bool(rng.integers(2))  # streets from avenue to avenue run down
        points = (corners - corner).astype(float)
        y, x = np.indices((height, width)) + 0.5
        if flip:
            points, (y, x) = points[[0, 2, 1, 3]][:, ::-1], (x, y)
        nw, ne, sw, se = points
        sides = self._border(i, j, flip)
        own = self.within(
            i, j, np.arange(height)[:, None] + corner[0], np.arange(width) + corner[1]
        )
        cuts = self._cuts(np.hypot(*(sw - nw)), np.hypot(*(se - ne)), rng)
        west, east = (cuts[:, None] * (b - a) + a for a, b in ((nw, sw), (ne, se)))
        halves = [sides[0], *self._halves(len(cuts) - 2, THROUGH, rng), sides[1]]
        away = [_distance(west[k], east[k], y, x) for k in range(len(cuts))]
        labels, lots = np.zeros((height, width), np.int16), np.zeros((height, width), np.int16)
        angle: list[float] = []
        colour: list[int] = []
        # streets across go on over the streets from avenue to avenue, or each row has its own
        across = self._across((nw + sw) / 2, (ne + se) / 2, rng)
        own_rows = rng.random() >= GRID
        row = np.sum([far >= 0 for far in away[1:-1]], axis=0, initial=0)
        for k in range(len(cuts) - 1):
            free = (away[k] >= halves[k]) & (-away[k + 1] >= halves[k + 1])
            parts, halves_across = across
            if own_rows:
                first, last = (line[k : k + 2].mean(axis=0) for line in (west, east))
                parts, halves_across = self._across(first, last, rng)
            north, south = (parts[:, None] * (east[m] - west[m]) + west[m] for m in (k, k + 1))
            beside = [sides[2], *halves_across, sides[3]]
            far = [-_distance(north[m], south[m], y, x) for m in range(len(parts))]
            column = np.sum([one >= 0 for one in far[1:-1]], axis=0, initial=0)
            for m in range(len(parts) - 1):
                here = own & (row == k) & (column == m)
                number = len(angle) + 1
                labels[here] = number
                between = (far[m] >= beside[m]) & (-far[m + 1] >= beside[m + 1])
                lots[here & free & between] = number
                way = (east[k] - west[k]) / np.hypot(*(east[k] - west[k]))
                way = way + (east[k + 1] - west[k + 1]) / np.hypot(*(east[k + 1] - west[k + 1]))
                down, along = way[::-1] if flip else way
                angle.append(np.mod(np.arctan2(down, along), np.pi / 2))
                colour.append(2 * (k % 2) + m % 2)
        return District(
            (int(corner[0]), int(corner[1])), labels, lots, np.array(angle), np.array(colour)
        )

    def _border(self, i: int, j: int, flip: bool) -> list[float]:
        """Compute the half widths of the avenues before and after a district along both ways, px.
        Beside the original, an avenue lies outside of it."""
        halves = []
        for axis, k, beside in (
            (0, i, (i - 1, j)), (0, i + 1, (i + 1, j)), (1, j, (i, j - 1)), (1, j + 1, (i, j + 1)),
        ):  # fmt: skip
            width = self._width(AVENUE, 0.8, self.generator(_WIDTH, axis, k))
            halves.append(width / self.pixel / (1 if beside == (0, 0) else 2))
        return halves[2:] + halves[:2] if flip else halves

    def _across(self, west: np.ndarray, east: np.ndarray, rng: np.random.Generator):
        """Draw the streets across a row: their places from its one end to the other, 0…1, and half
        widths, px."""
        length = np.hypot(*(east - west))
        parts = self._cuts(length, length, rng)
        return parts, self._halves(len(parts) - 2, ACROSS, rng)

    def _cuts(self, one: float, other: float, rng: np.random.Generator) -> np.ndarray:
        """Cut two sides of about equal lengths into parts of about a quarter's side: 0…1."""
        count = max(1, round((one + other) / 2 / self.side))
        shifts = rng.uniform(-self._shift, self._shift, count + 1)
        shifts[[0, -1]] = 0
        return (np.arange(count + 1) + shifts) / count

    def _halves(self, count: int, bounds, rng: np.random.Generator) -> list[float]:
        return [self._width(bounds, 0.3, rng) / self.pixel / 2 for _ in range(count)]

    def _width(self, bounds: tuple[float, float], least: float, rng) -> float:
        """Draw a width, metres, from the widest of the streets, within ``bounds``."""
        share = rng.uniform(least, 1)
        known = self.widths.size
        width = np.quantile(self.widths, share) if known else bounds[0]
        return float(np.clip(width, *bounds))

    def generator(self, kind: int, i: int, j: int) -> np.random.Generator:
        """Return the generator of a kind of draws at a place of the lattice."""
        which = (2 * k if k >= 0 else -2 * k - 1 for k in (i, j))  # entropy cannot be negative
        return np.random.default_rng([self.seed, kind, *which])


def _distance(first: np.ndarray, last: np.ndarray, y: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Compute the signed distances of points from a line, px: above 0 south of a line that runs
    east, and west of a line that runs south."""
    down, along = (last - first) / np.hypot(*(last - first))
    return along * (y - first[0]) - down * (x - first[1])
