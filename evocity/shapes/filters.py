"""Filters between a polygon with details and its parts: analysis and synthesis.

A polygon of n control points has N parts, each a polygon. Polygons that share their ends are a
sequence of points, ``(n - 1) c + 1`` for c polygons; others have n points each.

Source: Hnaidi, Guérin, Akkouche, §3.3; the closed form of U and shared ends are ours
(../shared/SHAPES.md §5).
"""

from dataclasses import dataclass

import numpy as np

from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import cholesky, conditions, null_rows, solve, solve_banded

#: Control points depend on each other if the condition of their weights exceeds this.
_WORST = 1e12


def interpolates(maps: np.ndarray) -> bool:
    """Tell whether the parts of ``maps`` ``(N, n, n)`` share their ends: the first begins where the
    whole begins, each begins where the previous part ends, the last ends where the whole ends."""
    count = maps.shape[1]
    ends = np.eye(count)[[0, -1]]
    off = [maps[0, :, 0] - ends[0], maps[-1, :, -1] - ends[1], maps[:-1, :, -1] - maps[1:, :, 0]]
    return all(np.abs(difference).max(initial=0.0) < 1e-9 for difference in off)


@dataclass(frozen=True)
class Filter:
    """Composition and decomposition of the K points of N parts at a level.

    whole : ``(n, K)``, T_0 … T_{N−1} side by side.
    detail : ``(m, K)``, U_0 … U_{N−1} side by side; its rows are orthonormal in ``weights``.
    weights : ``(K, K)``: the mean square shift of the line by a shift of the parts' points.
    own : ``(n, n)``, the same for the polygon's points.
    shared : whether parts share their ends.
    """

    whole: np.ndarray
    detail: np.ndarray
    weights: np.ndarray
    own: np.ndarray
    shared: bool

    def compose(self, polygons: np.ndarray, details: np.ndarray) -> np.ndarray:
        """Compose points of the parts ``(c, K)`` of ``polygons`` ``(c, n)`` and details ``(c,
        m)``."""
        return np.einsum("cn,nk->ck", polygons, self.whole) + np.einsum(
            "cm,mk->ck", details, self.detail
        )

    def decompose(self, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find polygons ``(c, n)`` and details ``(c, m)`` from which `compose` makes ``parts``."""
        edge = int(self.shared)
        inner = slice(edge, parts.shape[1] - edge)
        polygons = np.zeros((len(parts), len(self.whole)), parts.dtype)
        if edge:
            polygons[:, 0], polygons[:, -1] = parts[:, 0], parts[:, -1]
        rest = (parts - np.einsum("cn,nk->ck", polygons, self.whole))[:, inner]
        weighed = np.einsum("ck,kl->cl", rest, self.weights[inner, inner])
        details = np.einsum("ck,mk->cm", weighed, self.detail[:, inner])
        free = slice(edge, len(self.whole) - edge)
        if free.stop > free.start:
            under = self.whole[free, inner]
            normal = np.einsum("ik,kl,jl->ij", under, self.weights[inner, inner], under)
            right = np.einsum("ck,ik->ci", weighed, under)
            polygons[:, free] = solve(normal, right.T).T
        return polygons, details

    def update(self, details: np.ndarray) -> np.ndarray:
        """Compute how far the points ``((n - 1) c + 1, …)`` of c polygons with shared ends must
        move to be nearest to all parts together, instead of each polygon to its own parts with
        fixed ends. The ends of the whole line stay. Details ``(c, m, …)`` may have further axes."""
        count, size = len(details), len(self.whole)
        step = size - 1
        moves = np.zeros((step * count + 1, *details.shape[2:]), details.dtype)
        if count == 1 or not details.size:
            return moves
        ends = np.einsum("mk,kl,el->me", self.detail, self.weights, self.whole[[0, -1]])
        pulls = np.einsum("cm...,me->ce...", details, ends)
        right = np.zeros_like(moves)
        right[:-1:step] += pulls[:, 0]
        right[step::step] += pulls[:, 1]
        moves[1:-1] = solve_banded(banded(self.own, count)[:, 1:-1], right[1:-1])
        return moves


def banded(own: np.ndarray, count: int) -> np.ndarray:
    """Sum ``own`` ``(n, n)`` of each of ``count`` polygons with shared ends in a symmetric matrix,
    by its lower diagonals ``(n, (n - 1) count + 1)``."""
    step = len(own) - 1
    diagonals = np.zeros((step + 1, step * count + 1))
    for below in range(step + 1):
        for column in range(step + 1 - below):
            stop = column + step * (count - 1) + 1
            diagonals[below, column:stop:step] += own[column + below, column]
    return diagonals


def filters_of(maps: np.ndarray, depth: int, shared: bool) -> list[Filter]:
    """Make the filter of each level, the coarsest first.

    Rows of U at a level span the null space of [T_0 G … T_{N−1} G], with G = Σ T_i G T_iᵀ / N the
    weights of the points one level below. So dropping details leaves the nearest line.

    Raises `ShapeError` if the weights of control points depend on each other.
    """
    parts, size = maps.shape[0], maps.shape[1]
    step = size - int(shared)
    width = parts * step + int(shared)
    whole = np.zeros((size, width))
    for part in range(parts):
        whole[:, part * step : part * step + size] = maps[part]
    own = np.diag([1.0] * size)
    if shared:
        own[0, 0] = own[-1, -1] = 0.5  # two polygons share each
    filters = []
    for _ in range(depth):
        weights = np.zeros((width, width))
        for part in range(parts):
            at = slice(part * step, part * step + size)
            weights[at, at] += own / parts
        edge = int(shared)
        inner, free = slice(edge, width - edge), slice(edge, size - edge)
        low = cholesky(weights[inner, inner])
        across = np.einsum("ik,kl->il", whole[free, inner], low)
        if not conditions(across) < _WORST:
            raise ShapeError(
                "the weights of some control points are linearly dependent",
                "a curve with at most as many control points as degrees of freedom",
                "choose fewer control points",
            )
        detail = np.zeros((width - size, width))
        # U, orthonormal in the weights: orthogonal to T, divided by their root
        detail[:, inner] = solve(low.T, null_rows(across).T).T
        own = np.einsum("ik,kl,jl->ij", whole, weights, whole)
        filters.append(Filter(whole, detail, weights, own, shared))
    return filters[::-1]


def windows(count: int, size: int, shared: bool) -> np.ndarray:
    """Index the points of a sequence by each of ``count`` polygons of ``size`` points."""
    step = size - int(shared)
    return step * np.arange(count)[:, None] + np.arange(size)
