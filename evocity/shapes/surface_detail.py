"""`DetailedSurface`: a height map as a surface of few control heights and details, level by level.

The construction is ours: the filters of `evocity.shapes.filters` along both axes of a grid.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evocity.errors import setting, spell
from evocity.shapes.checks import array_like, check_range
from evocity.shapes.detail import check_depth, point_count
from evocity.shapes.filters import Filter, filters_of, interpolates, windows
from evocity.shapes.languages import ShapeError
from evocity.shapes.surface import Surface

#: The most heights of a surface along an axis, and in total.
MOST_SIDE, MOST_HEIGHTS = 4097, 4_000_000


@dataclass(frozen=True, eq=False)
class DetailedSurface:
    """A height map, stored as a surface of few control heights with details on several levels.

    The method `DetailedSurface.of` makes a surface from heights. The method `heights` returns the
    heights.

    points : control heights, float ``(n, m)``, metres.
    rows, columns : maps along the axes, as in `Surface`; parts share their ends.
    details : for each level, the coarsest first, three arrays of metres: details along the first
        axis, along the second axis, and along both axes.
    spacing : distance between neighbouring heights of the finest level along both axes, metres.

    Without finer details, the rows and then the columns are least-squares fits to the given heights
    whose ends stay. Raises `ShapeError` if the sizes of the arrays do not match.
    """

    points: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    details: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]
    spacing: tuple[float, float] = (1.0, 1.0)
    _filters: tuple[list[Filter], list[Filter]] = field(init=False, repr=False)

    def __post_init__(self):
        points = array_like(self.points, "control heights", "(n, m)", lambda shape: len(shape) == 2)
        whole = Surface(points[:, :, None], self.rows, self.columns)
        for name, maps in (("rows", whole.rows), ("columns", whole.columns)):
            if not interpolates(maps):
                raise ShapeError(
                    f"neighbouring parts of the {name} do not meet",
                    "affine maps whose parts meet: each part begins where the part before it ends",
                    "use the maps of a Bézier surface, or of fit_surface",
                )
        spacing = tuple(float(side) for side in self.spacing)
        if len(spacing) != 2 or not all(0 < side < np.inf for side in spacing):
            raise ShapeError(
                setting("spacing", self.spacing), "two positive numbers of metres",
                "give the distance between heights along both axes",
            )  # fmt: skip
        _check_size(whole.rows, whole.columns, len(self.details))
        details = []
        for level, given in enumerate(self.details):
            sides = [_sides(maps, level) for maps in (whole.rows, whole.columns)]
            (down, more_down), (across, more_across) = sides
            shapes = [(more_down, across), (down, more_across), (more_down, more_across)]
            own = tuple(np.array(one, np.float64) for one in given)
            if [one.shape for one in own] != shapes or not all(np.isfinite(a).all() for a in own):
                raise ShapeError(
                    f"the details of level {level} do not fit the surface, or are not finite",
                    f"three arrays of finite numbers with the shapes {shapes}",
                    "make the details with DetailedSurface.of",
                )
            details.append(own)
        depth = len(details)
        filters = tuple(filters_of(maps, depth, True) for maps in (whole.rows, whole.columns))
        for name, value in (
            ("points", points),
            ("rows", whole.rows),
            ("columns", whole.columns),
            ("details", tuple(details)),
            ("spacing", spacing),
            ("_filters", filters),
        ):
            object.__setattr__(self, name, value)

    @classmethod
    def of(
        cls,
        heights: ArrayLike,
        rows: ArrayLike,
        columns: ArrayLike,
        depth: int,
        spacing: tuple[float, float] = (1.0, 1.0),
    ) -> "DetailedSurface":
        """Analyse ``heights`` ``(R, C)`` into ``depth`` levels of details by maps along the axes.

        If R and C do not fit the depth, the heights are resampled bilinearly, and their spacing
        changes so that the extent stays. Raises `ShapeError` for invalid heights or maps, and for
        heights with holes.
        """
        rows, columns = np.array(rows, np.float64), np.array(columns, np.float64)
        if rows.ndim != 3 or columns.ndim != 3:
            Surface(np.zeros((2, 2, 1)), rows, columns)  # raises for their shape
        _check_size(rows, columns, depth)
        at, spacing = resample_heights(
            heights, (_sides(rows, depth)[0], _sides(columns, depth)[0]), spacing
        )
        filters = [filters_of(maps, depth, True) for maps in (rows, columns)]
        details = []
        for level in range(depth - 1, -1, -1):
            down, across = filters[0][level], filters[1][level]
            low, high = _analyse(at, down, len(rows) ** level)
            at, along = _transposed(_analyse(low.T, across, len(columns) ** level))
            both = _transposed(_analyse(high.T, across, len(columns) ** level))
            details.append((both[0], along, both[1]))
        return cls(at, rows, columns, tuple(details[::-1]), spacing)

    @classmethod
    def drawn(
        cls,
        heights: ArrayLike,
        rows: ArrayLike,
        columns: ArrayLike,
        kept: int,
        depth: int,
        spacing: tuple[float, float] = (1.0, 1.0),
    ) -> "DetailedSurface":
        """Make a surface from the ``heights`` of the level ``kept``, the finest level with details.
        Below the level ``kept``, down to the level ``depth``, the maps draw the surface. The
        ``spacing`` is that of the finest level."""
        rows, columns = np.array(rows, np.float64), np.array(columns, np.float64)
        at = check_heights(heights)
        if rows.ndim != 3 or columns.ndim != 3:
            Surface(np.zeros((2, 2, 1)), rows, columns)  # raises for their shape
        cls(np.zeros((rows.shape[-1], columns.shape[-1])), rows, columns, ())  # raises for maps
        _check_size(rows, columns, depth)
        sides = _sides(rows, kept)[0], _sides(columns, kept)[0]
        if at.shape != sides:
            raise ShapeError(
                f"the heights have the shape {at.shape}",
                f"the heights of the level {kept}, of the shape {sides}",
                "give the heights that the method heights(level) returns",
            )
        for level in range(kept, depth):
            at = _draw(_draw(at, rows, level).T, columns, level).T
        return cls.of(at, rows, columns, depth, spacing).dropped(depth - kept)

    @property
    def depth(self) -> int:
        """Number of levels of details."""
        return len(self.details)

    @property
    def amounts(self) -> np.ndarray:
        """Root mean square of the details of each level, metres, ``(depth,)``."""
        each = [np.concatenate([one.ravel() for one in level]) for level in self.details]
        return np.array([np.sqrt((one**2).mean()) for one in each])

    @property
    def kept(self) -> int:
        """Number of levels from the coarsest on, of which the finest has details."""
        levels = [k + 1 for k, own in enumerate(self.details) if any(one.any() for one in own)]
        return max(levels, default=0)

    def heights(self, level: int | None = None) -> np.ndarray:
        """Compute the heights of a ``level``, float ``(R, C)``; None means the finest level."""
        level = self.depth if level is None else level
        check_range("level", level, 0, self.depth, whole=True)
        at = self.points
        for one in range(level):
            down, across = self._filters[0][one], self._filters[1][one]
            over, along, both = self.details[one]
            nodes = len(self.rows) ** one, len(self.columns) ** one
            low = _compose(at.T, along.T, across, nodes[1]).T
            high = _compose(over.T, both.T, across, nodes[1]).T
            at = _compose(low, high, down, nodes[0])
        return at

    def dropped(self, levels: int) -> "DetailedSurface":
        """Drop the details of the finest ``levels``."""
        check_range("levels", levels, 0, self.depth, whole=True)
        return self.amplified(0.0, range(self.depth - levels, self.depth))

    def amplified(self, gain: float, levels: Iterable[int] | None = None) -> "DetailedSurface":
        """Multiply the details of the given ``levels`` by the factor ``gain``. Level 0 is the
        coarsest level; by default the details of all levels change."""
        _check_gain(gain)
        chosen = set(range(self.depth)) if levels is None else set(levels)
        if not chosen <= set(range(self.depth)):
            raise ShapeError(
                f"the surface lacks some of the levels {spell(sorted(chosen))}",
                f"levels from 0 to {self.depth - 1}",
                "choose levels in this range",
            )
        details = tuple(
            _scaled(own, gain) if level in chosen else own for level, own in enumerate(self.details)
        )
        return replace(self, details=details)

    def transferred(
        self, other: "DetailedSurface", levels: int | None = None, gain: float = 1.0
    ) -> "DetailedSurface":
        """Replace the details of the finest ``levels`` by those of another surface, multiplied by
        ``gain``; by default the details of all levels but the coarsest.

        Details are relative to the size of the ground: details from a ground of twice the spacing
        become half as high. Raises `ShapeError` unless both surfaces have the same maps and depth;
        the method `recoded` makes such a surface.
        """
        levels = max(self.depth - 1, 0) if levels is None else levels
        check_range("levels", levels, 0, self.depth, whole=True)
        _check_gain(gain)
        if self.depth != other.depth or not (
            np.array_equal(self.rows, other.rows) and np.array_equal(self.columns, other.columns)
        ):
            raise ShapeError(
                "the two surfaces have different affine maps or different depths",
                "two surfaces with the same affine maps and the same depth",
                "analyse the other surface with the affine maps of this one: other.recoded(this)",
            )
        keep = self.depth - levels
        scale = gain * float(np.sqrt(np.prod(self.spacing) / np.prod(other.spacing)))
        details = tuple(_scaled(own, scale) for own in other.details[keep:])
        return replace(self, details=self.details[:keep] + details)

    def recoded(self, like: "DetailedSurface") -> "DetailedSurface":
        """Analyse this surface with the maps and the depth of another surface, ``like``."""
        return DetailedSurface.of(self.heights(), like.rows, like.columns, like.depth, self.spacing)

    def number_count(self, levels: int) -> int:
        """Count the numbers that store the surface without the finest ``levels``: its heights at
        that level, and the free numbers of the maps."""
        check_range("levels", levels, 0, self.depth, whole=True)
        sides = [_sides(maps, self.depth - levels)[0] for maps in (self.rows, self.columns)]
        free = [
            (len(m) * (m.shape[1] - 1) - 1) * (m.shape[1] - 1) for m in (self.rows, self.columns)
        ]
        return sides[0] * sides[1] + sum(free)


def check_heights(heights: ArrayLike, least: int = 2) -> np.ndarray:
    """Check a height map, float ``(R, C)``. Raises `ShapeError` for holes (NaN), and for fewer than
    ``least`` heights along an axis."""
    try:
        at = np.array(heights, np.float64)
    except (TypeError, ValueError):
        at = np.zeros(0)
    if at.ndim != 2 or min(at.shape) < max(2, least):
        raise ShapeError(
            f"the heights have the shape {at.shape}",
            f"an array (R, C) with at least {max(2, least)} heights along both axes",
            "give a larger height map, or choose fewer control points",
        )
    holes = int(np.count_nonzero(~np.isfinite(at)))
    if holes:
        raise ShapeError(
            f"the height map has holes: {holes} of {at.size} heights are missing",
            "a height map with a height everywhere",
            "fill the holes, for example with gdal_fillnodata, or choose a window without holes",
        )
    return at


def resample_heights(
    heights: ArrayLike, shape: tuple[int, int], spacing: tuple[float, float]
) -> tuple[np.ndarray, tuple[float, float]]:
    """Resample ``heights`` bilinearly to a ``shape``, and return their new ``spacing``; the corners
    stay in place."""
    at = check_heights(heights)
    for axis in (0, 1):
        count = at.shape[axis]
        if count != shape[axis]:
            places = np.linspace(0, count - 1, shape[axis])
            at = scipy.interpolate.interp1d(np.arange(count), at, axis=axis)(places)
            stretch = (count - 1) / (shape[axis] - 1)
            spacing = (
                spacing[0] * (stretch if axis == 0 else 1.0),
                spacing[1] * (stretch if axis == 1 else 1.0),
            )
    return at, spacing


def _sides(maps: np.ndarray, level: int) -> tuple[int, int]:
    """Count the heights along an axis at a ``level``, and the details of the level."""
    parts, size = maps.shape[:2]
    return point_count(size, parts, level, True), (size - 1) * (parts - 1) * parts**level


def _check_size(rows: np.ndarray, columns: np.ndarray, depth: int) -> None:
    for maps in (rows, columns):
        check_depth(maps.shape[1], len(maps), depth, True)
    check_sides(_sides(rows, depth)[0], _sides(columns, depth)[0])


def check_sides(down: int, across: int) -> None:
    """Raise `ShapeError` for a surface of too many heights."""
    if max(down, across) > MOST_SIDE or down * across > MOST_HEIGHTS:
        raise ShapeError(
            f"the surface would have {down} × {across} heights",
            f"at most {MOST_SIDE} heights along an axis, and {MOST_HEIGHTS} heights in total",
            "choose a smaller depth, or a smaller height map",
        )


def _analyse(at: np.ndarray, own: Filter, nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Decompose heights ``(R, C)`` along the first axis: coarser heights, and details."""
    parts = at[windows(nodes, own.whole.shape[1], True)]  # (nodes, K, C)
    count, width, lines = parts.shape
    flat = parts.transpose(0, 2, 1).reshape(-1, width)
    coarse, rest = (one.reshape(count, lines, -1).transpose(0, 2, 1) for one in own.decompose(flat))
    joined = np.concatenate([coarse[:, :-1].reshape(-1, lines), coarse[-1, -1:]])
    return joined + own.update(rest), rest.reshape(-1, lines)


