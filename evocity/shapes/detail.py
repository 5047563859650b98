"""`Detailed`: a line as a curve of few control points and details, level by level.

Source: Hnaidi, Guérin, Akkouche, *Insertion de détail dans des figures autosimilaires*, §3.3 and
§4.2; ../shared/SHAPES.md §5.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import setting, shown
from evocity.shapes.curve import MOST_POINTS, Curve
from evocity.shapes.filters import Filter, filters_of, interpolates, windows
from evocity.shapes.languages import ShapeError
from evocity.shapes.lines import line_of, resampled, tell_crossing

#: Chords shorter than this share of what they are measured by give no frame.
_TINY = 1e-3


@dataclass(frozen=True, eq=False)
class Detailed:
    """A polyline of the plane as a `Curve` and what it lacks at each level.

    Make one of a line by `Detailed.of`; `line` gives it back.

    curve : the control points and maps.
    details : complex ``(N**l, m)`` of level l, the coarsest first: of each polygon what its N parts
        are beside those that the maps make of it. They stand in the polygon's frame, from its first
        point to its last, so that they turn, move and grow with it. m = (n − 1)(N − 1) where
        polygons share their ends, else n (N − 1).
    shared : whether parts share their ends. Then the line has (n − 1) N**depth + 1 points, else
        n N**depth, each n of them in a polygon.

    Each polygon lies where it is nearest to the line that its parts draw without further details,
    by least squares over the points; where ends are shared, those of the whole line stay in place.
    Raises `ShapeError` if arrays do not go together.
    """

    curve: Curve
    details: tuple[np.ndarray, ...]
    shared: bool
    _filters: list[Filter] = field(init=False, repr=False)

    def __post_init__(self):
        points, parts = self.curve.points, len(self.curve)
        if points.shape[1] != 2:
            raise ShapeError("a curve in space", "one of the plane", "leave a coordinate out")
        if self.shared and not interpolates(self.curve.maps):
            raise _no_shared_ends()
        rows = (len(points) - int(self.shared)) * (parts - 1)
        check_depth(len(points), parts, len(self.details), self.shared)
        details = []
        for level, given in enumerate(self.details):
            one = np.array(given, np.complex128)
            if one.shape != (parts**level, rows) or not np.isfinite(one).all():
                raise ShapeError(
                    f"details of level {level} of shape {one.shape}, or not finite",
                    f"({parts**level}, {rows}) finite numbers",
                    "make them by Detailed.of",
                )
            one.setflags(write=False)
            details.append(one)
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
        """The analysis of a ``line`` ``(M, 2)`` by ``maps`` ``(N, n, n)``, as `Curve` has them.

        depth : number of levels; a line of another number of points is resampled at equal steps.
            Unless told its points are taken as they are, and must be as many as some depth has.
        shared : whether parts share their ends; unless told where the maps let them.

        Raises `ShapeError` as `line_of`, `Curve`, and for another number of points.
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
        """As `of`, of ``points`` ``(M, 2)`` that are as many as the depth has; they may lie at one
        place."""
        at, maps = np.array(points, np.float64), np.array(maps, np.float64)
        curve = Curve(np.zeros((maps.shape[-1] if maps.ndim else 0, 2)), maps)
        parts, size = maps.shape[:2]
        if shared and not interpolates(maps):
            raise _no_shared_ends()
        check_depth(size, parts, depth, shared)
        count = point_count(size, parts, depth, shared)
        if at.shape != (count, 2) or not np.isfinite(at).all():
            raise ShapeError(
                f"points of shape {at.shape}, or not finite", f"({count}, 2)", "give as many"
            )
        at = at[:, 0] + 1j * at[:, 1]
        levels = filters_of(maps, depth, shared)
        polygons, details = [], []
        for level in range(depth - 1, -1, -1):
            one, nodes = levels[level], parts**level
            found, rest = one.apart(at[windows(nodes, one.whole.shape[1], shared)])
            at = _sequence(found, shared)
            if shared:
                at = at + one.update(rest)
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
        """Of the ``points`` of all polygons at level ``kept``, from which on to the ``depth`` the
        maps draw alone."""
        maps = np.array(maps, np.float64)
        check_depth(maps.shape[1], len(maps), depth, shared)
        coarse = cls.analysed(points, maps, shared, kept)  # which says what is wrong with them
        at, size = coarse.points(kept).T, maps.shape[1]
        for level in range(kept, depth):
            polygons = at[:, windows(len(maps) ** level, size, shared)]
            parts = np.einsum("acn,knm->ackm", polygons, maps).reshape(2, -1, size)
            at = np.stack([_sequence(one, shared) for one in parts])
        return cls.analysed(at.T, maps, shared, depth).dropped(depth - kept)

    # -- what it is --------------------------------------------------------------------------

    @property
    def depth(self) -> int:
        """How many levels of details it has."""
        return len(self.details)

    @property
    def kept(self) -> int:
        """How many levels, the coarsest, are not dropped: below them there are no details."""
        with_some = [level for level, one in enumerate(self.details) if one.any()]
        return with_some[-1] + 1 if with_some else 0

    @property
    def amounts(self) -> np.ndarray:
        """How much detail there is at each level, float ``(depth,)``: the root of the mean square
        of its numbers, as shares of the chords of the polygons they stand in."""
        return np.array([np.sqrt((np.abs(one) ** 2).mean()) for one in self.details])

    def points(self, level: int) -> np.ndarray:
        """The control points of all polygons at a ``level`` (0…depth), float ``(M, 2)``."""
        if isinstance(level, bool) or not 0 <= level <= self.depth:
            raise ShapeError(setting("level", level), f"0…{self.depth}", "choose another")
        parts, size = len(self.curve), len(self.curve.points)
        at, frames = self.curve.points[:, 0] + 1j * self.curve.points[:, 1], None
        for number in range(level):
            one, nodes = self._filters[number], parts**number
            polygons = at[windows(nodes, size, self.shared)]
            frames = _frames(polygons, frames, parts)
            rest = self.details[number] * frames[:, None]
            if self.shared:
                polygons = (at - one.update(rest))[windows(nodes, size, True)]
            at = _sequence(one.together(polygons, rest), self.shared)
        return np.column_stack([at.real, at.imag])

    def line(self) -> np.ndarray:
        """The line, float ``(M, 2)``: the points of the finest level."""
        return self.points(self.depth)

    # -- what is made of it ------------------------------------------------------------------

    def dropped(self, levels: int) -> "Detailed":
        """Without the details of the finest ``levels``: what N**-levels of the numbers draw.

        Of all lines that maps make of so many polygons it lies nearest to this one, by least
        squares over the points; where ends are shared, among those with its ends.
        """
        self._check_levels(levels)
        keep = self.depth - levels
        return replace(self, details=self.details[:keep] + tuple(
            np.zeros_like(one) for one in self.details[keep:]
        ))  # fmt: skip

    def amplified(self, gain: float, levels: Iterable[int] | None = None) -> "Detailed":
        """With the details of ``levels`` (0 the coarsest; all unless told) ``gain`` times as
        large. The line may then cross itself: it warns where."""
        if not np.isfinite(gain):
            raise ShapeError(setting("gain", gain), "a finite number", "correct it")
        chosen = self._chosen(levels)
        details = tuple(
            one * gain if level in chosen else one for level, one in enumerate(self.details)
        )
        return self._told(replace(self, details=details), "the line with other details")

    def transferred(
        self, other: "Detailed", levels: int | None = None, gain: float = 1.0
    ) -> "Detailed":
        """With the details of an ``other`` line in the finest ``levels`` (all but the coarsest
        unless told), ``gain`` times as large: as they stand in the frames of its polygons, so they
        do in those of this one. How the other lies and how large it is does not matter.

        The other must have the same maps and depth; `recoded` gives it these. Where the line then
        crosses itself it warns. Raises `ShapeError` for others.
        """
        levels = max(self.depth - 1, 0) if levels is None else levels
        self._check_levels(levels)
        if not np.isfinite(gain):
            raise ShapeError(setting("gain", gain), "a finite number", "correct it")
        if (self.depth, self.shared) != (other.depth, other.shared) or not np.array_equal(
            self.curve.maps, other.curve.maps
        ):
            raise ShapeError(
                "details of other maps, or of another depth",
                "the same",
                "analyse the other line by these maps: other.recoded(this)",
            )
        keep = self.depth - levels
        details = self.details[:keep] + tuple(gain * one for one in other.details[keep:])
        return self._told(replace(self, details=details), "the line with the other's details")

    def recoded(self, like: "Detailed") -> "Detailed":
        """The same line by the maps of another, to its depth."""
        return Detailed.of(self.line(), like.curve.maps, like.depth, like.shared)

    def moved(self, points: ArrayLike) -> "Detailed":
        """The same details about other control points ``(n, 2)``."""
        return replace(self, curve=self.curve.moved(points))

    def _told(self, found: "Detailed", name: str) -> "Detailed":
        tell_crossing(_without_repeats(found.line()), name)
        return found

    def _check_levels(self, levels: int) -> None:
        if isinstance(levels, bool) or not 0 <= levels <= self.depth:
            raise ShapeError(
                setting("levels", levels), f"0…{self.depth}, the levels there are", "choose fewer"
            )

    def _chosen(self, levels: Iterable[int] | None) -> set[int]:
        chosen = set(range(self.depth)) if levels is None else set(levels)
        if not all(isinstance(one, int) and 0 <= one < self.depth for one in chosen):
            raise ShapeError(
                f"levels {shown(sorted(chosen))}", f"some of 0…{self.depth - 1}", "choose others"
            )
        return chosen


