"""The gene of a face: the city and the place whose buildings stand in the face."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import MapError, setting, spell
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
    """

    face: int
    source: str
    row: float
    column: float
    angle: float
    mirror: bool = False
    scale: float = 1.0

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as JSON-able data; ``FaceGene(**data)`` is the same gene again."""
        return asdict(self)

    def offsets(self, down: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Turn offsets on the plan to offsets in the source city.

        down, along : offsets from the centre of the face, metres. Returns the offsets from the
        place in the source city, down and along, metres.
        """
        cosine, sine = math.cos(self.angle) / self.scale, math.sin(self.angle) / self.scale
        turned = cosine * along + sine * down
        return cosine * down - sine * along, -turned if self.mirror else turned

    def check(self, plan: Plan, source: CityMap) -> None:
        """Raise `MapError` unless the gene suits a plan and its source city."""
        if not 1 <= self.face <= len(plan):
            raise MapError(
                f"the gene names face {self.face}",
                f"a face of the plan, 1…{len(plan)}",
                "use the plan for which the gene was made",
            )
        height, width = source.shape
        if not (0 <= self.row <= height and 0 <= self.column <= width):
            raise MapError(
                f"the gene names the place {spell((self.row, self.column))} of {source.name}",
                f"a row of 0…{height} and a column of 0…{width}",
                "use the map of the source city for which the gene was made",
            )
        if not (math.isfinite(self.angle) and 0 < self.scale < math.inf):
            raise MapError(
                f"the gene has {setting('angle', self.angle)}, {setting('scale', self.scale)}",
                "a finite angle, and a scale above 0",
                "correct the gene",
            )


__all__ = ["SCALES", "FaceGene"]
