"""How a polygon and its details are parts, and parts a polygon and its details.

A polygon of n control points has N parts, each a polygon again. Where polygons share their ends,
those are the points of one sequence, ``(n - 1) c + 1`` of c polygons; else each has its own n.

Source: Hnaidi, Guérin, Akkouche, §3.3; the closed form of U, and ends that are shared, are ours
(../shared/SHAPES.md §5).
"""

from dataclasses import dataclass

import numpy as np

from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import banded_solved, conditions, lower_of, nothing_of, solved

#: Beyond this condition of their weights control points are taken to depend on each other.
_WORST = 1e12


def interpolates(maps: np.ndarray) -> bool:
    """Whether parts that ``maps`` ``(N, n, n)`` make share their ends: the first begins where the
    whole does, each begins where the one before it ends, the last ends where the whole does."""
    count = maps.shape[1]
    ends = np.eye(count)[[0, -1]]
    off = [maps[0, :, 0] - ends[0], maps[-1, :, -1] - ends[1], maps[:-1, :, -1] - maps[1:, :, 0]]
    return all(np.abs(one).max(initial=0.0) < 1e-9 for one in off)


@dataclass(frozen=True)
class Filter:
    """What makes the K points of N parts, and takes them apart, at one level.

    whole : ``(n, K)``, T_0 … T_{N−1} side by side.
    detail : ``(m, K)``, U_0 … U_{N−1} side by side; its rows are orthonormal in ``weights``.
    weights : ``(K, K)``: how much a change of the parts' points moves the line, mean of squares.
    own : ``(n, n)``, the same of the polygon's points.
    shared : whether parts share their ends.
    """

    whole: np.ndarray
    detail: np.ndarray
    weights: np.ndarray
    own: np.ndarray
    shared: bool

    def together(self, polygons: np.ndarray, details: np.ndarray) -> np.ndarray:
        """Points of the parts ``(c, K)`` of ``polygons`` ``(c, n)`` with ``details`` ``(c, m)``."""
        return np.einsum("cn,nk->ck", polygons, self.whole) + np.einsum(
            "cm,mk->ck", details, self.detail
        )

    def apart(self, parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Polygons ``(c, n)`` and details ``(c, m)`` of which `together` makes ``parts``."""
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
            polygons[:, free] = solved(normal, right.T).T
        return polygons, details

    def update(self, details: np.ndarray) -> np.ndarray:
        """Of shared ends, how far the points ``((n - 1) c + 1,)`` of c polygons must move so that
        they lie nearest to their parts together, and not each polygon to its own with its ends in
        place. The ends of the whole line stay."""
        count, size = len(details), len(self.whole)
        step = size - 1
        found = np.zeros(step * count + 1, details.dtype)
        if count == 1 or not details.size:
            return found
        ends = np.einsum("mk,kl,el->me", self.detail, self.weights, self.whole[[0, -1]])
        pulls = np.einsum("cm,me->ce", details, ends)
        right = np.zeros_like(found)
        right[:-1:step] += pulls[:, 0]
        right[step::step] += pulls[:, 1]
        found[1:-1] = banded_solved(banded(self.own, count)[:, 1:-1], right[1:-1])
        return found


def banded(own: np.ndarray, count: int) -> np.ndarray:
    """The symmetric matrix that ``own`` ``(n, n)`` of each of ``count`` polygons with shared ends
    add up to, by its lower diagonals ``(n, (n - 1) count + 1)``."""
    step = len(own) - 1
    found = np.zeros((step + 1, step * count + 1))
    for below in range(step + 1):
        for column in range(step + 1 - below):
            stop = column + step * (count - 1) + 1
            found[below, column:stop:step] += own[column + below, column]
    return found


def filters_of(maps: np.ndarray, depth: int, shared: bool) -> list[Filter]:
    """The filter of each level, the coarsest first.

    Rows of U at a level span what [T_0 G … T_{N−1} G] makes nothing of, G = Σ T_i G T_iᵀ / N the
    weights of the points one level below. Dropping details then leaves what lies nearest.

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
        own[0, 0] = own[-1, -1] = 0.5  # each is of two polygons
    found = []
    for _ in range(depth):
        weights = np.zeros((width, width))
        for part in range(parts):
            at = slice(part * step, part * step + size)
            weights[at, at] += own / parts
        edge = int(shared)
        inner, free = slice(edge, width - edge), slice(edge, size - edge)
        low = lower_of(weights[inner, inner])
        across = np.einsum("ik,kl->il", whole[free, inner], low)
        if not conditions(across) < _WORST:
            raise ShapeError(
                "control points whose weights depend on each other",
                "as many points as the curve has freedom",
                "take fewer points",
            )
        detail = np.zeros((width - size, width))
        # U, orthonormal in the weights: what is orthogonal to T, divided by their root
        detail[:, inner] = solved(low.T, nothing_of(across).T).T
        own = np.einsum("ik,kl,jl->ij", whole, weights, whole)
        found.append(Filter(whole, detail, weights, own, shared))
    return found[::-1]


def windows(count: int, size: int, shared: bool) -> np.ndarray:
    """Which points of a sequence are those of each of ``count`` polygons of ``size`` points."""
    step = size - int(shared)
    return step * np.arange(count)[:, None] + np.arange(size)


__all__ = ["Filter", "banded", "filters_of", "interpolates", "windows"]
