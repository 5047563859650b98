"""Surfaces of few control points by projected iterated function systems on tensor products.

Hnaidi, Guérin and Akkouche name surfaces as future work (§5). The construction is ours: the curves
of `evocity.shapes.curve` along both axes of a grid.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import setting
from evocity.shapes.checks import array_like
from evocity.shapes.curve import MOST_CONTROLS, MOST_POINTS, Curve
from evocity.shapes.languages import ShapeError


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface of few control points, made of parts that are small copies of the whole surface.

    points : the grid of control points, float ``(n, m, d)``, n and m = 2…64, d = 1…3.
    rows : one matrix for each part along the first axis, float ``(N, n, n)``, as in `Curve`.
    columns : one matrix for each part along the second axis, float ``(M, m, m)``.

    The part (i, j) of control points P has the control points T_iᵀ P T'_j, with T_i from ``rows``
    and T'_j from ``columns``. Raises `ShapeError` for the same reasons as `Curve`.
    """

    points: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    _axes: tuple[Curve, Curve] = field(init=False, repr=False)

    def __post_init__(self):
        points = array_like(
            self.points,
            "control points of the surface",
            f"(n, m, d), n and m = 2…{MOST_CONTROLS}, d = 1…3",
            lambda shape: (
                len(shape) == 3
                and all(2 <= side <= MOST_CONTROLS for side in shape[:2])
                and 1 <= shape[2] <= 3
            ),
        )
        axes = tuple(
            Curve(np.zeros((size, 2)), maps)
            for size, maps in zip(points.shape, (self.rows, self.columns), strict=False)
        )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "rows", axes[0].maps)
        object.__setattr__(self, "columns", axes[1].maps)
        object.__setattr__(self, "_axes", axes)

    @classmethod
    def bezier(cls, points: ArrayLike) -> "Surface":
        """Make the Bézier surface of a grid of control ``points`` ``(n, m, d)``."""
        return cls._of_curves(points, Curve.bezier)

    @classmethod
    def b_spline(cls, points: ArrayLike) -> "Surface":
        """Make a patch of the uniform B-spline surface of degrees n − 1 and m − 1."""
        return cls._of_curves(points, Curve.b_spline)

    @classmethod
    def _of_curves(cls, points: ArrayLike, made) -> "Surface":
        points = np.asarray(points, float)
        sides = points.shape[:2] if points.ndim == 3 else (0, 0)
        maps = [made(np.zeros((side, 2))).maps for side in sides]
        return cls(points, *maps)

    def patches(self, depth: int) -> np.ndarray:
        """Compute the control points of all parts after ``depth`` divisions, float
        ``(N^depth, M^depth, n, m, d)``. Raises `ShapeError` for more than ten million points."""
        words = [_products(maps, depth, self.points.size) for maps in (self.rows, self.columns)]
        if len(words[0]) * len(words[1]) * self.points.size > MOST_POINTS:
            raise _too_deep(depth)
        return np.einsum("rni,nmd,cmj->rcijd", words[0], self.points, words[1], optimize=True)

    def grid(self, depth: int) -> np.ndarray:
        """Compute points on the surface, float ``(N^depth + 1, M^depth + 1, d)``: the corners of
        all parts after ``depth`` divisions. Raises `ShapeError` for more than ten million
        points."""
        weights = []
        for maps, axis in zip((self.rows, self.columns), self._axes, strict=True):
            words, (first, last) = _products(maps, depth, self.points.size), axis.ends
            begins = np.einsum("wij,j->wi", words, first)
            end = np.einsum("ij,j->i", words[-1], last)
            weights.append(np.vstack([begins, end]))
        if len(weights[0]) * len(weights[1]) * self.points.shape[2] > MOST_POINTS:
            raise _too_deep(depth)
        return np.einsum("rn,nmd,cm->rcd", weights[0], self.points, weights[1], optimize=True)


def _products(maps: np.ndarray, depth: int, each: int) -> np.ndarray:
    """Multiply all words of ``depth`` maps: ``(N^depth, n, n)``."""
    if isinstance(depth, bool) or not 0 <= depth <= 64 or len(maps) ** depth * each > MOST_POINTS:
        raise _too_deep(depth)
    words = np.eye(maps.shape[1])[None]
    for _ in range(depth):
        words = np.einsum("wij,kjl->wkil", words, maps).reshape(-1, *maps.shape[1:])
    return words


def _too_deep(depth: int) -> ShapeError:
    return ShapeError(
        setting("depth", depth),
        f"a depth whose parts have at most {MOST_POINTS} points together",
        "choose a smaller depth",
    )
