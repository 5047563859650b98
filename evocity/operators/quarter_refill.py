"""Quarter refill: single street blocks of one parent get other buildings."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check
from evocity.operators.quarter_fusion import filling_checks
from evocity.operators.street_blocks import Filling


@dataclass(frozen=True)
class QuarterRefill(Drafting):
    """Single street blocks of the first parent filled anew, from anywhere in any parent.

    Each street block that is drawn gets the buildings that fit it of a parent drawn for it: the
    first parent itself, from elsewhere on its map, or one of the others if there are any. In a
    search the source cities are among these. Else as in `QuarterFusion`, of which it is the
    mutation.

    Parameters
    ----------
    street_blocks : fill so many street blocks, 1 or more; fewer if no more can be filled. How
        many were is in ``made["street_blocks"]``, which parent's in ``made["filled_by"]``.
    area_min, spread, density, facades, repeats, widened : as in `QuarterFusion`.
    repair, reach, domains : as in `Drafting`.

    Source: ours, after the wish of Marsault 2002 §6.1 that operators keep the identity of
    buildings.
    """

    street_blocks: int = 3
    area_min: float = 300.0
    spread: float = 0.03
    density: float = 0.5
    facades: float = 0.25
    repeats: float = 0.65
    widened: float = 0.0

    name = "quarter_refill"
    parents = (1, None)
    #: Bare ground without a stone may be laid.
    lays_void: ClassVar[bool] = True
    #: In a search the source cities are further parents, so no stone is lost for good.
    takes_founders: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        return filling_checks()

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        filling = Filling(
            parents,
            common_grid(self.name, parents, 0.0),
            spread=self.spread,
            density=self.density,
            facades=self.facades,
            repeats=self.repeats,
            widened=self.widened,
        )
        filled_by = [0] * len(parents)
        for number in rng.permutation(filling.numbers(self.area_min)):
            if sum(filled_by) == self.street_blocks:
                break
            donor = int(rng.integers(len(parents)))
            filled_by[donor] += filling.fill(number, donor, rng)
        made = {"street_blocks": sum(filled_by), "filled_by": filled_by}
        return Draft(filling.genome(), filling.intended(), made)