def _compose(at: np.ndarray, rest: np.ndarray, own: Filter, nodes: int) -> np.ndarray:
    """Compose the heights that `_analyse` decomposed."""
    lines = at.shape[1]
    rest = rest.reshape(nodes, -1, lines)
    sequence = at - own.update(rest)
    polygons = sequence[windows(nodes, len(own.whole), True)]
    parts = np.einsum("cnx,nk->ckx", polygons, own.whole)
    parts += np.einsum("cmx,mk->ckx", rest, own.detail)
    return np.concatenate([parts[:, :-1].reshape(-1, lines), parts[-1, -1:]])


def _draw(at: np.ndarray, maps: np.ndarray, level: int) -> np.ndarray:
    """Draw the next finer level of heights ``(R, C)`` along the first axis without details."""
    polygons = at[windows(len(maps) ** level, maps.shape[1], True)]
    parts = np.einsum("cnx,knm->ckmx", polygons, maps)
    lines = parts.reshape(-1, *parts.shape[2:])
    return np.concatenate([lines[:, :-1].reshape(-1, at.shape[1]), lines[-1, -1:]])


def _transposed(pair: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return pair[0].T, pair[1].T


def _scaled(own, gain: float):
    return tuple(one * gain for one in own)


def _check_gain(gain: float) -> None:
    if not np.isfinite(gain):
        raise ShapeError(setting("gain", gain), "a finite number", "choose a finite gain")
