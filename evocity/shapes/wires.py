"""Wire forms: a segment replaced by a line, again and again; and one shape turning into another.

Source: Tosan, Excoffier, Rondet-Mignotte 2005, §3.1 and §3.2; Dubuc 1987; Prusinkiewicz & Sandness
1988; Bowman 1995 and Burch & Hart 1997 (metamorphosis).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evocity.errors import setting
from evocity.shapes.languages import ShapeError
from evocity.shapes.linear import polar
from evocity.shapes.shape import Shape


def wire(
    points: Sequence,
    arcs: Sequence[tuple[int, int]] | None = None,
    flipped: Sequence[bool] = (),
    **more: Any,
) -> Shape:
    """The form of a segment from (0, 0) to (1, 0) that is replaced by arcs between ``points``.

    points : float ``(n, 2)``, or n complex numbers.
    arcs : (start, end) of each by number, any graph; from each point to the next unless told.
    flipped : whether an arc's own form lies on its other side, one for each; none unless told.
    more : as of `Shape`; the primitive is the segment unless told.

    Each arc is a similarity; arcs that share a point go on sharing it, so the form hangs together
    as the graph does. Raises `ShapeError` for fewer than two points, for arcs between points that
    are not there, and for arcs so long that they do not contract.
    """
    given = np.asarray(points)
    at = given if np.iscomplexobj(given) else np.asarray(points, float)
    if not np.iscomplexobj(given):
        if at.ndim != 2 or at.shape[1] != 2:
            raise ShapeError(f"points of shape {at.shape}", "(n, 2)", "correct them")
        at = at[:, 0] + 1j * at[:, 1]
    count = len(at)
    if count < 2:
        raise ShapeError(f"{count} points", "two or more", "give another")
    pairs = [(k, k + 1) for k in range(count - 1)] if arcs is None else list(arcs)
    if not all(0 <= end < count for pair in pairs for end in pair):
        raise ShapeError(
            "an arc to a point that is not there", f"points 0…{count - 1}", "correct it"
        )
    mirrors = list(flipped) or [False] * len(pairs)
    if len(mirrors) != len(pairs):
        raise ShapeError(f"{len(mirrors)} flags for {len(pairs)} arcs", "one each", "correct them")
    maps = []
    for (start, end), mirror in zip(pairs, mirrors, strict=True):
        turn, sign = at[end] - at[start], -1.0 if mirror else 1.0
        maps.append([
            [turn.real, -turn.imag * sign, at[start].real],
            [turn.imag, turn.real * sign, at[start].imag],
        ])  # fmt: skip
    return Shape(np.array(maps), **{"primitive": "segment"} | more)


def hangs_together(shape: Shape) -> float:
    """How far apart, at most, one map of a wire form ends and the next begins: of the segment from
    (0, 0) to (1, 0). 0 for a line."""
    ends = shape.maps[:, :, 0] + shape.maps[:, :, 2]
    return float(np.sqrt(((ends[:-1] - shape.maps[1:, :, 2]) ** 2).sum(axis=1)).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Metamorphosis:
    """One shape turning into another: called with t of 0…1 it gives the shape in between.

    ``pairs``: which map of the one becomes which of the other. ``linear``: whether maps are
    interpolated as they are, which keeps what hangs together at both ends together in between;
    else rotations turn by the shorter way, and stretch and translation are interpolated.
    """

    first: Shape
    last: Shape
    pairs: tuple[tuple[int, int], ...]
    linear: bool

    def __call__(self, t: float) -> Shape:
        if not 0 <= t <= 1:
            raise ShapeError(setting("t", t), "a number of 0…1", "correct it")
        ones = self.first.maps[[one for one, _ in self.pairs]]
        others = self.last.maps[[other for _, other in self.pairs]]
        if self.linear:
            maps = (1 - t) * ones + t * others
        else:
            maps = np.stack([_between(a, b, t) for a, b in zip(ones, others, strict=True)])
        colours = None
        if self.first.colours is not None and self.last.colours is not None:
            early = self.first.colours[[one for one, _ in self.pairs]]
            colours = (1 - t) * early + t * self.last.colours[[other for _, other in self.pairs]]
        nearer = self.first if t < 0.5 else self.last
        return Shape(maps, nearer.primitive, None, colours, nearer.mix)


def metamorphosis(first: Shape, last: Shape, linear: bool | None = None) -> Metamorphosis:
    """What turns the ``first`` shape into the ``last``, both of the plane or both of space and of
    all words.

    ``linear``: see `Metamorphosis`; unless told, for two wire forms whose arcs follow each other
    without gaps. Of shapes with other numbers of maps the poorer one's last map is several of the
    other's: of a wire form it is shrunk to its end for all but the first of these, so that the line
    stays whole.

    Raises `ShapeError` for a plane one and one of space, and for restricted languages.
    """
    if first.size != last.size:
        raise ShapeError(
            "a shape of the plane and one of space", "two of the same", "choose another"
        )
    for one in (first, last):
        if one.language != type(one.language).every(len(one)):
            raise ShapeError("a shape of some words alone", "all words", "restrict it afterwards")
    joined = first.size == 2 and max(hangs_together(first), hangs_together(last)) < 1e-9
    if linear is None:
        linear = joined
    count = max(len(first), len(last))
    pairs = tuple((min(k, len(first) - 1), min(k, len(last) - 1)) for k in range(count))
    if linear and len(first) != len(last):
        first, last = (_lengthened(one, count) for one in (first, last))
        pairs = tuple((k, k) for k in range(count))
    return Metamorphosis(first, last, pairs, linear)


def _lengthened(shape: Shape, count: int) -> Shape:
    """With more maps, to the end of the last one."""
    end = shape.maps[-1, :, 0] + shape.maps[-1, :, 2]
    points = np.zeros((count - len(shape), 2, 3))
    points[:, :, 2] = end
    colours = None
    if shape.colours is not None:
        colours = np.vstack([shape.colours, np.repeat(shape.colours[-1:], len(points), axis=0)])
    return Shape(np.concatenate([shape.maps, points]), shape.primitive, None, colours, shape.mix)


def _between(a: np.ndarray, b: np.ndarray, t: float) -> np.ndarray:
    """A map between two: turns by the shorter way, stretches and translations linearly."""
    size = a.shape[0]
    (turn_a, stretch_a), (turn_b, stretch_b) = polar(a[:, :size]), polar(b[:, :size])
    stretch = (1 - t) * stretch_a + t * stretch_b
    back = np.einsum("ji,jk->ik", turn_a, turn_b)
    turn = np.einsum("ij,jk->ik", turn_a, _part_of(back, t))
    part = np.einsum("ij,jk->ik", turn, stretch)
    return np.column_stack([part, (1 - t) * a[:, size] + t * b[:, size]])


def _part_of(turn: np.ndarray, t: float) -> np.ndarray:
    """A rotation by a share ``t`` of the angle of ``turn``; of one that mirrors, its sign changes
    with the sine, so that halfway it is flat."""
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


__all__ = ["Metamorphosis", "hangs_together", "metamorphosis", "wire"]
