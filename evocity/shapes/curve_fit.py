"""Fitting of maps to a line, by Levenberg–Marquardt with variable projection.

Each round solves for the control points of the polygons. Source: Hnaidi, Guérin, Akkouche, §4.1;
Golub & Pereyra 1973 and Kaufman 1975 (variable projection); the form, the Jacobian and its
contraction term are ours (../shared/SHAPES.md §5).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evocity.errors import setting
from evocity.shapes.checks import MOST_MAPS, check_range
from evocity.shapes.curve import curve_contraction, vector_parts
from evocity.shapes.detail import Detailed, check_depth, point_count
from evocity.shapes.filters import banded, windows
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import solve_banded
from evocity.shapes.lines import line_of, resampled

#: The most control points of a fit: it has (Nn − N − 1)(n − 1) unknowns.
MOST_FITTED = 16
#: The greatest Frobenius norm of long products of fitted maps, and the number of these products.
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
    """Fit maps to a line, and return the line as a `Detailed` with these maps.

    Parameters
    ----------
    line : points of the line, ``(M, 2)``. The line is resampled at equal steps, unless its number
        of points fits a depth exactly.
    points : number n of control points, 2…16.
    maps : number N of parts, 2…64.
    depth : number of levels; by default the fewest levels that have at least as many points as the
        line.
    drawn : number of finest levels that the maps draw without details; the share ``1 / N^drawn`` of
        the numbers that store the line remains. If ``drawn`` is None, no level has details, and the
        result is a curve of n control points.
    starts : number of fits from different starting maps; the best fit is kept. The first start is a
        Bézier curve. Each start after the first is a straight line with random changes.
    rng : random generator for the starts; by default a generator with the seed 0.
    rounds : largest number of rounds of Levenberg–Marquardt for each start.

    Parts share their ends, and the ends of the line stay in place. The fit minimises the sum of
    squared distances between the line and the result of ``dropped(drawn)``. The Jacobian is exact
    except for a term that vanishes with the residuals (Kaufman). In the fit, the cost of maps whose
    long products do not shrink equals the cost of a bad fit. The fit drops maps that provably do
    not contract.

    Raises `ShapeError` if the line is invalid, if a number is out of range, or if no start gives
    contracting maps.
    """
    line = line_of(line)
    _check(points, maps, starts, rounds)
    if depth is None:
        depth = next(d for d in range(64) if point_count(points, maps, d, True) >= len(line))
        depth = max(depth, 1)
    check_depth(points, maps, depth, True)
    drawn = depth if drawn is None else min(drawn, depth)
    if isinstance(drawn, bool) or drawn < 1:
        found = setting("drawn", drawn)
        raise ShapeError(found, "1 or more levels, or None for all levels", "choose another drawn")
    count = point_count(points, maps, depth, True)
    if len(line) != count:
        line = resampled(line, count)
    fitted = fit_maps(line, points, maps, depth, drawn, starts, rng, rounds)
    return Detailed.of(line, fitted, depth, shared=True)


def fit_maps(
    line: np.ndarray,
    points: int,
    maps: int,
    depth: int,
    drawn: int,
    starts: int,
    rng: np.random.Generator | None,
    rounds: int,
    is_sampled: bool = False,
) -> np.ndarray:
    """Fit maps ``(N, n, n)`` to a ``line`` ``(M, d)`` of any dimension d, as `fit_curve` does. With
    ``is_sampled``, the first start draws polynomials through the points of the line, instead of
    those whose control points they are."""
    extent = max(float(np.ptp(line, axis=0).max()), 1e-300)
    model = _Model((line - line[0]) / extent, points, maps, depth, drawn, is_sampled)
    rng = np.random.default_rng(0) if rng is None else rng
    best: tuple[float, np.ndarray] | None = None
    undecided: tuple[float, np.ndarray] | None = None
    for start in range(starts):
        fit = scipy.optimize.least_squares(
            model.residuals, model.start(rng if start else None), model.jacobian,
            method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=rounds,
        )  # fmt: skip
        fitted = model.maps_of(fit.x)
        bounds = curve_contraction(fitted)
        error = float((model.residuals(fit.x)[: model.rest] ** 2).sum())
        if bounds.proved and (best is None or error < best[0]):
            best = error, fitted
        elif not bounds.refuted and (undecided is None or error < undecided[0]):
            undecided = error, fitted
        if best is not None and best[0] < 1e-24 * len(line):
            break  # an exact fit
    chosen = best or undecided
    if chosen is None:
        raise ShapeError(
            f"{starts} random starts of the fit gave no contracting affine maps for {points} "
            "control points",
            "at least one start whose fitted maps contract",
            "increase the number of starts, or choose fewer control points",
        )
    return chosen[1]


def rms_of(detailed: Detailed, levels: int) -> float:
    """Compute how far a line moves without the details of its finest ``levels``: the root mean
    square distance of its points, in the units of the line."""
    off = detailed.dropped(levels).line() - detailed.line()
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def bezier_maps(points: int, maps: int) -> np.ndarray:
    """Make the maps, float ``(N, n, n)``, of a Bézier curve of n ``points`` in N equal parts."""
    degree, parts = points - 1, np.zeros((maps, points, points))
    cuts = np.arange(maps + 1) / maps
    for part in range(maps):
        for j in range(points):  # the blossom at degree − j times the start, j times the end
            row = np.array([1.0])
            for end in [cuts[part]] * (degree - j) + [cuts[part + 1]] * j:
                row = np.append(row * (1 - end), 0.0) + np.append(0.0, row * end)
            parts[part, :, j] = row
    return parts


def polynomial_maps(points: int, maps: int) -> np.ndarray:
    """Make the maps, float ``(N, n, n)``, of a polynomial in N equal parts that passes through its
    n control ``points`` in equal steps (Lagrange)."""
    at = np.arange(points) / (points - 1)
    places = (np.arange(maps)[:, None] + at) / maps
    parts = np.ones((maps, points, points))
    for i in range(points):
        for j in np.delete(np.arange(points), i):
            parts[:, i] *= (places - at[j]) / (at[i] - at[j])
    return parts


def _power(words: np.ndarray, parts: np.ndarray, count: int) -> np.ndarray:
    """Multiply ``words`` ``(w, n, n)`` by all ``parts`` ``(k, n, n)``, ``count`` times."""
    for _ in range(count):
        words = np.einsum("wij,kjl->wkil", words, parts).reshape(-1, *parts.shape[1:])
    return words


def _power_slopes(
    words: np.ndarray, slopes: np.ndarray, parts: np.ndarray, bases: np.ndarray, count: int
) -> np.ndarray:
    """Derive `_power` by each number, ``(p, w, n, n)``: d(V T_i) = dV T_i + V dT_i, from the
    ``slopes`` of words and the ``bases`` ``(p, k, n, n)`` of parts."""
    for _ in range(count):
        later = np.einsum("pwij,kjl->pwkil", slopes, parts)
        later += np.einsum("wij,pkjl->pwkil", words, bases)
        slopes = later.reshape(len(slopes), -1, *parts.shape[1:])
        words = _power(words, parts, 1)
    return slopes


@dataclass
class _Model:
    """Residuals between a line and its drawing by maps, as a function of the maps' numbers."""

    line: np.ndarray
    size: int
    parts: int
    depth: int
    drawn: int
    is_sampled: bool = False

    def __post_init__(self):
        size, parts = self.size, self.parts
        self.step = size - 1
        self.size_of_point = self.line.shape[1]
        self.rest = self.size_of_point * (len(self.line) - 2)
        # free columns: all but the ends of the whole; two maps share the column of a joint
        columns = parts * self.step - 1
        where = windows(parts, size, True) - 1
        self.free = np.nonzero((where >= 0) & (where < columns))
        self.where = where[self.free]
        self.unknown = columns * self.step
        # how each parameter changes the maps; the first entry of each column compensates
        self.basis = np.zeros((self.unknown, parts, size, size))
        part, j = self.free
        for i in range(1, size):
            at = self.where * self.step + i - 1
            self.basis[at, part, i, j] = 1.0
            self.basis[at, part, 0, j] = -1.0
        self.fixed = np.zeros((parts, size, size))
        self.fixed[:, 0, :] = 1.0
        self.fixed[0, :, 0] = np.eye(size)[0]
        self.fixed[-1, :, -1] = np.eye(size)[-1]
        self.cells = parts ** (self.depth - self.drawn)
        self.width = self.step * parts**self.drawn + 1
        # of the products that must be small
        self.length = next(k for k in range(1, 64) if parts ** (k + 1) > _LOOKED_AT)
        self.seen: tuple[bytes, tuple] | None = None

    def start(self, rng: np.random.Generator | None) -> np.ndarray:
        """Choose the numbers of a Bézier curve's maps; with ``rng``, random ones about a straight
        line's."""
        if rng is None:
            made = polynomial_maps if self.is_sampled else bezier_maps
            maps = made(self.size, self.parts)
        else:
            at = np.arange(self.size) / self.step
            places = (np.arange(self.parts)[:, None] + at) / self.parts * self.step
            gaps = np.arange(self.size)[None, :, None] - places[:, None, :]
            maps = np.maximum(0, 1 - np.abs(gaps))
        part, j = self.free
        numbers = np.zeros((len(self.basis) // self.step, self.step))
        numbers[self.where] = maps[part, 1:, j]
        numbers = numbers.ravel()
        return numbers if rng is None else numbers + rng.normal(0, _SPREAD, self.unknown)

    def maps_of(self, numbers: np.ndarray) -> np.ndarray:
        return self.fixed + np.einsum("p,pkij->kij", numbers, self.basis)

    def residuals(self, numbers: np.ndarray) -> np.ndarray:
        return self._evaluate(numbers)[0]

    def jacobian(self, numbers: np.ndarray) -> np.ndarray:
        _, maps, whole, points, diagonals, penal = self._evaluate(numbers)
        change = self._changes(maps)
        blocks = points[windows(self.cells, self.size, True)]
        moved = np.einsum("cnd,pnk->pckd", blocks, change)
        lines = np.zeros((self.unknown, *self.line.shape))
        lines[:, windows(self.cells, self.width, True)] = moved
        flat = lines.transpose(1, 0, 2).reshape(len(self.line), -1)
        flat = flat - self._spread(whole, self._solve(whole, diagonals, flat))
        body = -flat[1:-1].reshape(-1, self.unknown, self.size_of_point).transpose(0, 2, 1)
        return np.vstack([body.reshape(self.rest, self.unknown), self._penalty_slopes(maps, penal)])

    def _evaluate(self, numbers: np.ndarray) -> tuple:
        """Compute residuals with the intermediate values, cached for the Jacobian at the same
        place."""
        key = numbers.tobytes()
        if self.seen is None or self.seen[0] != key:
            maps = self.maps_of(numbers)
            with np.errstate(over="ignore", invalid="ignore"):
                whole = self._whole(maps)
                products = self._products(maps)
            if not (np.isfinite(whole).all() and np.abs(whole).max() < 1e6):
                bad = np.full(self.rest + len(products), 1e3)
                zero = np.zeros((self.step * self.cells + 1, self.size_of_point))
                safe = self.maps_of(self.start(None))
                self.seen = key, (bad, safe, self._whole(safe), zero, None, None)
                return self.seen[1]
            normal = np.einsum("ik,k,jk->ij", whole, self._shares, whole)
            diagonals = banded(normal, self.cells)
            ends = np.zeros((self.step * self.cells + 1, self.size_of_point))
            ends[[0, -1]] = self.line[[0, -1]]
            off = self.line - self._spread(whole, ends)
            points = self._solve(whole, diagonals, off)
            off = off - self._spread(whole, points)
            sizes = np.sqrt((products**2).sum(axis=(1, 2)))
            penal = np.maximum(sizes - _SMALL, 0.0) * self._scale
            left = np.concatenate([off[1:-1].ravel(), penal])
            self.seen = key, (left, maps, whole, points + ends, diagonals, (products, sizes))
        return self.seen[1]

    @property
    def _scale(self) -> float:
        """The cost of a product that exceeds its limit by 1: as much as no fit at all."""
        return float(np.sqrt(((self.line - self.line.mean(axis=0)) ** 2).sum()))

    @property
    def _shares(self) -> np.ndarray:
        """Weights of the points of a polygon's piece: two pieces share each end."""
        weights = np.ones(self.width)
        weights[[0, -1]] = 0.5
        return weights

    def _whole(self, maps: np.ndarray) -> np.ndarray:
        """Put all words of the drawn length side by side, ``(n, K)``, shared columns once."""
        return self._side_by_side(_power(np.eye(self.size)[None], maps, self.drawn))

    def _side_by_side(self, words: np.ndarray) -> np.ndarray:
        rows = words[..., :-1].swapaxes(-3, -2).reshape(*words.shape[:-3], self.size, -1)
        return np.concatenate([rows, words[..., -1, :, -1:]], axis=-1)

    def _changes(self, maps: np.ndarray) -> np.ndarray:
        """Derive `_whole` by each number, ``(unknown, n, K)``."""
        words, slopes = np.eye(self.size)[None], np.zeros((self.unknown, 1, self.size, self.size))
        return self._side_by_side(_power_slopes(words, slopes, maps, self.basis, self.drawn))

    def _products(self, maps: np.ndarray) -> np.ndarray:
        """Multiply the maps on vectors of sum 0: ``(w, n − 1, n − 1)``."""
        parts = vector_parts(maps)
        return _power(parts, parts, self.length - 1)

    def _penalty_slopes(self, maps: np.ndarray, penal: tuple | None) -> np.ndarray:
        if penal is None:
            return np.zeros((self.parts**self.length, self.unknown))
        products, sizes = penal
        slopes = np.zeros((len(products), self.unknown))
        if not (sizes > _SMALL).any():
            return slopes
        parts, bases = vector_parts(maps), vector_parts(self.basis)
        change = _power_slopes(parts, bases, parts, bases, self.length - 1)
        over = sizes > _SMALL
        slopes[over] = (
            np.einsum("wij,pwij->wp", products[over], change[:, over])
            / sizes[over, None] * self._scale
        )  # fmt: skip
        return slopes

    def _spread(self, whole: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Draw the line ``(M, d)`` of points of the polygons ``(m, d)``."""
        blocks = points[windows(self.cells, self.size, True)]
        line = np.zeros((len(self.line), points.shape[1]))
        line[windows(self.cells, self.width, True)] = np.einsum("cnd,nk->ckd", blocks, whole)
        return line

    def _solve(self, whole: np.ndarray, diagonals: np.ndarray | None, off: np.ndarray):
        """Solve for the points nearest to a line ``off`` ``(M, d)``, with 0 at the ends of the
        whole."""
        points = np.zeros((self.step * self.cells + 1, off.shape[1]))
        if diagonals is None or len(points) < 3:
            return points
        blocks = off[windows(self.cells, self.width, True)]
        pulls = np.einsum("nk,k,ckd->cnd", whole, self._shares, blocks)
        right = np.zeros_like(points)
        np.add.at(right, windows(self.cells, self.size, True), pulls)
        points[1:-1] = solve_banded(diagonals[:, 1:-1], right[1:-1])
        return points


def _check(points: int, maps: int, starts: int, rounds: int) -> None:
    ranges = {
        "points": (points, 2, MOST_FITTED),
        "maps": (maps, 2, min(MOST_MAPS, 64)),
        "starts": (starts, 1, 1000),
        "rounds": (rounds, 1, 10000),
    }
    for name, (value, low, high) in ranges.items():
        check_range(name, value, low, high)
