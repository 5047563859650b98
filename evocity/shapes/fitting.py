"""Maps fitted to a line: the points of the polygons solved for, the maps by Levenberg–Marquardt.

Source: Hnaidi, Guérin, Akkouche, §4.1; Golub & Pereyra 1973 and Kaufman 1975 (variable projection);
the form that is fitted, the Jacobian and contraction in it are ours (../shared/SHAPES.md §5).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evocity.errors import setting
from evocity.shapes.checks import MOST_MAPS
from evocity.shapes.contraction import contraction_of
from evocity.shapes.detail import Detailed, check_depth, point_count
from evocity.shapes.filters import banded, windows
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import banded_solved
from evocity.shapes.lines import line_of, resampled

#: The most control points of a fit: it has (Nn − N − 1)(n − 1) unknowns.
MOST_FITTED = 16
#: Long products of fitted maps should be at most so large (Frobenius), as many as are looked at.
_SMALL, _LOOKED_AT = 0.9, 256
_SPREAD = 0.15


def fit_curve(
    line: ArrayLike,
    points: int = 4,
    maps: int = 2,
    depth: int | None = None,
    drawn: int | None = 3,
    starts: int = 6,
    rng: np.random.Generator | None = None,
    rounds: int = 60,
) -> Detailed:
    """The line as a `Detailed` whose maps are fitted to it.

    Parameters
    ----------
    line : ``(M, 2)``, resampled at equal steps unless a depth has as many points.
    points : control points n, 2…16; maps : parts N, 2…256.
    depth : levels; unless told the fewest that have as many points as the line.
    drawn : of these, how many of the finest the maps shall draw without details, so that N**-drawn
        of the numbers are kept; None: all, a pure curve of n points.
    starts : from how many maps it sets out: those of a Bézier curve, and others drawn by ``rng``
        about a straight line; the best is kept. rounds : of Levenberg–Marquardt, at most, of each.

    Parts share their ends, and those of the line stay in place. What is least is the sum of squares
    between ``dropped(drawn)`` and the line. The control points are solved for in each round; the
    Jacobian is exact but for a term that vanishes with what is left over (Kaufman). Maps whose long
    products do not shrink cost as much as a bad fit does; of those tried ones that are refuted are
    not kept.

    Raises `ShapeError` as `line_of`; for numbers out of range; if no maps that contract were found.
    """
    line = line_of(line)
    _check(points, maps, starts, rounds)
    if depth is None:
        depth = next(d for d in range(64) if point_count(points, maps, d, True) >= len(line))
        depth = max(depth, 1)
    check_depth(points, maps, depth, True)
    drawn = depth if drawn is None else min(drawn, depth)
    if isinstance(drawn, bool) or drawn < 1:
        raise ShapeError(setting("drawn", drawn), "1 or more, or None", "correct it")
    count = point_count(points, maps, depth, True)
    if len(line) != count:
        line = resampled(line, count)
    extent = max(float(np.ptp(line, axis=0).max()), 1e-300)
    model = _Model((line - line[0]) / extent, points, maps, depth, drawn)
    rng = np.random.default_rng(0) if rng is None else rng
    best: tuple[float, np.ndarray] | None = None
    undecided: tuple[float, np.ndarray] | None = None
    for start in range(starts):
        found = scipy.optimize.least_squares(
            model.residuals, model.start(rng if start else None), model.jacobian,
            method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=rounds,
        )  # fmt: skip
        fitted = model.maps_of(found.x)
        told = contraction_of(_linear_parts(fitted), Language.every(maps))
        error = float((model.residuals(found.x)[: model.rest] ** 2).sum())
        if told.proved and (best is None or error < best[0]):
            best = error, fitted
        elif not told.refuted and (undecided is None or error < undecided[0]):
            undecided = error, fitted
        if best is not None and best[0] < 1e-24 * count:
            break  # nothing is left over
    chosen = best or undecided
    if chosen is None:
        raise ShapeError(
            f"no maps of {points} points that contract, from {starts} starts",
            "maps that do",
            f"raise {setting('starts', starts)}, or take fewer points",
        )
    return Detailed.of(line, chosen[1], depth, shared=True)


def rms_of(one: Detailed, levels: int) -> float:
    """How far the line is from what it is without the details of its finest ``levels``: the root
    of the mean square over its points, in its units."""
    off = one.dropped(levels).line() - one.line()
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def bezier_maps(points: int, maps: int) -> np.ndarray:
    """Float ``(N, n, n)``: the maps of a Bézier curve of n ``points`` cut into N equal parts."""
    degree, found = points - 1, np.zeros((maps, points, points))
    cuts = np.arange(maps + 1) / maps
    for part in range(maps):
        for j in range(points):  # the blossom at degree − j times the one end, j times the other
            row = np.array([1.0])
            for end in [cuts[part]] * (degree - j) + [cuts[part + 1]] * j:
                row = np.append(row * (1 - end), 0.0) + np.append(0.0, row * end)
            found[part, :, j] = row
    return found


def _linear_parts(maps: np.ndarray) -> np.ndarray:
    parts = maps[:, 1:, 1:] - maps[:, 1:, :1]
    return np.concatenate([parts, np.zeros((*parts.shape[:2], 1))], axis=2)


@dataclass
class _Model:
    """What is left between a line and what maps draw of it, as a function of the maps' numbers."""

    line: np.ndarray
    size: int
    parts: int
    depth: int
    drawn: int

    def __post_init__(self):
        size, parts = self.size, self.parts
        self.step = size - 1
        self.rest = 2 * (len(self.line) - 2)
        # columns that are free: all but the whole's ends; a joint is a column of two maps
        columns, shared = parts * self.step - 1, (parts, size)
        self.where = np.full(shared, -1)
        for part in range(parts):
            for j in range(size):
                number = part * self.step + j - 1
                if 0 <= number < columns:
                    self.where[part, j] = number
        self.unknown = columns * self.step
        # of each number, what it changes of the maps; the first of each column balances it
        self.basis = np.zeros((self.unknown, parts, size, size))
        for part in range(parts):
            for j in range(size):
                if self.where[part, j] >= 0:
                    for i in range(1, size):
                        at = self.where[part, j] * self.step + i - 1
                        self.basis[at, part, i, j] = 1.0
                        self.basis[at, part, 0, j] = -1.0
        self.fixed = np.zeros((parts, size, size))
        self.fixed[:, 0, :] = 1.0
        self.fixed[0, :, 0] = np.eye(size)[0]
        self.fixed[-1, :, -1] = np.eye(size)[-1]
        self.cells = parts ** (self.depth - self.drawn)
        self.width = self.step * parts**self.drawn + 1
        self.length = next(
            k for k in range(64) if k and parts ** (k + 1) > _LOOKED_AT
        )  # of the products that must be small
        self.seen: tuple[bytes, tuple] | None = None

    def start(self, rng: np.random.Generator | None) -> np.ndarray:
        """The numbers of a Bézier curve's maps; with draws, those about a straight line's."""
        if rng is None:
            maps = bezier_maps(self.size, self.parts)
        else:
            maps = self.fixed.copy()
            at = np.arange(self.size) / self.step
            for part in range(self.parts):
                for j in range(self.size):
                    place = (part + at[j]) / self.parts * self.step
                    maps[part, :, j] = np.maximum(0, 1 - np.abs(np.arange(self.size) - place))
        numbers = np.zeros(self.unknown)
        for part in range(self.parts):
            for j in range(self.size):
                if self.where[part, j] >= 0:
                    at = self.where[part, j] * self.step
                    numbers[at : at + self.step] = maps[part, 1:, j]
        return numbers if rng is None else numbers + rng.normal(0, _SPREAD, self.unknown)

    def maps_of(self, numbers: np.ndarray) -> np.ndarray:
        return self.fixed + np.einsum("p,pkij->kij", numbers, self.basis)

    def residuals(self, numbers: np.ndarray) -> np.ndarray:
        return self._at(numbers)[0]

    def jacobian(self, numbers: np.ndarray) -> np.ndarray:
        _, maps, whole, points, diagonals, penal = self._at(numbers)
        change = self._changes(maps)
        blocks = points[windows(self.cells, self.size, True)]
        moved = np.einsum("cnd,pnk->pckd", blocks, change)
        lines = np.zeros((self.unknown, len(self.line), 2))
        lines[:, windows(self.cells, self.width, True)] = moved
        flat = lines.transpose(1, 0, 2).reshape(len(self.line), -1)
        flat = flat - self._spread(whole, self._solved(whole, diagonals, flat))
        body = -flat[1:-1].reshape(-1, self.unknown, 2).transpose(0, 2, 1)
        return np.vstack([body.reshape(self.rest, self.unknown), self._penalty_slopes(maps, penal)])

    def _at(self, numbers: np.ndarray) -> tuple:
        """Residuals, and what they were found by; kept for the Jacobian at the same place."""
        key = numbers.tobytes()
        if self.seen is None or self.seen[0] != key:
            maps = self.maps_of(numbers)
            with np.errstate(over="ignore", invalid="ignore"):
                whole = self._whole(maps)
                products = self._products(maps)
            if not (np.isfinite(whole).all() and np.abs(whole).max() < 1e6):
                bad = np.full(self.rest + len(products), 1e3)
                zero = np.zeros((self.step * self.cells + 1, 2))
                safe = self.maps_of(self.start(None))
                self.seen = key, (bad, safe, self._whole(safe), zero, None, None)
                return self.seen[1]
            normal = np.einsum("ik,k,jk->ij", whole, self._shares, whole)
            diagonals = banded(normal, self.cells)
            ends = np.zeros((self.step * self.cells + 1, 2))
            ends[[0, -1]] = self.line[[0, -1]]
            off = self.line - self._spread(whole, ends)
            points = self._solved(whole, diagonals, off)
            off = off - self._spread(whole, points)
            sizes = np.sqrt((products**2).sum(axis=(1, 2)))
            penal = np.maximum(sizes - _SMALL, 0.0) * self._scale
            left = np.concatenate([off[1:-1].ravel(), penal])
            self.seen = key, (left, maps, whole, points + ends, diagonals, (products, sizes))
        return self.seen[1]

    @property
    def _scale(self) -> float:
        """What a product that is larger than it should be by 1 costs: as much as no fit at all."""
        return float(np.sqrt(((self.line - self.line.mean(axis=0)) ** 2).sum()))

    @property
    def _shares(self) -> np.ndarray:
        """Weights of the points of a polygon's piece: its ends are of two."""
        found = np.ones(self.width)
        found[[0, -1]] = 0.5
        return found

    def _whole(self, maps: np.ndarray) -> np.ndarray:
        """All words of the drawn length side by side, ``(n, K)``, shared columns once."""
        words = np.eye(self.size)[None]
        for _ in range(self.drawn):
            words = np.einsum("wij,kjl->wkil", words, maps).reshape(-1, self.size, self.size)
        return self._beside(words)

    def _beside(self, words: np.ndarray) -> np.ndarray:
        rows = words[..., :-1].swapaxes(-3, -2).reshape(*words.shape[:-3], self.size, -1)
        return np.concatenate([rows, words[..., -1, :, -1:]], axis=-1)

    def _changes(self, maps: np.ndarray) -> np.ndarray:
        """How each number changes `_whole`, ``(unknown, n, K)``: d(V T_i) = dV T_i + V dT_i."""
        words = np.eye(self.size)[None]
        change = np.zeros((self.unknown, 1, self.size, self.size))
        for _ in range(self.drawn):
            later = np.einsum("pwij,kjl->pwkil", change, maps)
            later += np.einsum("wij,pkjl->pwkil", words, self.basis)
            change = later.reshape(self.unknown, -1, self.size, self.size)
            words = np.einsum("wij,kjl->wkil", words, maps).reshape(-1, self.size, self.size)
        return self._beside(change)

    def _products(self, maps: np.ndarray) -> np.ndarray:
        """Products ``(w, n − 1, n − 1)`` of what maps do to vectors of sum 0."""
        parts = maps[:, 1:, 1:] - maps[:, 1:, :1]
        found = parts
        for _ in range(self.length - 1):
            found = np.einsum("wij,kjl->wkil", found, parts).reshape(-1, self.step, self.step)
        return found

    def _penalty_slopes(self, maps: np.ndarray, penal: tuple | None) -> np.ndarray:
        if penal is None:
            return np.zeros((self.parts**self.length, self.unknown))
        products, sizes = penal
        slopes = np.zeros((len(products), self.unknown))
        if not (sizes > _SMALL).any():
            return slopes
        parts = maps[:, 1:, 1:] - maps[:, 1:, :1]
        bases = self.basis[:, :, 1:, 1:] - self.basis[:, :, 1:, :1]
        found, change = parts, bases
        for _ in range(self.length - 1):
            later = np.einsum("pwij,kjl->pwkil", change, parts)
            later += np.einsum("wij,pkjl->pwkil", found, bases)
            change = later.reshape(self.unknown, -1, self.step, self.step)
            found = np.einsum("wij,kjl->wkil", found, parts).reshape(-1, self.step, self.step)
        over = sizes > _SMALL
        slopes[over] = (
            np.einsum("wij,pwij->wp", products[over], change[:, over])
            / sizes[over, None] * self._scale
        )  # fmt: skip
        return slopes

    def _spread(self, whole: np.ndarray, points: np.ndarray) -> np.ndarray:
        """The line ``(M, d)`` that points of the polygons ``(m, d)`` draw."""
        blocks = points[windows(self.cells, self.size, True)]
        found = np.zeros((len(self.line), points.shape[1]))
        found[windows(self.cells, self.width, True)] = np.einsum("cnd,nk->ckd", blocks, whole)
        return found

    def _solved(self, whole: np.ndarray, diagonals: np.ndarray | None, off: np.ndarray):
        """The points nearest to a line ``off`` ``(M, d)``, the ends of the whole 0."""
        found = np.zeros((self.step * self.cells + 1, off.shape[1]))
        if diagonals is None or len(found) < 3:
            return found
        blocks = off[windows(self.cells, self.width, True)]
        pulls = np.einsum("nk,k,ckd->cnd", whole, self._shares, blocks)
        right = np.zeros_like(found)
        np.add.at(right, windows(self.cells, self.size, True), pulls)
        found[1:-1] = banded_solved(diagonals[:, 1:-1], right[1:-1])
        return found


def _check(points: int, maps: int, starts: int, rounds: int) -> None:
    ranges = {
        "points": (points, 2, MOST_FITTED),
        "maps": (maps, 2, min(MOST_MAPS, 64)),
        "starts": (starts, 1, 1000),
        "rounds": (rounds, 1, 10000),
    }
    for name, (value, low, high) in ranges.items():
        if isinstance(value, bool) or not low <= value <= high:
            raise ShapeError(setting(name, value), f"{low}…{high}", "correct it")


__all__ = ["MOST_FITTED", "bezier_maps", "fit_curve", "rms_of"]
