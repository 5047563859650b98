"""Plan crossing: two parents with one plan exchange faces, one by one or by neighbourhoods."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.operators.face_filling import PlanDrafting
from evocity.operators.plans.fill import DRAWS, LOSS, REPEATS, SLACK
from evocity.operators.plans.plan import Plan
from evocity.operators.plans.planned_child import PlannedChild


@dataclass(frozen=True)
class PlanCrossing(PlanDrafting):
    """Exchange faces between two parents that have the same plan of streets.

    In the child, some faces of the second parent, with their lifs and genes, replace faces of the
    first parent. Only faces that differ between the parents count. The operator draws each face
    separately, or the drawn faces form a neighbourhood around a first face. A face of the second
    parent is not exchanged if the child already shows the same place of a source city elsewhere.
    The child of two equal parents equals its parents.

    Parents with different plans cannot exchange faces. If the plans differ, the operator fills
    faces as in `PlanFusion`, and draws donors according to their shares of the second parent's map.

    Parameters
    ----------
    share : share of the faces that come from the second parent, 0…1; it sets the chance of each
        face and the size of a neighbourhood.
    neighbourhood : chance that the exchanged faces form a neighbourhood, 0…1.
    faces : number of faces to fill if the plans differ, 1 or more; None fills every face for which
        something fits. The genome's ``made["faces"]`` holds the number of faces that changed.
    area_min, halved_min, draws, slack, loss, repeats : rules for filling faces, as in `PlanFusion`.
        The rule ``repeats`` applies both to filled faces and to exchanged faces.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: this operator comes from evocity.
    """

    share: float = 0.5
    neighbourhood: float = 0.4
    faces: int | None = 2
    area_min: float = 300.0
    halved_min: float = 1500.0
    draws: int = DRAWS
    slack: float = SLACK
    loss: float = LOSS
    repeats: float = REPEATS

    name = "plan_crossing"
    parents = (2, None)
    #: With the key ``mates`` of a recipe, a search chooses parents that have one plan.
    crosses_plans: ClassVar[bool] = True

    def _change(self, child: PlannedChild, rng: np.random.Generator) -> int:
        if child.states[1] is None:
            faces = rng.permutation(child.faces(self.area_min)).tolist()
            shares = child.shares(1)
            return self._fill(child, faces, rng, self.faces, self.halved_min, shares)
        differing = child.differing(1)
        if rng.random() < self.neighbourhood:
            chosen = grow_neighbourhood(child.plan, differing, self.share, rng)
        else:
            chosen = differing[rng.random(differing.size) < self.share].tolist()
        taken = 0
        for face in chosen:
            if child.repeated(face, 1) <= self.repeats:
                child.take(face, 1)
                taken += 1
        return taken


def grow_neighbourhood(
    plan: Plan, faces: Iterable[int] | np.ndarray, share: float, rng: np.random.Generator
) -> list[int]:
    """Grow a neighbourhood from one of the ``faces`` over their neighbours, until it has a
    ``share`` of them, but one at least. Returns its faces in the order of growth.

    The neighbourhood grows through other faces, too, and these do not count.
    """
    wanted = set(np.asarray(faces).tolist())
    most = max(1, round(share * len(wanted))) if share else 0
    if not wanted or not most:
        return []
    beside: dict[int, list[int]] = {}
    for first, second in plan.neighbours.tolist():
        beside.setdefault(first, []).append(second)
        beside.setdefault(second, []).append(first)
    ring = [sorted(wanted)[int(rng.integers(len(wanted)))]]
    seen = set(ring)
    chosen: list[int] = []
    while ring and len(chosen) < most:
        following: list[int] = []
        for face in rng.permutation(ring).tolist():
            if face in wanted and len(chosen) < most:
                chosen.append(face)
            fresh = [one for one in beside.get(face, ()) if one not in seen]
            seen.update(fresh)
            following += fresh
        ring = following
    return chosen


__all__ = ["PlanCrossing", "grow_neighbourhood"]
