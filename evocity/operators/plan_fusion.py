"""Plan fusion: faces between the first parent's streets get buildings of source cities."""

from dataclasses import dataclass

import numpy as np

from evocity.operators.face_filling import PlanDrafting
from evocity.operators.plans.fill import DRAWS, LOSS, REPEATS, SLACK
from evocity.operators.plans.planned_child import PlannedChild


@dataclass(frozen=True)
class PlanFusion(PlanDrafting):
    """Keep the first parent's plan, and fill faces of it with buildings of source cities.

    The plan is inherited: it is that of a source city, and the child has it, too (see
    `evocity.operators.plans.InheritedPlan`). A parent without a plan that looks like no source city
    has the plan of its own map, which the child does not inherit.

    Faces are drawn one after another; for each face, one of the other parents is drawn as the donor
    of buildings. A donor with much built ground that is not on the map yet is drawn more often. If
    all faces are to be filled, the operator tries all donors for each face, in random order. The
    buildings come from the place of the donor's map that fits the face best (see
    `evocity.operators.plans.fill_face`). The new buildings turn by any angle to the direction of
    the face's walls, and their façades follow the outline of the face. A face keeps its buildings
    in three cases: nothing fits; the face is open; a condensation locks something in the face.

    Donors are the source cities among the other parents. In a search, all source cities of the run
    are parents. If only children stand among the other parents, they are the donors. Without other
    parents, the first parent is its own donor.

    Parameters
    ----------
    faces : number of faces to fill, 1 or more; None fills every face for which something fits. The
        genome's ``made["faces"]`` holds the number of filled faces, and ``made["genes"]`` holds
        face, source city, place, angle, mirror and scale of each filling. The entry
        ``made["plan"]`` holds the plan with the genes of all faces.
    area_min : smallest area of the lot (ground for buildings) of a face to fill, m².
    halved_min : smallest area of a lot whose halves may have buildings from two places, m². If no
        place fits the whole lot, the operator tries two places.
    draws : number of places in source cities that are tried for each face, 1 or more.
    slack : largest difference, 0…1, between the shares of a lot that the new and the old buildings
        cover.
    loss : largest loss of built ground along the outline of a face's ground for buildings, as a
        share, 0…1.
    repeats : largest share, 0…1, of a face's new built ground that comes from places in the source
        city which the map already shows.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: evocity's own operator. Marsault 2002 §6.1 wishes for operators that keep the identity
    of buildings.
    """

    faces: int | None = 2
    area_min: float = 300.0
    halved_min: float = 1500.0
    draws: int = DRAWS
    slack: float = SLACK
    loss: float = LOSS
    repeats: float = REPEATS

    name = "plan_fusion"
    parents = (1, None)

    def _change(self, child: PlannedChild, rng: np.random.Generator) -> int:
        faces = rng.permutation(child.faces(self.area_min)).tolist()
        return self._fill(child, faces, rng, self.faces, self.halved_min)
