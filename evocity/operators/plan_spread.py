"""Plan spread: faces take the source city, the place and the turn of a neighbouring face."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from evocity.operators.face_filling import PlanDrafting
from evocity.operators.plans.fill import DRAWS, LOSS, REPEATS, SLACK, fill_face
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.plan import Plan
from evocity.operators.plans.planned_child import PlannedChild


@dataclass(frozen=True)
class PlanSpread(PlanDrafting):
    """Fill faces with buildings that continue the buildings of a neighbouring face, so that a
    quarter looks uniform.

    The operator draws pairs of neighbouring faces. The first face of a pair has buildings of a
    source city. The second face of a pair gets the angle, mirror and scale of the first face. In
    the source city, the place of the second face continues the place of the first face. If this
    place does not fit the second face, the operator tries other places of the source city, with the
    same angle, mirror and scale. If no place fits a face, the face keeps its buildings, as in
    `PlanFusion`.

    Parameters
    ----------
    faces : number of faces to fill, 1 or more; None fills every face for which something fits. The
        genome's ``made["faces"]`` holds the number of faces that changed.
    area_min, draws, slack, loss, repeats : rules for filling faces, as in `PlanFusion`.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: this operator comes from evocity.
    """

    faces: int | None = 2
    area_min: float = 300.0
    draws: int = DRAWS
    slack: float = SLACK
    loss: float = LOSS
    repeats: float = REPEATS

    name = "plan_spread"
    parents = (1, None)
    needs_filled_faces: ClassVar[bool] = True

    def _change(self, child: PlannedChild, rng: np.random.Generator) -> int:
        pairs = child.plan.neighbours
        pairs = np.concatenate([pairs, pairs[:, ::-1]])
        free = set(child.faces(self.area_min).tolist())
        donors = {child.names[donor]: donor for donor in child.donors.tolist()}
        changed: set[int] = set()
        for first, second in rng.permutation(pairs).tolist():
            if len(changed) == self.faces:
                break
            gene = child.genes.get(first)
            if gene is None or first in child.edited or gene.source not in donors:
                continue
            if second not in free or second in changed:
                continue
            if alike(gene, child.genes.get(second)):
                continue
            donor = donors[gene.source]
            result = fill_face(
                child.plan, second, child.city(donor), rng, draws=self.draws, slack=self.slack,
                loss=self.loss, used=child.used(donor), repeats=self.repeats,
                name=gene.source, like=continue_gene(child.plan, gene, second),
            )  # fmt: skip
            if result is not None:
                child.lay(donor, *result)
                changed.add(second)
        return len(changed)


def alike(first: FaceGene, second: FaceGene | None) -> bool:
    """Tell whether two genes have one source city, angle, mirror and scale."""
    keys = ("source", "angle", "mirror", "scale", "axis")
    return second is not None and all(getattr(first, key) == getattr(second, key) for key in keys)


def continue_gene(plan: Plan, gene: FaceGene, face: int) -> FaceGene:
    """Return the gene of a ``face`` that continues the buildings of a ``gene`` without a seam."""
    pixel = plan.metres_per_pixel
    down, along = (plan.centre[face - 1] - plan.centre[gene.face - 1]) * pixel
    offsets = gene.offsets(down, along)
    row, column = gene.row + offsets[0] / pixel, gene.column + offsets[1] / pixel
    return replace(gene, face=face, row=float(row), column=float(column), part=0)


__all__ = ["PlanSpread", "alike", "continue_gene"]
