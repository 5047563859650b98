"""Plan seam: the plans of two parents meet along a street from frame to frame."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossover import Draft
from evocity.operators.face_filling import PlanDrafting
from evocity.operators.grid import common_grid
from evocity.operators.plans.changed_child import (
    MOST_CHANGES,
    base_plans,
    change_plan,
    count_changes,
    second_plan,
)
from evocity.operators.plans.changes import apply_changes, draw_change
from evocity.operators.plans.fill import DRAWS, LOSS, REPEATS, SLACK
from evocity.operators.plans.planned_child import PlannedChild


@dataclass(frozen=True)
class PlanSeam(PlanDrafting):
    """Join the plans of two parents along a street of the first parent.

    The seam is a street from one edge of the map to another, at most 1.5 times as long as the
    distance between its ends. Beyond the seam, on 25 to 50 % of the ground, the child has the faces
    and the buildings that the second parent has there. The seam street cuts faces of the second
    parent, and the lots of these faces stay clear of the street. Small or narrow remainders of
    faces merge with a neighbouring face. Streets of the second parent end at the seam street, so no
    street is a dead end. If the second parent has the first parent's plan, or no inherited plan,
    the operator uses the plan of another source city.

    No place of a source city may stand on both sides of the seam. A face that would repeat a place
    from the other side gets different buildings that fit, or else the original buildings of its
    plan. If a place of a source city still stands on both sides, the child equals the first parent.

    Beyond the seam, a face whose buildings have been edited by other operators gets the original
    buildings of its source city. The child equals the first parent in two cases: no street can be
    the seam; a condensation locks something beyond the seam. The child inherits the joined plan:
    ``made["plan"]`` lists the seam.

    In a search, the source cities of the run are additional parents.

    Parameters
    ----------
    halved_min, draws, slack, loss, repeats : rules for filling faces, as in `PlanFusion`. The
        operator fills faces whose original buildings do not fit, or stand on the other side of the
        seam.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: this operator comes from evocity.
    """

    halved_min: float = 1500.0
    draws: int = DRAWS
    slack: float = SLACK
    loss: float = LOSS
    repeats: float = REPEATS

    name = "plan_seam"
    parents = (2, None)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents, 0.0)
        child = PlannedChild(parents, grid, 1)
        faces = self._join(child, rng)
        if faces and not self._fill_doubled(child, rng):
            child, faces = PlannedChild(parents, grid, 1), 0
        return Draft(child.genome(), child.intended, {"faces": faces, **child.made()})

    def _join(self, child: PlannedChild, rng: np.random.Generator) -> int:
        """Join the plan of a ``child`` with another plan; returns the number of new faces."""
        second = second_plan(child, rng)
        if second is None:
            return 0
        plan, state = second
        seam = draw_change("seam", child.plan, rng, {state.city: plan})
        if seam is None:
            return 0
        if state.changes:
            seam = {**seam, "changes": [dict(change) for change in state.changes]}
        if count_changes([seam]) > MOST_CHANGES:
            return 0
        new = apply_changes(child.plan, [seam], base_plans(child))
        return change_plan(child, new, seam, self._filler(child, rng), second)

    def _fill_doubled(self, child: PlannedChild, rng: np.random.Generator) -> bool:
        """Fill faces whose buildings stand on the other side of the seam, too, with others. Returns
        whether the faces that keep such buildings have at most ``repeats`` of the lots."""
        faces = rng.permutation(child.faces(0)).tolist()
        faces.sort(key=lambda face: not child.foreign(face))  # a city's own buildings stay
        for face in faces:
            repeats = child.doubled(face) > self.repeats
            if (
                repeats
                and not self._fill(child, [face], rng, None, self.halved_min)
                and child.foreign(face)
            ):
                child.restore(face)
        area = child.plan.lot_area
        doubled = sum(child.doubled(face) * area[face - 1] for face in faces)
        return bool(doubled <= self.repeats * area.sum())


__all__ = ["PlanSeam"]
