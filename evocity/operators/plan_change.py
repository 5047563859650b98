"""Plan change: the first parent's plan gets an alley, a closed street, or another width."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.operators.face_filling import PlanDrafting
from evocity.operators.parameters import Check
from evocity.operators.plans.changed_child import change_plan
from evocity.operators.plans.changes import apply_changes, draw_change
from evocity.operators.plans.fill import DRAWS, LOSS, REPEATS, SLACK
from evocity.operators.plans.planned_child import PlannedChild

#: The kinds of changes of one plan.
STREET_KINDS = ("alley", "closing", "width")
#: Most changes of a birth; attempts for each of them.
_MOST_CHANGES, _TRIES = 12, 6


@dataclass(frozen=True)
class PlanChange(PlanDrafting):
    """Change streets in the first parent's plan, and place buildings in the changed faces.

    The operator draws the kind of each change from ``kinds``. The kind ``"alley"`` cuts a large
    face by an alley, 4 to 6 m wide, from street to street. The kind ``"closing"`` closes a street
    between two faces, at most 12 m wide. The kind ``"width"`` moves the outline of a lot (ground
    for buildings) by 2 to 4 m, on all sides or along one street. Streets stay connected, and no
    street ends in a face.

    A changed face keeps its buildings if they fit the new outline, which may cut the buildings. A
    changed face whose buildings do not fit gets buildings of source cities, as in `PlanFusion`. If
    no buildings fit a changed face, the operator undoes the change and draws another change. Faces
    with buildings that a condensation locks do not change. The child inherits the changed plan:
    ``made["plan"]`` lists the changes.

    In a search, the parents after the first are the source cities of the run.

    Parameters
    ----------
    kinds : kinds of changes that the operator may draw: any of ``"alley"``, ``"closing"`` and
        ``"width"``.
    changes : number of changes, 1…12.
    draws, slack, loss, repeats : rules for filling faces, as in `PlanFusion`.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: this operator comes from evocity.
    """

    kinds: Sequence[str] = STREET_KINDS
    changes: int = 1
    draws: int = DRAWS
    slack: float = SLACK
    loss: float = LOSS
    repeats: float = REPEATS

    name = "plan_change"
    parents = (1, None)

    def _checks(self) -> dict[str, Check]:
        return {
            **super()._checks(),
            "kinds": (
                lambda kinds: len(kinds) > 0 and set(kinds) <= set(STREET_KINDS),
                "a list of " + ", ".join(STREET_KINDS),
            ),
            "changes": (lambda count: 1 <= count <= _MOST_CHANGES, f"1…{_MOST_CHANGES}"),
        }

    def _change(self, child: PlannedChild, rng: np.random.Generator) -> int:
        faces = 0
        for _ in range(self.changes):
            for _ in range(_TRIES):
                kind = self.kinds[int(rng.integers(len(self.kinds)))]
                change = draw_change(kind, child.plan, rng)
                if change is None:
                    continue
                fill = self._filler(child, rng)
                new = apply_changes(child.plan, [change])
                fresh = change_plan(child, new, change, fill)
                faces += fresh
                if fresh:
                    break
        return faces


__all__ = ["STREET_KINDS", "PlanChange"]
