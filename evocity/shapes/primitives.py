"""`Primitive`: points, lines and faces that a shape's maps transform."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import add_near_miss, spell
from evocity.shapes.checks import array_like
from evocity.shapes.languages import ShapeError


@dataclass(frozen=True, eq=False)
class Primitive:
    """A simple drawing: points, with the lines or faces between them.

    Parameters
    ----------
    points : coordinates of the points, float ``(n, 2)`` in the plane or ``(n, 3)`` in space.
    lines : numbers of the two end points of each of k lines, ``(k, 2)``.
    faces : numbers of the three corner points of each of k triangles, ``(k, 3)``. In space, the
        three corners of a face run counterclockwise as seen from outside.
    """

    points: np.ndarray
    lines: np.ndarray
    faces: np.ndarray

    @classmethod
    def of(cls, points: ArrayLike, lines: ArrayLike = (), faces: ArrayLike = ()) -> "Primitive":
        points = array_like(
            points,
            "points",
            "(n, 2) or (n, 3)",
            lambda s: len(s) == 2 and s[1] in (2, 3) and s[0] > 0,
        )
        parts = []
        for name, given, corners in (("lines", lines, 2), ("faces", faces, 3)):
            part = np.array(given, np.int64).reshape(-1, corners)
            if part.size and not (part.min() >= 0 and part.max() < len(points)):
                raise ShapeError(
                    f"the list of {name} contains a missing point, number "
                    f"{part[part >= len(points)].max(initial=-1)}",
                    f"point numbers from 0 to {len(points) - 1}",
                    f"correct the point numbers in the list of {name}",
                )
            parts.append(part)
        return cls(points, *parts)

    @classmethod
    def polyline(cls, points: Sequence) -> "Primitive":
        """Make the primitive of a line through at least two points."""
        count = len(points)
        return cls.of(points, np.column_stack([np.arange(count - 1), np.arange(1, count)]))

    @classmethod
    def polygon(cls, points: Sequence) -> "Primitive":
        """Make the primitive of a filled convex polygon with at least three corners."""
        count = len(points)
        return cls.of(points, (), [(0, k, k + 1) for k in range(1, count - 1)])

    @property
    def size(self) -> int:
        """Number of coordinates of a point: 2 in the plane, 3 in space."""
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
            "choose one of these primitives",
        )
    return _MAKERS[given]()


def in_space(primitive: Primitive, size: int) -> Primitive:
    """Lay a primitive of the plane into space if ``size`` is 3."""
    if primitive.size == size:
        return primitive
    if primitive.size > size:
        raise ShapeError(
            "the primitive is three-dimensional, but the affine maps are two-dimensional",
            "a two-dimensional primitive, such as 'point', 'segment' or 'square'",
            "choose a two-dimensional primitive, or give three-dimensional affine maps",
        )
    points = np.column_stack([primitive.points, np.zeros(len(primitive.points))])
    return replace(primitive, points=points)
