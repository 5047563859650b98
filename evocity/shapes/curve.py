"""`Curve`: curves of few control points by projected iterated function systems, e.g. Bézier curves.

Source: Hnaidi, Guérin, Akkouche, *Insertion de détail dans des figures autosimilaires*, §3.2.
"""

from copy import copy
from dataclasses import dataclass, field
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import setting
from evocity.shapes.checks import MOST_MAPS, array_like
from evocity.shapes.contraction import Contraction, check_contraction, contraction_of
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import fixed_vector

#: The most control points of a curve, and the most computed points.
MOST_CONTROLS, MOST_POINTS = 64, 10**7
#: The tolerance of the sums of a map's columns.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of few control points, made of parts that are small copies of the whole curve.

    Parameters
    ----------
    points : the control points, float ``(n, d)`` with n = 2…64, in the plane or in space.
    maps : one matrix for each part of the curve, float ``(N, n, n)``, N ≥ 2; each column of a
        matrix sums to 1. If the columns of P are the control points of the curve, the control
        points of part i are P T_i, with T_i the map of the part.

    Raises
    ------
    ShapeError : one of: invalid points; invalid maps; a column of a map that does not sum to 1;
        maps that do not contract.

    Source: definitions 5 to 8 of the paper by Hnaidi, Guérin and Akkouche. Definitions 5 to 8 of
    the paper let the rows of a map sum to 1, but the paper's text and drawing need columns that sum
    to 1.
    """

    points: np.ndarray
    maps: np.ndarray
    contraction: Contraction = field(init=False)

    def __post_init__(self):
        points = _points_of(self.points)
        count = len(points)
        maps = array_like(
            self.maps,
            f"maps for {count} control points",
            f"(N, {count}, {count}), N = 2…{MOST_MAPS}",
            lambda shape: shape[1:] == (count, count) and 2 <= shape[0] <= MOST_MAPS,
        )
        off = np.abs(maps.sum(axis=1) - 1).max(axis=1)
        if off.max() > _SLACK:
            at = int(off.argmax())
            raise ShapeError(
                f"the sum of a column of affine map {at} differs from 1 by {off[at]:.6g}",
                "affine maps whose columns each sum to 1",
                f"divide each column of map {at} by its sum",
            )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "maps", maps)
        bounds = curve_contraction(maps)
        check_contraction(bounds)
        object.__setattr__(self, "contraction", bounds)

    def __len__(self) -> int:
        """Number of parts."""
        return len(self.maps)

    @classmethod
    def bezier(cls, points: ArrayLike) -> "Curve":
        """Make the Bézier curve of degree n − 1 with n control ``points``. De Casteljau's algorithm
        gives the maps of the curve's two halves."""
        points = np.asarray(points, float)
        count = len(points)
        first = np.array([[comb(j, i) / 2**j for j in range(count)] for i in range(count)])
        return cls(points, np.stack([first, first[::-1, ::-1]]))

    @classmethod
    def b_spline(cls, points: ArrayLike) -> "Curve":
        """Make a piece of the uniform B-spline of degree n − 1 from n control ``points``. Source:
        Lane & Riesenfeld 1980."""
        points = np.asarray(points, float)
        degree = len(points) - 1
        mask = [comb(degree + 1, k) / 2**degree for k in range(degree + 2)]

        def part(first: int) -> list[list[float]]:
            places = [[first + j - 2 * i for j in range(degree + 1)] for i in range(degree + 1)]
            return [[mask[k] if 0 <= k <= degree + 1 else 0.0 for k in row] for row in places]

        return cls(points, np.array([part(degree), part(degree + 1)]))

    @classmethod
    def four_point(cls, points: ArrayLike) -> "Curve":
        """Make the curve between the third and the fourth of six ``points``, by the four-point
        scheme of subdivision. Source: Dyn, Levin & Gregory 1987."""
        points = np.asarray(points, float)
        if len(points) != 6:
            raise ShapeError(
                f"the four-point scheme received {len(points)} points",
                "six points",
                "give two points before the start of the curve, and two points after its end",
            )
        weights = np.array([-1, 9, 9, -1]) / 16
        finer = np.zeros((6, 7))  # points 1 to 4 and the points between them
        for k in range(4):
            finer[k + 1, 2 * k] = 1
        for k in range(3):
            finer[k : k + 4, 2 * k + 1] = weights
        return cls(points, np.stack([finer[:, :6], finer[:, 1:]]))

    @property
    def ends(self) -> np.ndarray:
        """Weights ``(2, n)`` of the control points at the beginning and at the end of the curve.
        The weights are the fixed points of the first map and of the last map."""
        return np.stack([fixed_vector(self.maps[0]), fixed_vector(self.maps[-1])])

    @property
    def gap(self) -> float:
        """The greatest distance between the end of a part and the start of the next part, in the
        units of the points. The gap is 0 if all parts join."""
        first, last = self.ends
        ends = np.einsum("kij,j->ki", self.maps[:-1], last)
        begins = np.einsum("kij,j->ki", self.maps[1:], first)
        apart = np.einsum("nd,kn->kd", self.points, ends - begins)
        return float(np.sqrt((apart**2).sum(axis=1)).max(initial=0.0))

    def polygons(self, depth: int) -> np.ndarray:
        """The result is float `(N^depth, n, d)` for N parts with n control points of d coordinates,
        in the order of the parts. The result is float ``(N^depth, n, d)``, in the order of the
        parts. Raises `ShapeError` for more than ten million points."""
        count = len(self) ** depth if 0 <= depth <= 64 else 0
        if isinstance(depth, bool) or not count or count * len(self.points) > MOST_POINTS:
            raise ShapeError(
                setting("depth", depth),
                f"a depth whose parts have at most {MOST_POINTS} points together",
                "choose a smaller depth",
            )
        polygons = self.points[None]
        for _ in range(depth):
            polygons = np.einsum("knd,inm->kimd", polygons, self.maps)
            polygons = polygons.reshape(-1, *self.points.shape)
        return polygons

    def line(self, depth: int) -> np.ndarray:
        """Divide the curve ``depth`` times into N parts, and compute points on the curve, float
        ``(N^depth + 1, d)``. The points are the start of each part and the end of the last part.
        Raises `ShapeError` for more than ten million points."""
        polygons, (first, last) = self.polygons(depth), self.ends
        begins = np.einsum("knd,n->kd", polygons, first)
        return np.vstack([begins, np.einsum("nd,n->d", polygons[-1], last)])

    def moved(self, points: ArrayLike) -> "Curve":
        """Return a curve with the same maps and the given control points."""
        points = _points_of(points)
        if len(points) != len(self.points):
            raise ShapeError(
                f"the curve received {len(points)} control points",
                f"{len(self.points)} control points, because each affine map of the curve has "
                f"{len(self.points)} rows",
                f"give {len(self.points)} control points",
            )
        curve = copy(self)  # its maps are valid already
        object.__setattr__(curve, "points", points)
        return curve


def _points_of(given: ArrayLike) -> np.ndarray:
    return array_like(
        given,
        "control points",
        f"(n, 2) or (n, 3), n = 2…{MOST_CONTROLS}",
        lambda shape: len(shape) == 2 and 2 <= shape[0] <= MOST_CONTROLS and shape[1] > 0,
    )


def vector_parts(maps: np.ndarray) -> np.ndarray:
    """Return what ``maps`` ``(…, n, n)`` do to vectors of sum 0: ``(…, n − 1, n − 1)``."""
    return maps[..., 1:, 1:] - maps[..., 1:, :1]


def curve_contraction(maps: np.ndarray) -> Contraction:
    """Bound the contraction of a curve's ``maps`` ``(N, n, n)`` on vectors of sum 0."""
    parts = vector_parts(maps)
    affine = np.concatenate([parts, np.zeros((*parts.shape[:2], 1))], axis=2)
    return contraction_of(affine, Language.every(len(maps)))
