"""`Curve`: curves of few control points by projected iterated function systems, e.g. Bézier curves.

Source: Hnaidi, Guérin, Akkouche, *Insertion de détail dans des figures autosimilaires*, §3.2.
"""

from copy import copy
from dataclasses import dataclass, field
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import setting
from evocity.shapes.checks import MOST_MAPS, check_contraction
from evocity.shapes.contraction import Contraction, contraction_of
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import fixed_vector

#: The most control points of a curve, and the most computed points.
MOST_CONTROLS, MOST_POINTS = 64, 10**7
#: The tolerance of the sums of a map's columns.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Curve:
    """The curve of some control points. Each of the ``maps`` makes the control points of one part
    of the curve.

    Parameters
    ----------
    points : the control points, float ``(n, d)`` with n = 2…64, in the plane or in space.
    maps : float ``(N, n, n)``, N ≥ 2, with columns that sum to 1. If the control points are the
        columns of P, part i has the control points P T_i.

    Raises
    ------
    ShapeError : if points or maps are invalid, a column does not sum to 1, or maps do not contract.

    Source: the paper, definitions 5 to 8. Its definitions let rows sum to 1; its text and drawing
    need columns.
    """

    points: np.ndarray
    maps: np.ndarray
    contraction: Contraction = field(init=False)

    def __post_init__(self):
        points, maps = _points_of(self.points), np.array(self.maps, np.float64)
        count = len(points)
        if maps.ndim != 3 or maps.shape[1:] != (count, count) or not 2 <= len(maps) <= MOST_MAPS:
            raise ShapeError(
                f"maps of shape {maps.shape} do not fit {count} control points",
                f"(N, {count}, {count}), N = 2…{MOST_MAPS}",
                "give a matrix for each part",
            )
        if not np.isfinite(maps).all():
            raise ShapeError("some maps are not finite", "finite numbers", "correct the maps")
        off = np.abs(maps.sum(axis=1) - 1).max(axis=1)
        if off.max() > _SLACK:
            at = int(off.argmax())
            raise ShapeError(
                f"a column of map {at} sums to {1 + off[at]:.6g} or {1 - off[at]:.6g}",
                "columns that sum to 1",
                "divide each column by its sum",
            )
        for name, value in (("points", points), ("maps", maps)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        bounds = curve_contraction(maps)
        check_contraction(bounds)
        object.__setattr__(self, "contraction", bounds)

    def __len__(self) -> int:
        """Number of parts."""
        return len(self.maps)

    # -- constructors --------------------------------------------------------------------------

    @classmethod
    def bezier(cls, points: ArrayLike) -> "Curve":
        """Make the Bézier curve of n ``points``, of degree n − 1, with the maps of de Casteljau's
        halving."""
        points = np.asarray(points, float)
        count = len(points)
        first = np.array([[comb(j, i) / 2**j for j in range(count)] for i in range(count)])
        return cls(points, np.stack([first, first[::-1, ::-1]]))

    @classmethod
    def b_spline(cls, points: ArrayLike) -> "Curve":
        """Make the piece of the uniform B-spline of n points, of degree n − 1. Source: Lane &
        Riesenfeld 1980."""
        points = np.asarray(points, float)
        degree = len(points) - 1
        mask = [comb(degree + 1, k) / 2**degree for k in range(degree + 2)]

        def part(first: int) -> list[list[float]]:
            places = [[first + j - 2 * i for j in range(degree + 1)] for i in range(degree + 1)]
            return [[mask[k] if 0 <= k <= degree + 1 else 0.0 for k in row] for row in places]

        return cls(points, np.array([part(degree), part(degree + 1)]))

    @classmethod
    def four_point(cls, points: ArrayLike) -> "Curve":
        """Make the curve of the four-point scheme between the third and the fourth of six points.
        Source: Dyn, Levin & Gregory 1987."""
        points = np.asarray(points, float)
        if len(points) != 6:
            raise ShapeError(
                f"{len(points)} points are given", "six points", "give the points on both sides too"
            )
        weights = np.array([-1, 9, 9, -1]) / 16
        finer = np.zeros((6, 7))  # points 1 to 4 and the points between them
        for k in range(4):
            finer[k + 1, 2 * k] = 1
        for k in range(3):
            finer[k : k + 4, 2 * k + 1] = weights
        return cls(points, np.stack([finer[:, :6], finer[:, 1:]]))

    # -- properties and points
    # --------------------------------------------------------------------------

    @property
    def ends(self) -> np.ndarray:
        """Weights ``(2, n)`` of the control points at the beginning and the end of the curve. They
        are the fixed points of the first and of the last map."""
        return np.stack([fixed_vector(self.maps[0]), fixed_vector(self.maps[-1])])

    @property
    def gap(self) -> float:
        """The greatest distance between the end of one part and the start of the next, in units of
        the points. The gap is 0 if all parts join."""
        first, last = self.ends
        ends = np.einsum("kij,j->ki", self.maps[:-1], last)
        begins = np.einsum("kij,j->ki", self.maps[1:], first)
        apart = np.einsum("nd,kn->kd", self.points, ends - begins)
        return float(np.sqrt((apart**2).sum(axis=1)).max(initial=0.0))

    def polygons(self, depth: int) -> np.ndarray:
        """Compute the control points of all parts at a ``depth``, in the order of the parts, float
        ``(N**depth, n, d)``. Raises `ShapeError` for more than ten million points."""
        count = len(self) ** depth if 0 <= depth <= 64 else 0
        if isinstance(depth, bool) or not count or count * len(self.points) > MOST_POINTS:
            raise ShapeError(
                setting("depth", depth),
                f"parts of at most {MOST_POINTS} points",
                "lower it",
            )
        polygons = self.points[None]
        for _ in range(depth):
            polygons = np.einsum("knd,inm->kimd", polygons, self.maps)
            polygons = polygons.reshape(-1, *self.points.shape)
        return polygons

    def line(self, depth: int) -> np.ndarray:
        """Compute points on the curve at a ``depth``, float ``(N**depth + 1, d)``. They are the
        start of each part, and the end of the last part. Raises `ShapeError` as `polygons`."""
        polygons, (first, last) = self.polygons(depth), self.ends
        begins = np.einsum("knd,n->kd", polygons, first)
        return np.vstack([begins, np.einsum("nd,n->d", polygons[-1], last)])

    def moved(self, points: ArrayLike) -> "Curve":
        """Return the same maps with other control points."""
        points = _points_of(points)
        if len(points) != len(self.points):
            raise ShapeError(
                f"{len(points)} control points are given",
                f"{len(self.points)} points",
                "give this number of points",
            )
        curve = copy(self)  # its maps are valid already
        points.setflags(write=False)
        object.__setattr__(curve, "points", points)
        return curve


def _points_of(given: ArrayLike) -> np.ndarray:
    points = np.array(given, np.float64)
    if points.ndim != 2 or not 2 <= len(points) <= MOST_CONTROLS or not points.shape[1]:
        raise ShapeError(
            f"the control points have the shape {points.shape}",
            f"(n, 2) or (n, 3), n = 2…{MOST_CONTROLS}",
            "give a row for each point",
        )
    if not np.isfinite(points).all():
        raise ShapeError("some points are not finite", "finite numbers", "correct the points")
    return points


def vector_parts(maps: np.ndarray) -> np.ndarray:
    """Return what ``maps`` ``(…, n, n)`` do to vectors of sum 0: ``(…, n − 1, n − 1)``."""
    return maps[..., 1:, 1:] - maps[..., 1:, :1]


def curve_contraction(maps: np.ndarray) -> Contraction:
    """Bound the contraction of a curve's ``maps`` ``(N, n, n)`` on vectors of sum 0."""
    parts = vector_parts(maps)
    affine = np.concatenate([parts, np.zeros((*parts.shape[:2], 1))], axis=2)
    return contraction_of(affine, Language.every(len(maps)))
