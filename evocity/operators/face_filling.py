"""Base of operators that keep a plan: shared parameters, and buildings of donors in its faces."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.genome import Genome
from evocity.operators.crossover import Draft, Drafting
from evocity.operators.grid import common_grid
from evocity.operators.parameters import MOST_METRES, SHARE, Check
from evocity.operators.plans.fill import fill_face, fill_halves
from evocity.operators.plans.gene import FaceGene
from evocity.operators.plans.plan import Plan
from evocity.operators.plans.planned_child import PlannedChild
from evocity.operators.plans.rebuilding import Filler

#: Most candidates of a face.
_MOST_DRAWS = 100_000

#: The checks of parameters, by their names.
CHECKS: dict[str, Check] = {
    "faces": (
        lambda count: count is None or 1 <= count <= MAX_SIDE**2,
        f"1…{MAX_SIDE**2}, or none",
    ),
    "area_min": (lambda area: 0 <= area <= MOST_METRES**2, f"0…{MOST_METRES**2:g} m²"),
    "draws": (lambda count: 1 <= count <= _MOST_DRAWS, f"1…{_MOST_DRAWS}"),
    "halved_min": (lambda area: 0 <= area <= MOST_METRES**2, f"0…{MOST_METRES**2:g} m²"),
    "slack": SHARE,
    "loss": SHARE,
    "repeats": SHARE,
    "share": SHARE,
    "neighbourhood": SHARE,
}


@dataclass(frozen=True)
class PlanDrafting(Drafting):
    """Base class of operators that keep the first parent's plan and change faces of it.

    The children inherit the plan: see `evocity.operators.plans.InheritedPlan`. The method
    ``_change(child, rng)`` of a subclass changes faces of a `PlannedChild`, and returns their
    number.
    """

    name: ClassVar[str]
    parents: ClassVar[tuple[int, int | None]]

    reach: int | None = field(default=48, kw_only=True)

    lays_void: ClassVar[bool] = True
    clears: ClassVar[bool] = True
    #: In a search the source cities are further parents, so buildings are never copies of copies.
    takes_founders: ClassVar[bool] = True
    #: Turned buildings need domain blocks from farther away than codes of cities do.
    own_defaults: ClassVar[tuple[str, ...]] = ("reach",)

    def _checks(self) -> dict[str, Check]:
        return {key: check for key, check in CHECKS.items() if hasattr(self, key)}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents, 0.0)
        child = PlannedChild(parents, grid, self.parents[0] - 1)
        changed = self._change(child, rng)
        return Draft(child.genome(), child.intended, {"faces": changed, **child.made()})

    def _change(self, child: PlannedChild, rng: np.random.Generator) -> int:
        raise NotImplementedError

    def _fill(
        self,
        child: PlannedChild,
        faces: Iterable[int],
        rng: np.random.Generator,
        most: int | None,
        halved_min: float,
        preferred: np.ndarray | None = None,
    ) -> int:
        """Fill up to ``most`` of the ``faces`` with buildings of donors; None fills all that fit.
        A lot of ``halved_min`` m² or more may have halves from two places. Returns the number of
        filled faces."""
        filled = 0
        for face in faces:
            if filled == most:
                break
            donors = child.draw_donors(rng, preferred)
            # if all faces are wanted, no donor is left out
            donors = donors[: None if most is None else 1].tolist()
            if any(self._fill_whole(child, face, donor, rng) for donor in donors):
                filled += 1
            elif child.plan.lot_area[face - 1] >= halved_min:
                pair = donors[0], int(child.draw_donors(rng, preferred)[0])
                filled += self._fill_halves(child, face, pair, rng)
        return filled

    @property
    def _how(self) -> dict[str, Any]:
        return {key: getattr(self, key) for key in ("draws", "slack", "loss", "repeats")}

    def _fill_whole(self, child: PlannedChild, face: int, donor: int, rng) -> bool:
        result = fill_face(
            child.plan, face, child.city(donor), rng, used=child.used(donor),
            name=child.names[donor], **self._how,
        )  # fmt: skip
        if result is not None:
            child.lay(donor, *result)
        return result is not None

    def _fill_halves(self, child: PlannedChild, face: int, pair: tuple[int, int], rng) -> bool:
        cities, names = zip(*((child.city(n), child.names[n]) for n in pair), strict=True)
        used = [child.used(donor) for donor in pair]
        result = fill_halves(child.plan, face, cities, rng, used=used, names=names, **self._how)
        if result is not None:
            child.lay_halves(pair, result[0])
        return result is not None

    def _filler(self, child: PlannedChild, rng: np.random.Generator) -> Filler:
        """Make a search for buildings in a face of a changed plan, which tries all donors."""
        how = self._how

        def fill(plan: Plan, face: int) -> tuple[FaceGene, np.ndarray] | None:
            for donor in child.draw_donors(rng).tolist():
                result = fill_face(
                    plan, face, child.city(donor), rng, used=child.used(donor),
                    name=child.names[donor], **how,
                )  # fmt: skip
                if result is not None:
                    return result
            return None

        return fill
