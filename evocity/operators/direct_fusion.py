"""Direct fusion: every lifs from any parent, the papers' baseline."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossover import Draft, Drafting, assemble, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import FILL, Check, fill_report, shares_of


@dataclass(frozen=True)
class DirectFusion(Drafting):
    """Draw each lifs from one of two or more parents, whatever its neighbours are (Marsault 2002
    §4.2).

    If the pavements are adaptive, each draw decides a cell of 16 m, with all lifs in it.

    Each gene is drawn separately, without regard to the content and the surroundings of its lifs.
    So the fabric crumbles. With ``repair`` None this is the papers' baseline, "very bad results".
    Repair keeps every block as it was, but cannot join blocks to buildings.

    Parameters
    ----------
    fill : share of the second of two parents, 0…1, or a share for each parent; these add up to 1.
        None gives equal shares. A share is the probability that a lifs comes from this parent;
        ``made["fill_reached"]`` holds the resulting shares. A share of 1 returns that parent.
    repair, reach, domains : as in `PavementFusion`. The intended map has the parents' decoded range
        blocks, each at its place.
    """

    fill: float | Sequence[float] | None = None

    name = "direct_fusion"
    parents = (2, None)

    def _checks(self) -> dict[str, Check]:
        return {"fill": FILL}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` if ``fill`` does not suit ``count`` parents."""
        shares_of(self.name, self.fill, count)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents, 16.0)
        shares = shares_of(self.name, self.fill, len(parents))
        ends = np.cumsum(shares) / shares.sum()
        owner = np.searchsorted(ends, rng.random(len(grid)), side="right")
        blocks = np.stack([grid.blocks(raw_heights(parent)) for parent in parents])
        stitched = grid.raster(blocks[owner, np.arange(owner.size)])
        return Draft(assemble(parents, owner, grid), stitched, fill_report(shares, owner))
