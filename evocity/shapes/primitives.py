"""`Primitive`: points, lines and faces that a shape's maps transform."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import add_near_miss, spell
from evocity.shapes.languages import ShapeError


@dataclass(frozen=True, eq=False)
class Primitive:
    """Points, with the lines or faces between them.

    Parameters
    ----------
    points : float ``(n, m)``, in the plane or in space.
    lines : pairs of points ``(k, 2)``, by the numbers of the points.
    faces : triangles ``(k, 3)``, by the numbers of the points; in space counterclockwise as seen
        from outside.
    """

    points: np.ndarray
    lines: np.ndarray
    faces: np.ndarray

    @classmethod
    def of(cls, points: ArrayLike, lines: ArrayLike = (), faces: ArrayLike = ()) -> "Primitive":
        points = np.array(points, np.float64)
        if points.ndim != 2 or points.shape[1] not in (2, 3) or not len(points):
            raise ShapeError(
                f"the points have the shape {points.shape}",
                "points of 2 or 3 numbers",
                "correct the points",
            )
        if not np.isfinite(points).all():
            raise ShapeError("a point is not finite", "finite numbers", "correct the point")
        parts = []
        for name, given, corners in (("lines", lines, 2), ("faces", faces, 3)):
            part = np.array(given, np.int64).reshape(-1, corners)
            if part.size and not (part.min() >= 0 and part.max() < len(points)):
                raise ShapeError(
                    f"{name} use a missing point; the highest number is {part.max()}",
                    f"points 0 to {len(points) - 1}",
                    f"correct the {name}",
                )
            parts.append(part)
        return cls(points, *parts)

    @classmethod
    def polyline(cls, points: Sequence) -> "Primitive":
        """Make a line through at least two points."""
        count = len(points)
        return cls.of(points, np.column_stack([np.arange(count - 1), np.arange(1, count)]))

    @classmethod
    def polygon(cls, points: Sequence) -> "Primitive":
        """Make a filled convex polygon with at least three corners."""
        count = len(points)
        return cls.of(points, (), [(0, k, k + 1) for k in range(1, count - 1)])

    @property
    def size(self) -> int:
        """Number of coordinates: 2 in the plane, 3 in space."""
        return self.points.shape[1]


def _square() -> Primitive:
    return Primitive.polygon([(0, 0), (1, 0), (1, 1), (0, 1)])


def _cube() -> Primitive:
    corners = np.array(list(product((0, 1), repeat=3)), float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Primitive.of(corners, (), [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def _sphere(rings: int = 8, around: int = 16) -> Primitive:
    """Make a sphere of radius ½ about (½, ½, ½)."""
    tilt = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)[1:-1]
    turn = np.arange(around) * 2 * np.pi / around
    ring = [(np.cos(t) * np.cos(a), np.cos(t) * np.sin(a), np.sin(t)) for t in tilt for a in turn]
    points = np.array([(0, 0, -1), *ring, (0, 0, 1)]) / 2 + 0.5
    top, faces = len(points) - 1, []
    for k in range(around):
        after = (k + 1) % around
        faces.append((0, 1 + after, 1 + k))
        for row in range(rings - 2):
            low, high = 1 + row * around, 1 + (row + 1) * around
            faces += [(low + k, low + after, high + after), (low + k, high + after, high + k)]
        last = 1 + (rings - 2) * around
        faces.append((last + k, last + after, top))
    return Primitive.of(points, (), faces)


def _cylinder(around: int = 16) -> Primitive:
    """Make a cylinder of radius ½ about (½, ½), from height 0 to 1."""
    turn = np.arange(around) * 2 * np.pi / around
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) / 2 + 0.5
    points = np.vstack([np.column_stack([ring, np.full(around, z)]) for z in (0.0, 1.0)])
    faces = []
    for k in range(around):
        after = (k + 1) % around
        faces += [(k, after, around + after), (k, around + after, around + k)]
    faces += [(0, k + 1, k) for k in range(1, around - 1)]
    faces += [(around, around + k, around + k + 1) for k in range(1, around - 1)]
    return Primitive.of(points, (), faces)


_MAKERS = {
    "point": lambda: Primitive.of([(0, 0)]),
    "segment": lambda: Primitive.polyline([(0, 0), (1, 0)]),
    "square": _square,
    "cube": _cube,
    "sphere": _sphere,
    "cylinder": _cylinder,
}
#: Names of primitives; give a polyline, a polygon or a polyhedron as `Primitive`.
PRIMITIVES = tuple(_MAKERS)


def primitive_of(given: "str | Primitive") -> Primitive:
    """Return a primitive by its name, in the unit square or cube; a `Primitive` stays."""
    if isinstance(given, Primitive):
        return given
    if given not in _MAKERS:
        raise ShapeError(
            add_near_miss(f"primitive {spell(given)}", str(given), _MAKERS),
            f"one of {', '.join(PRIMITIVES)}, or a Primitive",
            "choose one of them",
        )
    return _MAKERS[given]()
