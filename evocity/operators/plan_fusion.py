"""Plan fusion: faces between the first parent's streets get buildings of source cities."""

from dataclasses import dataclass

import numpy as np

from evocity.operators.face_filling import PlanDrafting
from evocity.operators.plans.fill import DRAWS, LOSS, REPEATS, SLACK
from evocity.operators.plans.planned_child import PlannedChild


@dataclass(frozen=True)
class PlanFusion(PlanDrafting):
    """Keep the first parent's plan of streets, and fill some of its faces with buildings of source
    cities.

    The child inherits the plan, which is the plan of a source city (see
    `evocity.operators.plans.InheritedPlan`). A parent that has no plan, and looks like no source
    city, gets the plan of its own map; the child does not inherit this plan.

    Faces are drawn one after another; for each face, the operator draws a parent as the donor of
    buildings. The more built ground of a donor is missing on the map, the more often the operator
    draws this donor. If all faces are to be filled, the operator tries all donors for each face, in
    random order. The buildings come from the place of the donor's map that fits the face best (see
    `evocity.operators.plans.fill_face`). The operator turns the new buildings by any angle to the
    direction of the face's walls; their façades follow the outline of the face. A face keeps its
    buildings in three cases: nothing fits; the face is open; a condensation locks something in the
    face.

    Donors are the source cities among the parents after the first. In a search, all source cities
    of the run are parents. If the parents after the first include no source city, all of these
    parents are donors. If the first parent is the only parent, it is its own donor.

    Parameters
    ----------
    faces : number of faces to fill, 1 or more; None fills every face for which something fits. The
        genome's ``made["faces"]`` holds the number of filled faces, and ``made["genes"]`` holds
        face, source city, place, angle, mirror and scale of each filling. The entry
        ``made["plan"]`` holds the plan with the genes of all faces.
    share : share of the faces that may be filled, 0…1. If this share is more than ``faces`` faces,
        the operator fills the share.
    area_min : smallest area of the lot (ground for buildings) of a face to fill, m².
    halved_min : smallest area of a lot whose halves may have buildings from two places, m². If no
        place fits the whole lot, the operator tries a separate place for each half of the lot.
    draws : number of places in source cities that the operator tries for each face, 1 or more.
    slack : largest difference, 0…1, between the shares of a lot that the new and the old buildings
        cover.
    loss : largest loss of built ground along the outline of a lot (ground for buildings), as a
        share, 0…1.
    repeats : largest share, 0…1, of a face's new built ground that may repeat places of the source
        city already on the map.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: evocity's own operator. Marsault 2002 §6.1 wishes for operators that keep the identity
    of buildings.
    """

    faces: int | None = 2
    share: float = 0.0
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
        most = None if self.faces is None else max(self.faces, round(self.share * len(faces)))
        return self._fill(child, faces, rng, most, self.halved_min)
