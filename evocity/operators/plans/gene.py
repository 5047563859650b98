"""The gene of a face: the city and the place whose buildings stand in the face."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.errors import MapError, setting
from evocity.isometries import AFFINE
from evocity.operators.plans.plan import Plan

#: The range of `FaceGene.scale`.
SCALES = (0.88, 1.15)


@dataclass(frozen=True)
class FaceGene:
    """The buildings in one face of a plan: their source city and place, and how they turn.

    face : number of the face in its plan, 1…n.
    source : name of the source city.
    row, column : place in the source city, px, for the centre of the face (`Plan.centre`).
    angle : turn of the buildings, radians from east towards south.
    mirror : whether the buildings are mirrored, east for west, before they turn.
    scale : size of the buildings on the ground, in units of their size in the source city. Heights
        do not change.
    axis : direction on the plan in which ``scale`` acts, radians from east towards south; None for
        all directions.
    lift : metres by which all buildings are higher than in the source city; may be negative.
    lowest, highest : range of the heights of whole buildings after the lift, metres. Lower and
        higher buildings take the limit. None for no limit.
    part : 0 for the whole lot, 1 or 2 for a half of it (`Lot.side`).
    """

    face: int
    source: str
    row: float
    column: float
    angle: float
    mirror: bool = False
    scale: float = 1.0
    axis: float | None = None
    lowest: float | None = None
    highest: float | None = None
    part: int = 0
    lift: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as JSON-able data; ``FaceGene(**data)`` is the same gene again."""
        return dict(vars(self))

    def offsets(self, down: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Turn offsets on the plan to offsets in the source city.

        down, along : offsets from the centre of the face, metres. Returns the offsets from the
        place in the source city, down and along, metres.
        """
        size = self.scale
        if self.axis is not None:
            size, way = 1.0, (math.sin(self.axis), math.cos(self.axis))
            more = (1 / self.scale - 1) * (way[0] * down + way[1] * along)
            down, along = down + more * way[0], along + more * way[1]
        cosine, sine = math.cos(self.angle) / size, math.sin(self.angle) / size
        turned = cosine * along + sine * down
        return cosine * down - sine * along, -turned if self.mirror else turned

    @property
    def stretch(self) -> float:
        """Area of the buildings on the ground, in units of their area in the source city."""
        return self.scale**2 if self.axis is None else self.scale

    def clamp(self, heights: np.ndarray) -> np.ndarray:
        """Bring the heights of buildings, metres, into the range of the gene; 0 is ground and
        stays."""
        if self.lowest is None and self.highest is None and not self.lift:
            return heights
        least = 0 if self.lowest is None else self.lowest
        most = math.inf if self.highest is None else self.highest
        kind = heights.dtype.type
        clamped = np.clip(heights + kind(self.lift), kind(least), kind(most))
        return np.where(heights > 0, clamped, heights)

    def nearest_isometry(self) -> int:
        """Find the isometry of the square that is nearest to the turn and mirror of the gene."""
        steps = np.array(self.offsets(*np.eye(2))).T
        return int((AFFINE[:, 2:] * steps.ravel()).sum(axis=1).argmax())

    def check(self, plan: Plan, source: CityMap) -> None:
        """Raise `MapError` unless the gene suits a plan and its source city."""
        if not 1 <= self.face <= len(plan):
            raise MapError(
                f"the gene belongs to face {self.face}, which this plan does not have",
                f"the number of a face of the plan, from 1 to {len(plan)}",
                "use the plan for which the gene was made",
            )
        height, width = source.shape
        if not (0 <= self.row <= height and 0 <= self.column <= width):
            raise MapError(
                f"the gene copies from row {self.row}, column {self.column} of {source.name}, "
                "outside the map",
                f"a row from 0 to {height}, and a column from 0 to {width}",
                "use the map of the source city for which the gene was made",
            )
        if not (math.isfinite(self.angle + self.lift) and 0 < self.scale < math.inf):
            raise MapError(
                f"the gene has invalid values: {setting('angle', self.angle)}, "
                f"{setting('scale', self.scale)}, {setting('lift', self.lift)}",
                "a finite angle, a scale above 0, and a finite lift",
                "correct the values of the gene",
            )
        if not (self.axis is None or math.isfinite(self.axis)) or self.part not in (0, 1, 2):
            raise MapError(
                f"the gene has {setting('axis', self.axis)}, {setting('part', self.part)}",
                "a finite axis or none, and the part 0, 1 or 2",
                "correct the gene",
            )
        least = 0.0 if self.lowest is None else self.lowest
        most = math.inf if self.highest is None else self.highest
        if not (0 <= least < math.inf and most > BUILT_ABOVE and least <= most):
            raise MapError(
                f"the gene has {setting('lowest', self.lowest)}, "
                f"{setting('highest', self.highest)}",
                f"0 ≤ lowest ≤ highest, highest above {BUILT_ABOVE:g} m, or none",
                "correct the gene",
            )


__all__ = ["SCALES", "FaceGene"]
