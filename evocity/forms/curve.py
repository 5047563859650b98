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
    from evocity.shapes import Curve

#: Points of the line that is measured and laid, about.
_FINE = 256
# Of the window's side, how far parts of a curve may gap.
_GAP = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class CurveForm(Form):
    """Control ``points`` ``(n, 2)``, metres from the window's south-west corner, east and north,
    and ``maps`` ``(N, n, n)``, as `evocity.shapes.Curve` has them. It is laid as a strip of a
    ``breadth`` in metres, ``lay`` metres high.

    Raises `evocity.shapes.ShapeError` for what is no curve.
    """

    kind: ClassVar[str] = "curve"
    points: np.ndarray
    maps: np.ndarray
    breadth: float
    lay: float = WALL

    def __post_init__(self):
        for name in ("points", "maps"):
            object.__setattr__(self, name, getattr(self.curve, name))

    @cached_property
    def curve(self) -> "Curve":
        from evocity.shapes import Curve  # who reads a run need not draw it

        with warnings.catch_warnings():  # what is not proved is told by `problem`
            warnings.simplefilter("ignore")
            return Curve(self.points, self.maps)

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        sizes = np.array([len(self.points), len(self.maps)], np.int16)
        laid = np.array([self.breadth, self.lay])
        return {
            "points": self.points.ravel(),
            "maps": self.maps.ravel(),
            "sizes": sizes,
            "laid": laid,
        }

    @cached_property
    def line(self) -> np.ndarray:
        """Points ``(k, 2)`` on it, metres: at least 256 parts, where its maps are but 64."""
        return self.curve.line(max(1, math.ceil(math.log(_FINE) / math.log(len(self.maps)))))

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


__all__ = ["CurveForm"]
