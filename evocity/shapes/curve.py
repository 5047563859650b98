"""Projected iterated function systems: curves of few control points, Bézier curves among them.

Source: Hnaidi, Guérin, Akkouche, *Insertion de détail dans des figures autosimilaires*, §3.2.
"""

from copy import copy
from dataclasses import dataclass, field
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import setting
from evocity.shapes.checks import MOST_MAPS, refused_growth
from evocity.shapes.contraction import Contraction, contraction_of
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.linear import fixed_of

#: The most control points of a curve, and the most points that are made of one.
MOST_CONTROLS, MOST_POINTS = 64, 10**7
#: So far, relative to 1, the columns of a map may sum to something else.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Curve:
    """The curve of control ``points``, of which each of the ``maps`` makes those of one part.

    Parameters
    ----------
    points : float ``(n, d)``, n = 2…64, of the plane or of space.
    maps : float ``(N, n, n)``, N ≥ 2, whose columns sum to 1: of the control points P, as columns,
        P T_i are those of part i.

    Raises
    ------
    ShapeError : points or maps that are none; columns of another sum; maps that do not contract.

    Source: the paper, definitions 5 to 8. There rows sum to 1; text and drawing need columns.
    """

    points: np.ndarray
    maps: np.ndarray
    contraction: Contraction = field(init=False)

    def __post_init__(self):
        points, maps = _points_of(self.points), np.array(self.maps, np.float64)
        count = len(points)
        if maps.ndim != 3 or maps.shape[1:] != (count, count) or not 2 <= len(maps) <= MOST_MAPS:
            raise ShapeError(
                f"maps of shape {maps.shape} for {count} control points",
                f"(N, {count}, {count}), N = 2…{MOST_MAPS}",
                "give a matrix a part",
            )
        if not np.isfinite(maps).all():
            raise ShapeError("maps with a number that is not finite", "finite ones", "correct it")
        off = np.abs(maps.sum(axis=1) - 1).max(axis=1)
        if off.max() > _SLACK:
            at = int(off.argmax())
            raise ShapeError(
                f"map {at}, of which a column sums to {1 + off[at]:.6g} or {1 - off[at]:.6g}",
                "columns that sum to 1",
                "divide each column by its sum",
            )
        for name, value in (("points", points), ("maps", maps)):
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        # what sums to nothing stays so: there maps must contract
        parts = maps[:, 1:, 1:] - maps[:, 1:, :1]
        affine = np.concatenate([parts, np.zeros((len(maps), count - 1, 1))], axis=2)
        found = contraction_of(affine, Language.every(len(maps)))
        refused_growth(found)
        object.__setattr__(self, "contraction", found)

    def __len__(self) -> int:
        """How many parts it has."""
        return len(self.maps)

    # -- known ones --------------------------------------------------------------------------

    @classmethod
    def bezier(cls, points: ArrayLike) -> "Curve":
        """The Bézier curve of n points, of degree n − 1, by de Casteljau's halving."""
        points = np.asarray(points, float)
        count = len(points)
        first = np.array([[comb(j, i) / 2**j for j in range(count)] for i in range(count)])
        return cls(points, np.stack([first, first[::-1, ::-1]]))

    @classmethod
    def b_spline(cls, points: ArrayLike) -> "Curve":
        """The piece of the uniform B-spline that n points make, of degree n − 1. Source: Lane &
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
        """What the four-point scheme makes of six points, from the third to the fourth of them.
        Source: Dyn, Levin & Gregory 1987."""
        points = np.asarray(points, float)
        if len(points) != 6:
            raise ShapeError(f"{len(points)} points", "six", "give those on both sides too")
        weights = np.array([-1, 9, 9, -1]) / 16
        finer = np.zeros((6, 7))  # of the points 1 to 4, those between them, and so on
        for k in range(4):
            finer[k + 1, 2 * k] = 1
        for k in range(3):
            finer[k : k + 4, 2 * k + 1] = weights
        return cls(points, np.stack([finer[:, :6], finer[:, 1:]]))

    # -- what it is --------------------------------------------------------------------------

    @property
    def ends(self) -> np.ndarray:
        """Weights ``(2, n)`` of the control points at the curve's beginning and at its end: the
        fixed points of the first map and of the last."""
        return np.stack([fixed_of(self.maps[0]), fixed_of(self.maps[-1])])

    @property
    def gap(self) -> float:
        """How far, at most, one part ends and the next begins, in units of the points; 0 where
        they join."""
        first, last = self.ends
        ends = np.einsum("kij,j->ki", self.maps[:-1], last)
        begins = np.einsum("kij,j->ki", self.maps[1:], first)
        apart = np.einsum("nd,kn->kd", self.points, ends - begins)
        return float(np.sqrt((apart**2).sum(axis=1)).max(initial=0.0))

    def polygons(self, depth: int) -> np.ndarray:
        """The control points of all parts at a ``depth``, float ``(N**depth, n, d)``, in their
        order. Raises `ShapeError` for more than ten million points."""
        count = len(self) ** depth if 0 <= depth <= 64 else 0
        if isinstance(depth, bool) or not count or count * len(self.points) > MOST_POINTS:
            raise ShapeError(
                setting("depth", depth),
                f"so few parts that they have {MOST_POINTS} points",
                "lower it",
            )
        found = self.points[None]
        for _ in range(depth):
            found = np.einsum("knd,inm->kimd", found, self.maps)
            found = found.reshape(-1, *self.points.shape)
        return found

    def line(self, depth: int) -> np.ndarray:
        """Points on the curve, float ``(N**depth + 1, d)``: where each part at a ``depth`` begins,
        and where the last ends. Raises `ShapeError` as `polygons`."""
        polygons, (first, last) = self.polygons(depth), self.ends
        begins = np.einsum("knd,n->kd", polygons, first)
        return np.vstack([begins, np.einsum("nd,n->d", polygons[-1], last)])

    def moved(self, points: ArrayLike) -> "Curve":
        """The same maps with other control points."""
        points = _points_of(points)
        if len(points) != len(self.points):
            raise ShapeError(f"{len(points)} control points", f"{len(self.points)}", "give as many")
        found = copy(self)  # of its maps all is known
        points.setflags(write=False)
        object.__setattr__(found, "points", points)
        return found


def _points_of(given: ArrayLike) -> np.ndarray:
    points = np.array(given, np.float64)
    if points.ndim != 2 or not 2 <= len(points) <= MOST_CONTROLS or not points.shape[1]:
        raise ShapeError(
            f"control points of shape {points.shape}",
            f"(n, 2) or (n, 3), n = 2…{MOST_CONTROLS}",
            "give a row a point",
        )
    if not np.isfinite(points).all():
        raise ShapeError("points with a number that is not finite", "finite ones", "correct it")
    return points


__all__ = ["MOST_CONTROLS", "MOST_POINTS", "Curve"]
