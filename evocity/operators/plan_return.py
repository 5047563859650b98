"""Plan return: faces of a plan get their own buildings back."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.operators.face_filling import PlanDrafting
from evocity.operators.plans.fill import REPEATS
from evocity.operators.plans.planned_child import PlannedChild


@dataclass(frozen=True)
class PlanReturn(PlanDrafting):
    """Restore the original buildings in some faces of the first parent's plan.

    The restored buildings are those of the source city that the plan comes from, at their original
    places. The operator draws faces whose buildings come from elsewhere or have been edited. A face
    keeps its present buildings if its original buildings already stand elsewhere on the map. A
    parent without an inherited plan does not change.

    Parameters
    ----------
    faces : number of faces to restore, 1 or more; None restores all of them. The genome's
        ``made["faces"]`` holds the number of faces that changed.
    repeats : largest share, 0…1, of the original built ground of a face that may already stand
        elsewhere on the map.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: this operator comes from evocity.
    """

    faces: int | None = 2
    repeats: float = REPEATS

    name = "plan_return"
    parents = (1, None)
    needs_filled_faces: ClassVar[bool] = True

    def _change(self, child: PlannedChild, rng: np.random.Generator) -> int:
        changed = [face for face in child.faces(0).tolist() if child.foreign(face)]
        count = 0
        for face in rng.permutation(np.array(changed, np.int64)).tolist():
            if count == self.faces:
                break
            owner = child.owner(face)
            if owner is not None and child.repeated(face, owner) <= self.repeats:
                child.restore(face)
                count += 1
        return count


__all__ = ["PlanReturn"]
