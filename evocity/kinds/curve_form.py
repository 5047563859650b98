"""`CurveForm`: a curve as chromosome: control points in metres, maps of its parts, details."""

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from evocity.kinds.form import WALL, Form
from evocity.kinds.window_lines import crosses_itself, leaves_window, strip_mask

if TYPE_CHECKING:
    from evocity.shapes import Curve, Detailed

#: The approximate number of points of the line.
_FINE = 256
# The greatest gap between parts of a curve, as a share of the window's side.
_GAP = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveForm(Form):
    """Control ``points`` ``(n, 2)``, metres from the window's south-west corner, east and north,
    and ``maps`` ``(N, n, n)`` of `evocity.shapes.Curve`; and ``details``, complex ``(N**l, m)`` of
    level l, of `evocity.shapes.Detailed` with shared ends, or no details. Its map is a strip of a
    ``breadth`` in metres, ``lay`` metres high.

    Raises `evocity.shapes.ShapeError` for invalid points, maps or details.
    """

    kind: ClassVar[str] = "curve"
    points: np.ndarray
    maps: np.ndarray
    breadth: float
    lay: float = WALL
    details: tuple[np.ndarray, ...] = ()

    def __post_init__(self):
        for name in ("points", "maps"):
            object.__setattr__(self, name, getattr(self.curve, name))
        object.__setattr__(self, "details", tuple(self.details))
        if self.details:
            _ = self.detailed  # raises if they are invalid

    @cached_property
    def curve(self) -> "Curve":
        from evocity.shapes import Curve  # reading a run does not need it

        with warnings.catch_warnings():  # `problem` reports unproved contraction
            warnings.simplefilter("ignore")
            return Curve(self.points, self.maps)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        sizes = np.array([len(self.points), len(self.maps), len(self.details)], np.int16)
        laid = np.array([self.breadth, self.lay])
        return {
            "points": self.points.ravel(),
            "maps": self.maps.ravel(),
            "sizes": sizes,
            "laid": laid,
            "details": flatten_details(self.details),
        }

    @cached_property
    def line(self) -> np.ndarray:
        """Points ``(k, 2)`` on it, metres: of at least 256 parts, or of its finest level of
        details."""
        if self.details:
            return self.detailed.line()
        return self.curve.line(max(1, math.ceil(math.log(_FINE) / math.log(len(self.maps)))))

    @cached_property
    def detailed(self) -> "Detailed":
        """The curve with its details."""
        from evocity.shapes import Detailed

        return Detailed(self.curve, self.details, True)

    @cached_property
    def length(self) -> float:
        """Length of the line, metres."""
        return float(np.sqrt((np.diff(self.line, axis=0) ** 2).sum(axis=1)).sum())

    @cached_property
    def problem(self) -> str | None:
        if not self.curve.contraction.proved:
            return "a curve whose maps are not proved to contract"
        if self.curve.gap > _GAP * self.side:
            return f"a curve whose parts lie {self.curve.gap:.3g} m apart"
        if leaves_window(self.line, self.side):
            return "a curve that leaves the window"
        if crosses_itself(self.line):
            return "a curve that crosses itself"
        return None

    @cached_property
    def mask(self) -> np.ndarray:
        """Bool ``(pixels, pixels)``, rows from the north: its strip."""
        return strip_mask(self.line, self.breadth, self.pixels, self.metres_per_pixel)

    def _heights(self) -> np.ndarray:
        return np.where(self.mask, np.float32(self.lay), np.float32(0))


def flatten_details(details: tuple[np.ndarray, ...]) -> np.ndarray:
    """Flatten details to float64: real and imaginary parts in turn, level after level."""
    if not details:
        return np.zeros(0)
    numbers = np.concatenate([level.ravel() for level in details])
    return numbers.astype(np.complex128).view(np.float64)


def split_details(
    numbers: np.ndarray, points: int, maps: int, depth: int
) -> tuple[np.ndarray, ...]:
    """Split the first ``depth`` levels from numbers of `flatten_details`, for so many control
    points and maps. Raises ValueError for too few numbers."""
    left, levels = np.ascontiguousarray(numbers, np.float64).view(np.complex128), []
    wide = (points - 1) * (maps - 1)
    for level in range(depth):
        count = wide * maps**level
        if left.size < count:
            raise ValueError("details of half a level")
        levels.append(left[:count].reshape(-1, wide))
        left = left[count:]
    return tuple(levels)
