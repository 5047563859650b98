"""`Detailed`: a line as a curve of few control points and details, level by level.

Source: Hnaidi, Guérin, Akkouche, *Insertion de détail dans des figures autosimilaires*, §3.3 and
§4.2; ../shared/SHAPES.md §5.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import setting, spell
from evocity.shapes.checks import array_like, check_range
from evocity.shapes.curve import MOST_POINTS, Curve
from evocity.shapes.filters import Filter, filters_of, interpolates, windows
from evocity.shapes.languages import ShapeError
from evocity.shapes.lines import line_of, resampled, warn_crossing

#: Chords shorter than this share of their reference give no frame.
_TINY = 1e-3


@dataclass(frozen=True, eq=False)
class Detailed:
    """A polyline of the plane, stored as a `Curve` with details at each level of its division.

    The method `Detailed.of` makes a `Detailed` from a line, and the method `Detailed.line`
    returns the line.

    curve : the control points and maps of the curve.
    details : a complex array ``(N^l, m)`` for each level l, with m details for each of N^l
        polygons; the coarsest level comes first. A detail is the difference between a part of a
        polygon and the part that the maps compute. Details are relative to the vector from the
        polygon's first point to its last point. Details turn, move and grow together with their
        polygon. A polygon of n points and N maps has m = (n − 1)(N − 1) details if parts share
        their ends, and m = n (N − 1) details otherwise.
    shared : whether parts share their ends. A line of n control points and N maps has (n − 1)
        N^depth + 1 points if parts share their ends, and n N^depth points otherwise.

    Each polygon is a least-squares fit: without finer details, its line is as near as possible to
    the points of the given line. If parts share their ends, the ends of the whole line stay in
    place. Raises `ShapeError` if the sizes of the arrays do not match.
    """

    curve: Curve
    details: tuple[np.ndarray, ...]
    shared: bool
    _filters: list[Filter] = field(init=False, repr=False)

    def __post_init__(self):
        points, parts = self.curve.points, len(self.curve)
        if points.shape[1] != 2:
            raise ShapeError(
                "the curve is not two-dimensional",
                "a curve whose control points have two coordinates",
                "remove the third coordinate of each control point",
            )
        _check_shared(self.curve.maps, self.shared)
        rows = (len(points) - int(self.shared)) * (parts - 1)
        check_depth(len(points), parts, len(self.details), self.shared)
        details = []
        for level, given in enumerate(self.details):
            own = np.array(given, np.complex128)
            if own.shape != (parts**level, rows) or not np.isfinite(own).all():
                raise ShapeError(
                    f"the details of level {level} have the shape {own.shape}, or are not finite",
                    f"finite details of the shape ({parts**level}, {rows})",
                    "make the details with Detailed.of",
                )
            own.setflags(write=False)
            details.append(own)
        object.__setattr__(self, "details", tuple(details))
        filters = filters_of(self.curve.maps, self.depth, self.shared)
        object.__setattr__(self, "_filters", filters)

    @classmethod
    def of(
        cls,
        line: ArrayLike,
        maps: ArrayLike,
        depth: int | None = None,
        shared: bool | None = None,
    ) -> "Detailed":
        """Analyse a ``line`` ``(M, 2)`` into levels of details, by ``maps`` ``(N, n, n)`` as in
        `Curve`.

        depth : number of levels, or None for the depth that fits the line's number of points. If
            the number of points does not fit the given `depth`, the line is resampled at equal
            steps.
        shared : whether parts share their ends; None means shared ends if the maps allow them.

        Raises `ShapeError` if the line or the maps are invalid, or if no depth fits the number of
        points.
        """
        line, maps = line_of(line), np.array(maps, np.float64)
        if maps.ndim == 3 and len(maps) > 1 and maps.shape[1] > 1:
            parts, size = maps.shape[:2]
            shared = interpolates(maps) if shared is None else bool(shared)
            if depth is None:
                depth = _depth_for(len(line), parts, size, shared)
            check_depth(size, parts, depth, shared)
            count = point_count(size, parts, depth, shared)
            if len(line) != count:
                line = resampled(line, count)
        return cls.analysed(line, maps, bool(shared), depth or 0)

    @classmethod
    def analysed(cls, points: ArrayLike, maps: ArrayLike, shared: bool, depth: int) -> "Detailed":
        """Analyse a line of ``points`` ``(M, 2)``; the number M must suit the ``depth`` exactly.
        Unlike in the method `Detailed.of`, successive points of the line may coincide."""
        maps = np.array(maps, np.float64)
        curve = Curve(np.zeros((maps.shape[-1] if maps.ndim else 0, 2)), maps)
        parts, size = maps.shape[:2]
        _check_shared(maps, shared)
        check_depth(size, parts, depth, shared)
        count = point_count(size, parts, depth, shared)
        at = array_like(points, "points", f"({count}, 2)", lambda shape: shape == (count, 2))
        at = at[:, 0] + 1j * at[:, 1]
        levels = filters_of(maps, depth, shared)
        polygons, details = [], []
        for level in range(depth - 1, -1, -1):
            filter_, nodes = levels[level], parts**level
            coarse, rest = filter_.decompose(at[windows(nodes, filter_.whole.shape[1], shared)])
            at = _sequence(coarse, shared)
            if shared:
                at = at + filter_.update(rest)
            polygons.append(at[windows(nodes, size, shared)])
            details.append(rest)
        root = at[windows(1, size, shared)][0]
        frames = None
        framed = []
        for polygon, rest in zip(polygons[::-1], details[::-1], strict=True):
            frames = _frames(polygon, frames, parts)
            framed.append(rest / frames[:, None])
        return cls(curve.moved(np.column_stack([root.real, root.imag])), tuple(framed), shared)

    @classmethod
    def drawn(
        cls, points: ArrayLike, maps: ArrayLike, shared: bool, kept: int, depth: int
    ) -> "Detailed":
        """Make a line from the ``points`` of all polygons at the level ``kept``, the finest level
        with details. Below the level ``kept``, down to the level ``depth``, the maps draw the line
        without details."""
        maps = np.array(maps, np.float64)
        check_depth(maps.shape[1], len(maps), depth, shared)
        coarse = cls.analysed(points, maps, shared, kept)  # raises for invalid points
        at, size = coarse.points(kept).T, maps.shape[1]
        for level in range(kept, depth):
            polygons = at[:, windows(len(maps) ** level, size, shared)]
            parts = np.einsum("acn,knm->ackm", polygons, maps).reshape(2, -1, size)
            at = np.stack([_sequence(axis, shared) for axis in parts])
        return cls.analysed(at.T, maps, shared, depth).dropped(depth - kept)

    @property
    def depth(self) -> int:
        """Number of levels of details."""
        return len(self.details)

    @property
    def kept(self) -> int:
        """Number of the coarsest levels that keep their details; all finer levels have no
        details."""
        with_some = [level for level, own in enumerate(self.details) if own.any()]
        return with_some[-1] + 1 if with_some else 0

    @property
    def amounts(self) -> np.ndarray:
        """Amount of detail at each level, float ``(depth,)``: the root mean square of the level's
        details, each relative to the chord of its polygon."""
        return np.array([np.sqrt((np.abs(own) ** 2).mean()) for own in self.details])

    def points(self, level: int) -> np.ndarray:
        """Compute the control points of all polygons at a ``level`` (0…depth), float ``(M, 2)`` for
        M points."""
        check_range("level", level, 0, self.depth)
        parts, size = len(self.curve), len(self.curve.points)
        at, frames = self.curve.points[:, 0] + 1j * self.curve.points[:, 1], None
        for number in range(level):
            filter_, nodes = self._filters[number], parts**number
            polygons = at[windows(nodes, size, self.shared)]
            frames = _frames(polygons, frames, parts)
            rest = self.details[number] * frames[:, None]
            if self.shared:
                polygons = (at - filter_.update(rest))[windows(nodes, size, True)]
            at = _sequence(filter_.compose(polygons, rest), self.shared)
        return np.column_stack([at.real, at.imag])

    def line(self) -> np.ndarray:
        """Compute the line, float ``(M, 2)``: the M points of the finest level."""
        return self.points(self.depth)

    def dropped(self, levels: int) -> "Detailed":
        """Drop the details of the finest ``levels``; the share ``1 / N^levels`` of the numbers that
        store the line remains, with N the number of maps.

        Among all lines that the maps make from the remaining polygons, the result is the
        least-squares fit to the points of this line. If parts share their ends, the ends of the
        line stay in place.
        """
        check_range("levels", levels, 0, self.depth)
        keep = self.depth - levels
        nothing = tuple(np.zeros_like(own) for own in self.details[keep:])
        return replace(self, details=self.details[:keep] + nothing)

    def amplified(self, gain: float, levels: Iterable[int] | None = None) -> "Detailed":
        """Multiply the details of the given ``levels`` by the factor ``gain``. Level 0 is the
        coarsest level; by default the details of all levels change. If the changed line crosses
        itself, the method issues a warning that names the place."""
        _check_gain(gain)
        chosen = set(range(self.depth)) if levels is None else set(levels)
        if not all(isinstance(level, int) and 0 <= level < self.depth for level in chosen):
            raise ShapeError(
                f"the curve lacks some of the levels {spell(sorted(chosen))}",
                f"levels from 0 to {self.depth - 1}",
                "choose levels in this range",
            )
        details = tuple(
            own * gain if level in chosen else own for level, own in enumerate(self.details)
        )
        return self._warn_crossing(replace(self, details=details), "the line with other details")

    def transferred(
        self, other: "Detailed", levels: int | None = None, gain: float = 1.0
    ) -> "Detailed":
        """Replace details of this line by the details of another line, multiplied by ``gain``.

        levels : number of the finest levels to replace; by default all levels but the coarsest.
        gain : factor that multiplies the details that are transferred.

        Details are relative to their polygons, so the place and the size of the other line do not
        matter. Raises `ShapeError` unless both lines have the same maps and depth; the method
        `recoded` makes a line with the maps and the depth of another line. If the changed line
        crosses itself, the method issues a warning.
        """
        levels = max(self.depth - 1, 0) if levels is None else levels
        check_range("levels", levels, 0, self.depth)
        _check_gain(gain)
        if (self.depth, self.shared) != (other.depth, other.shared) or not np.array_equal(
            self.curve.maps, other.curve.maps
        ):
            raise ShapeError(
                "the two lines have different affine maps or different depths",
                "two lines with the same affine maps and the same depth",
                "analyse the other line with the affine maps of this line: other.recoded(this)",
            )
        keep = self.depth - levels
        details = self.details[:keep] + tuple(gain * own for own in other.details[keep:])
        return self._warn_crossing(
            replace(self, details=details), "the line with the other's details"
        )

    def recoded(self, like: "Detailed") -> "Detailed":
        """Analyse this line with the maps and the depth of another line, ``like``."""
        return Detailed.of(self.line(), like.curve.maps, like.depth, like.shared)

    def moved(self, points: ArrayLike) -> "Detailed":
        """Return a copy with the new control points ``(n, 2)`` and the same details."""
        return replace(self, curve=self.curve.moved(points))

    def _warn_crossing(self, changed: "Detailed", name: str) -> "Detailed":
        warn_crossing(_without_repeats(changed.line()), name)
        return changed


def point_count(size: int, parts: int, depth: int, shared: bool) -> int:
    """Count the points of a line of ``size`` control points and ``depth`` levels of ``parts``."""
    return (size - int(shared)) * parts**depth + int(shared)


def check_depth(size: int, parts: int, depth: int, shared: bool) -> None:
    """Raise `ShapeError` for a depth out of range, or a line of too many points."""
    if (
        isinstance(depth, bool)
        or not 0 <= depth <= 64
        or point_count(size, parts, depth, shared) > MOST_POINTS // 10
    ):
        raise ShapeError(
            setting("depth", depth),
            f"a number of levels with at most {MOST_POINTS // 10} points",
            "choose a smaller depth",
        )


def _depth_for(count: int, parts: int, size: int, shared: bool) -> int:
    for depth in range(65):
        found = point_count(size, parts, depth, shared)
        if found == count:
            return depth
        if found > count:
            break
    near = point_count(size, parts, depth, shared)
    raise ShapeError(
        f"a line of {count} points fits no depth",
        f"{'(n - 1) N^depth + 1' if shared else 'n N^depth'} points for n = {size} control points "
        f"and N = {parts} affine maps, for example {near}",
        f"resample the line to {near} points, and choose {setting('depth', depth)}",
    )


def _sequence(polygons: np.ndarray, shared: bool) -> np.ndarray:
    """List the points of polygons ``(c, n)`` one after another, shared points once."""
    if not shared:
        return polygons.ravel()
    return np.append(polygons[:, :-1].ravel(), polygons[-1, -1])


def _frames(polygons: np.ndarray, above: np.ndarray | None, parts: int) -> np.ndarray:
    """Compute the frame of each of ``polygons`` ``(c, n)``: from its first point to its last. A
    tiny chord has the frame ``above``, ``parts`` times smaller; a closed whole the vector from its
    first control point to the next one elsewhere."""
    chords = polygons[:, -1] - polygons[:, 0]
    if above is not None:
        instead = np.repeat(above, parts) / parts
    else:
        sides = polygons[0] - polygons[0, 0]
        far = np.abs(sides) > _TINY * np.abs(sides).max()
        instead = np.array([sides[far.argmax()] if far.any() else 1.0])
    return np.where(np.abs(chords) < _TINY * np.abs(instead), instead, chords)


def _without_repeats(line: np.ndarray) -> np.ndarray:
    moved = np.append(True, (line[1:] != line[:-1]).any(axis=1))
    return line[moved] if moved.sum() > 1 else line + np.arange(len(line))[:, None]


def _check_shared(maps: np.ndarray, shared: bool) -> None:
    if shared and not interpolates(maps):
        raise ShapeError(
            "neighbouring parts of the curve do not meet",
            "affine maps whose parts meet: each part begins where the part before it ends",
            "leave the parameter 'shared' out",
        )


def _check_gain(gain: float) -> None:
    if not np.isfinite(gain):
        raise ShapeError(setting("gain", gain), "a finite number", "choose a finite gain")
