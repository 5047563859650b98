"""`Detailed`: a line as a curve of few control points and details, level by level.

Source: Hnaidi, Guérin, Akkouche, *Insertion de détail dans des figures autosimilaires*, §3.3 and
§4.2; ../shared/SHAPES.md §5.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from evocity.errors import setting, spell
from evocity.shapes.curve import MOST_POINTS, Curve
from evocity.shapes.filters import Filter, filters_of, interpolates, windows
from evocity.shapes.languages import ShapeError
from evocity.shapes.lines import line_of, resampled, warn_crossing

#: Chords shorter than this share of their reference give no frame.
_TINY = 1e-3


@dataclass(frozen=True, eq=False)
class Detailed:
    """A polyline of the plane as a `Curve` with details at each level.

    `Detailed.of` makes it from a line; `line` returns the line.

    curve : the control points and maps.
    details : for each level l, complex ``(N**l, m)``, the coarsest level first. A detail is the
        difference between a part of a polygon and the part that the maps make. Details are in the
        polygon's frame, from its first point to its last, so that they turn, move and grow with the
        polygon. If polygons share their ends, m = (n − 1)(N − 1), otherwise n (N − 1).
    shared : whether parts share their ends. If so, the line has (n − 1) N**depth + 1 points.
        Otherwise it has n N**depth, n in each polygon.

    Each polygon is the least-squares fit, over the points, to the line of its parts without finer
    details. If parts share their ends, the ends of the whole line stay in place. Raises
    `ShapeError` if the sizes of the arrays do not match.
    """

    curve: Curve
    details: tuple[np.ndarray, ...]
    shared: bool
    _filters: list[Filter] = field(init=False, repr=False)

    def __post_init__(self):
        points, parts = self.curve.points, len(self.curve)
        if points.shape[1] != 2:
            raise ShapeError(
                "the curve lies in space", "a curve of the plane", "leave one coordinate out"
            )
        if self.shared and not interpolates(self.curve.maps):
            raise _no_shared_ends()
        rows = (len(points) - int(self.shared)) * (parts - 1)
        check_depth(len(points), parts, len(self.details), self.shared)
        details = []
        for level, given in enumerate(self.details):
            own = np.array(given, np.complex128)
            if own.shape != (parts**level, rows) or not np.isfinite(own).all():
                raise ShapeError(
                    f"the details of level {level} have the shape {own.shape}, or are not finite",
                    f"({parts**level}, {rows}) finite numbers",
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

        depth : number of levels. A line with any other number of points than the depth needs is
            resampled at equal steps. None takes the depth that fits the line's own number of
            points.
        shared : whether parts share their ends. None: they share them if the maps allow it.

        Raises `ShapeError` as `line_of` and `Curve` do, and if no depth fits the number of points.
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
        """Analyse a line as `of` does, if its ``points`` ``(M, 2)`` already have the number that
        the depth needs. Points may coincide."""
        at, maps = np.array(points, np.float64), np.array(maps, np.float64)
        curve = Curve(np.zeros((maps.shape[-1] if maps.ndim else 0, 2)), maps)
        parts, size = maps.shape[:2]
        if shared and not interpolates(maps):
            raise _no_shared_ends()
        check_depth(size, parts, depth, shared)
        count = point_count(size, parts, depth, shared)
        if at.shape != (count, 2) or not np.isfinite(at).all():
            raise ShapeError(
                f"the points have the shape {at.shape}, or are not finite",
                f"({count}, 2) finite numbers",
                "give this number of points",
            )
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
        """Make a line from the ``points`` of all polygons at level ``kept``. Below this level, down
        to ``depth``, the maps draw without details."""
        maps = np.array(maps, np.float64)
        check_depth(maps.shape[1], len(maps), depth, shared)
        coarse = cls.analysed(points, maps, shared, kept)  # raises for invalid points
        at, size = coarse.points(kept).T, maps.shape[1]
        for level in range(kept, depth):
            polygons = at[:, windows(len(maps) ** level, size, shared)]
            parts = np.einsum("acn,knm->ackm", polygons, maps).reshape(2, -1, size)
            at = np.stack([_sequence(axis, shared) for axis in parts])
        return cls.analysed(at.T, maps, shared, depth).dropped(depth - kept)

    # -- properties and points
    # --------------------------------------------------------------------------

    @property
    def depth(self) -> int:
        """Number of levels of details."""
        return len(self.details)

    @property
    def kept(self) -> int:
        """Number of the coarsest levels with details; the finer levels have none, since they are
        dropped."""
        with_some = [level for level, own in enumerate(self.details) if own.any()]
        return with_some[-1] + 1 if with_some else 0

    @property
    def amounts(self) -> np.ndarray:
        """Amount of detail at each level, float ``(depth,)``. It is the root mean square of the
        level's details, as shares of the chords of their polygons."""
        return np.array([np.sqrt((np.abs(own) ** 2).mean()) for own in self.details])

    def points(self, level: int) -> np.ndarray:
        """Compute the control points of all polygons at a ``level`` (0…depth), float ``(M, 2)``."""
        if isinstance(level, bool) or not 0 <= level <= self.depth:
            raise ShapeError(setting("level", level), f"0…{self.depth}", "choose another")
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
        """Compute the line, float ``(M, 2)``: the points of the finest level."""
        return self.points(self.depth)

    # -- changes ------------------------------------------------------------------

    def dropped(self, levels: int) -> "Detailed":
        """Drop the details of the finest ``levels``. Then a share of N**-levels of the numbers
        remains.

        The result is the least-squares fit, over the points, among all lines that the maps make
        from the remaining polygons. If parts share their ends, the ends of the line stay in place.
        """
        self._check_levels(levels)
        keep = self.depth - levels
        return replace(self, details=self.details[:keep] + tuple(
            np.zeros_like(own) for own in self.details[keep:]
        ))  # fmt: skip

    def amplified(self, gain: float, levels: Iterable[int] | None = None) -> "Detailed":
        """Multiply the details of ``levels`` by ``gain``; 0 is the coarsest level, and all levels
        are the default. Warns, with the place, if the line then crosses itself."""
        if not np.isfinite(gain):
            raise ShapeError(setting("gain", gain), "a finite number", "correct it")
        chosen = self._check_chosen_levels(levels)
        details = tuple(
            own * gain if level in chosen else own for level, own in enumerate(self.details)
        )
        return self._warn_crossing(replace(self, details=details), "the line with other details")

    def transferred(
        self, other: "Detailed", levels: int | None = None, gain: float = 1.0
    ) -> "Detailed":
        """Replace details of this line by the details of the line ``other``, multiplied by
        ``gain``. The number ``levels`` counts the finest levels to replace; by default all but the
        coarsest. Details move from the frames of the other polygons to the frames of this line's
        polygons. So the other line's place and size do not matter.

        The other line must have the same maps and depth; `recoded` makes such a line. Otherwise the
        method raises `ShapeError`. Warns if the line then crosses itself.
        """
        levels = max(self.depth - 1, 0) if levels is None else levels
        self._check_levels(levels)
        if not np.isfinite(gain):
            raise ShapeError(setting("gain", gain), "a finite number", "correct it")
        if (self.depth, self.shared) != (other.depth, other.shared) or not np.array_equal(
            self.curve.maps, other.curve.maps
        ):
            raise ShapeError(
                "the other line has other maps, or another depth",
                "a line with the same maps and depth",
                "analyse the other line by these maps: other.recoded(this)",
            )
        keep = self.depth - levels
        details = self.details[:keep] + tuple(gain * own for own in other.details[keep:])
        return self._warn_crossing(
            replace(self, details=details), "the line with the other's details"
        )

    def recoded(self, like: "Detailed") -> "Detailed":
        """Analyse this line by the maps of the line ``like``, to the depth of ``like``."""
        return Detailed.of(self.line(), like.curve.maps, like.depth, like.shared)

    def moved(self, points: ArrayLike) -> "Detailed":
        """Keep the details, and put them on other control ``points`` ``(n, 2)``."""
        return replace(self, curve=self.curve.moved(points))

    def _warn_crossing(self, changed: "Detailed", name: str) -> "Detailed":
        warn_crossing(_without_repeats(changed.line()), name)
        return changed

    def _check_levels(self, levels: int) -> None:
        if isinstance(levels, bool) or not 0 <= levels <= self.depth:
            raise ShapeError(
                setting("levels", levels), f"0…{self.depth}, the number of levels", "choose fewer"
            )

    def _check_chosen_levels(self, levels: Iterable[int] | None) -> set[int]:
        chosen = set(range(self.depth)) if levels is None else set(levels)
        if not all(isinstance(level, int) and 0 <= level < self.depth for level in chosen):
            raise ShapeError(
                f"levels {spell(sorted(chosen))} do not all exist",
                f"levels from 0 to {self.depth - 1}",
                "choose other levels",
            )
        return chosen


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
            f"levels of a line of at most {MOST_POINTS // 10} points",
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
        f"a line of {count} points fits no depth",
        f"{'(n - 1) N^depth + 1' if shared else 'n N^depth'} points, n = {size}, N = {parts}: "
        f"for example {near}",
        f"resample the line by {setting('depth', depth)}",
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


def _no_shared_ends() -> ShapeError:
    return ShapeError(
        "the parts do not share their ends",
        "maps that keep the first and the last point, and begin where the previous map ends",
        "leave shared= out",
    )
