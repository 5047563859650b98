"""Wire forms, a segment replaced by a line and iterated; and metamorphosis between shapes.

Source: Tosan, Excoffier, Rondet-Mignotte 2005, §3.1 and §3.2; Dubuc 1987; Prusinkiewicz & Sandness
1988; Bowman 1995 and Burch & Hart 1997 (metamorphosis).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evocity.shapes.checks import array_like, check_range, check_same_space
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import polar
from evocity.shapes.shape import Shape


def wire(
    points: Sequence,
    arcs: Sequence[tuple[int, int]] | None = None,
    flipped: Sequence[bool] = (),
    **more: Any,
) -> Shape:
    """Make a wire form, such as the Koch curve: a line replaces a segment, again and again.

    The first line replaces the segment from (0, 0) to (1, 0). In a wire form, the segments of the
    replacing line are called arcs.

    points : points of the line that replaces a segment, float ``(n, 2)`` or n complex numbers.
    arcs : the numbers (start, end) of the two points that each arc joins. Arcs may form any graph;
        by default, arcs join each point to the next point.
    flipped : whether the copy of the line on each arc is mirrored; by default, no copy of the line
        is mirrored.
    more : further arguments of `Shape`; the default primitive is the segment.

    The map of each arc is a similarity. Arcs with a common point keep this point at every depth, so
    a connected graph makes a connected form. Raises `ShapeError` for fewer than two points, for
    arcs between missing points, and for arcs that are too long to contract.
    """
    at = np.asarray(points)
    if not np.iscomplexobj(at):
        at = array_like(points, "points", "(n, 2)", lambda s: len(s) == 2 and s[1] == 2)
        at = at[:, 0] + 1j * at[:, 1]
    count = len(at)
    if count < 2:
        found = f"the wire form has too few points, {count}"
        raise ShapeError(found, "at least two points", "add points to the wire form")
    pairs = [(k, k + 1) for k in range(count - 1)] if arcs is None else list(arcs)
    if not all(0 <= end < count for pair in pairs for end in pair):
        raise ShapeError(
            "an arc joins a point that does not exist",
            f"arcs whose point numbers are from 0 to {count - 1}",
            "correct the point numbers in the arc",
        )
    mirrors = list(flipped) or [False] * len(pairs)
    if len(mirrors) != len(pairs):
        raise ShapeError(
            f"the parameter 'flipped' has {len(mirrors)} values for {len(pairs)} arcs",
            "one value of 'flipped' for each arc",
            f"give {len(pairs)} values of 'flipped'",
        )
    maps = []
    for (start, end), mirror in zip(pairs, mirrors, strict=True):
        turn, sign = at[end] - at[start], -1.0 if mirror else 1.0
        maps.append([
            [turn.real, -turn.imag * sign, at[start].real],
            [turn.imag, turn.real * sign, at[start].imag],
        ])  # fmt: skip
    return Shape(np.array(maps), **{"primitive": "segment"} | more)


def joint_gap(shape: Shape) -> float:
    """Measure the greatest gap between the end of a map of a wire form and the start of the next,
    for the segment from (0, 0) to (1, 0). 0 for a line."""
    ends = shape.maps[:, :, 0] + shape.maps[:, :, 2]
    return float(np.sqrt(((ends[:-1] - shape.maps[1:, :, 2]) ** 2).sum(axis=1)).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Metamorphosis:
    """The metamorphosis of a shape into another shape. A call with a number t returns an
    intermediate shape: t = 0 gives the shape ``first``, and t = 1 gives the shape ``last``.

    first, last : shapes that the metamorphosis returns for t = 0 and for t = 1.
    pairs : numbers of paired maps: a map of the first shape becomes the paired map of the last
        shape.
    linear : whether the coefficients of the maps are interpolated directly, which keeps connected
        forms connected. If ``linear`` is false, the rotation of each map turns in the shorter
        direction, and the stretches of the maps are interpolated.
    """

    first: Shape
    last: Shape
    pairs: tuple[tuple[int, int], ...]
    linear: bool

    def __call__(self, t: float) -> Shape:
        check_range("t", t, 0, 1)
        before, after = (list(numbers) for numbers in zip(*self.pairs, strict=True))
        ones, others = self.first.maps[before], self.last.maps[after]
        if self.linear:
            maps = (1 - t) * ones + t * others
        else:
            maps = np.stack([_interpolate(a, b, t) for a, b in zip(ones, others, strict=True)])
        colours = None
        if self.first.colours is not None and self.last.colours is not None:
            colours = (1 - t) * self.first.colours[before] + t * self.last.colours[after]
        nearer = self.first if t < 0.5 else self.last
        return Shape(maps, nearer.primitive, None, colours, nearer.mix)


def metamorphosis(first: Shape, last: Shape, linear: bool | None = None) -> Metamorphosis:
    """Make the metamorphosis of the ``first`` shape into the ``last`` shape. Both shapes must have
    the same number of coordinates and the language of all words.

    linear : whether the coefficients of the maps are interpolated directly, see `Metamorphosis`. By
        default ``linear`` is true for two wire forms whose arcs follow each other without gaps.

    If the numbers of maps differ, the last map of the shape with fewer maps is paired with several
    maps. In a wire form, all new maps but the first grow from the end point of the line, so that
    the line stays connected.

    Raises `ShapeError` if only one of the two shapes is three-dimensional, or if a shape has a
    restricted language.
    """
    check_same_space(first, last)
    for shape in (first, last):
        if shape.language != type(shape.language).every(len(shape)):
            raise ShapeError(
                "the language of a shape is restricted",
                "two shapes whose languages contain all words",
                "make the metamorphosis of the unrestricted shapes, then restrict the result",
            )
    joined = first.size == 2 and max(joint_gap(first), joint_gap(last)) < 1e-9
    if linear is None:
        linear = joined
    count = max(len(first), len(last))
    pairs = tuple((min(k, len(first) - 1), min(k, len(last) - 1)) for k in range(count))
    if linear and len(first) != len(last):
        first, last = (_pad_maps(shape, count) for shape in (first, last))
        pairs = tuple((k, k) for k in range(count))
    return Metamorphosis(first, last, pairs, linear)


def _pad_maps(shape: Shape, count: int) -> Shape:
    end = shape.maps[-1, :, 0] + shape.maps[-1, :, 2]
    points = np.zeros((count - len(shape), 2, 3))
    points[:, :, 2] = end
    colours = None
    if shape.colours is not None:
        colours = np.vstack([shape.colours, np.repeat(shape.colours[-1:], len(points), axis=0)])
    return Shape(np.concatenate([shape.maps, points]), shape.primitive, None, colours, shape.mix)


def _interpolate(a: np.ndarray, b: np.ndarray, t: float) -> np.ndarray:
    """Interpolate two maps: turns the shorter way, stretches and translations linearly."""
    size = a.shape[0]
    (turn_a, stretch_a), (turn_b, stretch_b) = polar(a[:, :size]), polar(b[:, :size])
    stretch = (1 - t) * stretch_a + t * stretch_b
    back = np.einsum("ji,jk->ik", turn_a, turn_b)
    turn = np.einsum("ij,jk->ik", turn_a, _partial_rotation(back, t))
    part = np.einsum("ij,jk->ik", turn, stretch)
    return np.column_stack([part, (1 - t) * a[:, size] + t * b[:, size]])


def _partial_rotation(turn: np.ndarray, t: float) -> np.ndarray:
    """Rotate by a share ``t`` of the angle of ``turn``; interpolate a mirror linearly, so that it
    is flat halfway."""
    size = len(turn)
    if size == 2:
        if turn[0, 0] * turn[1, 1] - turn[0, 1] * turn[1, 0] < 0:
            return (1 - t) * np.eye(2) + t * turn
        angle = np.arctan2(turn[1, 0], turn[0, 0]) * t
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    cosine = np.clip((np.trace(turn) - 1) / 2, -1, 1)
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    length = np.sqrt((axis**2).sum())
    if length < 1e-12:  # no turn, a half turn, or a mirror: no shorter way
        return (1 - t) * np.eye(3) + t * turn
    x, y, z = axis / length
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = float(np.arccos(cosine)) * t
    twice = np.einsum("ij,jk->ik", across, across)
    return np.eye(3) + np.sin(angle) * across + (1 - np.cos(angle)) * twice