def point_count(size: int, parts: int, depth: int, shared: bool) -> int:
    """How many points a line has of ``size`` control points and ``depth`` levels of ``parts``."""
    return (size - int(shared)) * parts**depth + int(shared)


def check_depth(size: int, parts: int, depth: int, shared: bool) -> None:
    if (
        isinstance(depth, bool)
        or not 0 <= depth <= 64
        or point_count(size, parts, depth, shared) > MOST_POINTS // 10
    ):
        raise ShapeError(
            setting("depth", depth),
            f"so few levels that the line has {MOST_POINTS // 10} points",
            "lower it",
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
        f"a line of {count} points",
        f"{'(n - 1) N^depth + 1' if shared else 'n N^depth'} of them, n = {size}, N = {parts}: "
        f"for example {near}",
        f"resample it: {setting('depth', depth)}",
    )


def _sequence(polygons: np.ndarray, shared: bool) -> np.ndarray:
    """The points of polygons ``(c, n)`` one after another, shared ones once."""
    if not shared:
        return polygons.ravel()
    return np.append(polygons[:, :-1].ravel(), polygons[-1, -1])


def _frames(polygons: np.ndarray, above: np.ndarray | None, parts: int) -> np.ndarray:
    """The frame of each of ``polygons`` ``(c, n)``: from its first point to its last. Of a chord
    that is tiny the frame ``above``, ``parts`` times smaller; of a whole that is closed, from its
    first control point to the next one that lies elsewhere."""
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


def _no_shared_ends() -> ShapeError:
    return ShapeError(
        "parts that do not share their ends",
        "maps of which the first keeps the first point, the last the last, and each begins where "
        "the one before it ends",
        "leave shared= out",
    )


__all__ = ["Detailed", "check_depth", "point_count"]
