"""`CurveForm`: a few control points in metres, and the maps that make the curve's parts of them."""

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from evocity.forms.form import WALL, Form
from evocity.forms.lines import crosses_itself, leaves, strip

if TYPE_CHECKING:
    from evocity.shapes import Curve, Detailed

#: Points of the line that is measured and laid, about.
_FINE = 256
# Of the window's side, how far parts of a curve may gap.
_GAP = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveForm(Form):
    """Control ``points`` ``(n, 2)``, metres from the window's south-west corner, east and north,
    and ``maps`` ``(N, n, n)``, as `evocity.shapes.Curve` has them; and ``details``, complex
    ``(N**l, m)`` of level l as `evocity.shapes.Detailed` has them where parts share their ends,
    none for a curve that its maps draw alone. It is laid as a strip of a ``breadth`` in metres,
    ``lay`` metres high.

    Raises `evocity.shapes.ShapeError` for what is no curve.
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
            _ = self.detailed  # which says what is wrong with them

    @cached_property
    def curve(self) -> "Curve":
        from evocity.shapes import Curve  # who reads a run need not draw it

        with warnings.catch_warnings():  # what is not proved is told by `problem`
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
            "details": flat(self.details),
        }

    @cached_property
    def line(self) -> np.ndarray:
        """Points ``(k, 2)`` on it, metres: of at least 256 parts; those of its finest level, where
        it has details."""
        if self.details:
            return self.detailed.line()
        return self.curve.line(max(1, math.ceil(math.log(_FINE) / math.log(len(self.maps)))))

    @cached_property
    def detailed(self) -> "Detailed":
        """It with its details, none where it has none."""
        from evocity.shapes import Detailed

        return Detailed(self.curve, self.details, True)

    @cached_property
    def length(self) -> float:
        """Of the line, metres."""
        return float(np.sqrt((np.diff(self.line, axis=0) ** 2).sum(axis=1)).sum())

    @cached_property
    def problem(self) -> str | None:
        if not self.curve.contraction.proved:
            return "maps of a curve of which it is not proved that they contract"
        if self.curve.gap > _GAP * self.side:
            return f"a curve whose parts lie {self.curve.gap:.3g} m apart"
        if leaves(self.line, self.side):
            return "a curve that leaves the window"
        if crosses_itself(self.line):
            return "a curve that crosses itself"
        return None

    @cached_property
    def mask(self) -> np.ndarray:
        """Bool ``(pixels, pixels)``, rows from the north: where it is laid."""
        return strip(self.line, self.breadth, self.pixels, self.metres_per_pixel)

    def _heights(self) -> np.ndarray:
        return np.where(self.mask, np.float32(self.lay), np.float32(0))


def flat(details: tuple[np.ndarray, ...]) -> np.ndarray:
    """Details as float64: real and imaginary parts in turn, level after level."""
    if not details:
        return np.zeros(0)
    return np.concatenate([one.ravel() for one in details]).astype(np.complex128).view(np.float64)


def details_of(numbers: np.ndarray, points: int, maps: int, depth: int) -> tuple[np.ndarray, ...]:
    """The first ``depth`` levels in what `flat` made, for so many control points and maps. Raises
    ValueError where there are fewer."""
    left, found = np.ascontiguousarray(numbers, np.float64).view(np.complex128), []
    wide = (points - 1) * (maps - 1)
    for level in range(depth):
        count = wide * maps**level
        if left.size < count:
            raise ValueError("details of half a level")
        found.append(left[:count].reshape(-1, wide))
        left = left[count:]
    return tuple(found)


__all__ = ["CurveForm", "details_of", "flat"]
