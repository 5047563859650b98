"""Plan storeys: buildings of a face get heights that the buildings around them have."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from evocity.coding.decoding_cache import decoded
from evocity.genome import Genome
from evocity.operators.building_heights import refit_lifs
from evocity.operators.crossover import Draft
from evocity.operators.face_filling import PlanDrafting
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check
from evocity.operators.plans.laying import lot_of
from evocity.operators.plans.planned_child import PlannedChild
from evocity.views.buildings import CRUMB

#: Percentiles of the heights nearby between which a building stays.
_BOUNDS = (5.0, 95.0)
#: Least change of a height, and least height of a building, metres.
_STEP, _LOWEST = 1.0, 3.0


@dataclass(frozen=True)
class PlanStoreys(PlanDrafting):
    """Adapt the heights of buildings in some faces to the buildings around them, so that no tower
    stands among houses.

    The operator compares each building of a face with the nearest buildings in other faces.
    Buildings above the 95th percentile of the nearest buildings' heights are lowered to this
    percentile. Buildings below the 5th percentile of these heights are raised to this percentile.
    In a face with a gene, all buildings have a common range of heights, which the gene records as
    ``lowest`` and ``highest``. A changed face without a gene counts as edited. Footprints and
    shapes of roofs do not change.

    Parameters
    ----------
    faces : number of faces to change, 1 or more; None changes all faces. The genome's
        ``made["faces"]`` holds the number of faces that changed, and ``made["buildings"]`` the
        number of buildings.
    near : number of the nearest buildings with which the operator compares a building, 1 or more.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: this operator comes from evocity.
    """

    faces: int | None = 2
    near: int = 20

    name = "plan_storeys"
    parents = (1, None)

    def _checks(self) -> dict[str, Check]:
        return {**super()._checks(), "near": (lambda count: 1 <= count <= 1000, "1…1000")}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        child = PlannedChild(parents, common_grid(self.name, parents, 0.0))
        heights = _Nearby(child, self.near)
        before, faces, buildings = child.intended.copy(), 0, 0
        for face in rng.permutation(child.faces(0)).tolist():
            if faces == self.faces:
                break
            changed = heights.change(face)
            faces, buildings = faces + (changed > 0), buildings + changed
        genome, step = parents[0], child.intended - before
        if step.any():
            attractor = decoded(genome).attractor
            genome = refit_lifs(genome, attractor, attractor + step)
        made = {"faces": faces, "buildings": buildings, **child.made()}
        return Draft(genome, child.intended, made)


class _Nearby:
    """The buildings of a child's first parent, and the heights of the buildings nearby."""

    def __init__(self, child: PlannedChild, near: int):
        self._child, self._near = child, near
        city = child.city(0)
        table = city.buildings
        self._labels, self._heights = table.labels, table.height
        middles = np.column_stack([table.y, table.x]) / city.metres_per_pixel
        # the face of a building is that of most of its pixels
        lots = child.plan.lots
        pairs = table.labels.ravel().astype(np.int64) * (len(child.plan) + 1) + lots.ravel()
        counts = np.bincount(pairs, minlength=(len(middles) + 1) * (len(child.plan) + 1))
        self._face = counts.reshape(len(middles) + 1, -1)[1:].argmax(axis=1)
        self._middles, self._large = middles, table.area >= CRUMB

    def change(self, face: int) -> int:
        """Bring the buildings of a ``face`` to the heights nearby; returns how many changed."""
        child = self._child
        own = np.flatnonzero((self._face == face) & self._large)
        others = np.flatnonzero((self._face != face) & self._large)
        if not own.size or not others.size:
            return 0
        tree = scipy.spatial.cKDTree(self._middles[others])
        _, nearest = tree.query(self._middles[own], k=min(self._near, others.size))
        around = self._heights[others][nearest.reshape(own.size, -1)]
        gene = child.genes.get(face) if face not in child.edited else None
        if gene is not None:
            around = np.broadcast_to(around.ravel(), (own.size, around.size))
        low, high = np.percentile(around, _BOUNDS, axis=1)
        low = np.maximum(low, _LOWEST)
        high = np.maximum(high, low)
        step = np.clip(self._heights[own], low, high) - self._heights[own]
        moved = np.abs(step) >= _STEP
        if not moved.any():
            return 0
        change = np.zeros(self._heights.size + 1, np.float32)
        change[own[moved] + 1] = step[moved]
        lot = lot_of(child.plan, face)
        here = child.intended[lot.window]
        add = np.where(lot.mask, change[self._labels[lot.window]], 0)
        here[add != 0] = np.maximum((here + add)[add != 0], _LOWEST)
        if gene is None:
            child.edited.add(face)
        else:
            lowest, highest = round(float(low[0]), 2), round(float(high[0]), 2)
            child.genes[face] = replace(gene, lowest=lowest, highest=highest)
        return int(np.count_nonzero(moved))


__all__ = ["PlanStoreys"]
