"""Direct fusion: every lifs from any parent. The papers' baseline, which others must beat."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting, assembled, raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.parameters import Check
from evocity.operators.shares import TOLD, are_shares, shares_of


@dataclass(frozen=True)
class DirectFusion(Drafting):
    """Draw each lifs from two or more parents, whatever its neighbours are (Marsault 2002 §4.2).

    Among leaves it draws each cell of 16 m, with all lifs in it.

    Genes are drawn one by one, so fabric crumbles: neither what a lifs codes nor what stands
    around it is asked for. With ``repair`` None this is the papers' baseline, "very bad
    results"; repair keeps every block as it was, but cannot join them to buildings.

    Parameters
    ----------
    fill : share of the second of two parents, 0…1; or one share a parent, summing to 1; None
        for equal shares. It is the chance of each lifs; ``made["fill_reached"]`` tells what came
        of it. A share of 1 gives that parent back.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid are the parents'
        decoded range blocks, each at its place.
    """

    fill: float | Sequence[float] | None = None

    name = "direct_fusion"
    parents = (2, None)

    def _checks(self) -> dict[str, Check]:
        return {"fill": (are_shares, TOLD)}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless ``fill`` suits ``count`` parents."""
        shares_of(self.name, self.fill, count)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents, 16.0)
        shares = shares_of(self.name, self.fill, len(parents))
        ends = np.cumsum(shares) / shares.sum()
        owner = np.searchsorted(ends, rng.random(len(grid)), side="right")
        blocks = np.stack([grid.blocks(raw_heights(parent)) for parent in parents])
        stitched = grid.raster(blocks[owner, np.arange(owner.size)])
        reached = np.bincount(owner, minlength=len(parents)) / owner.size
        made = {
            "fill": [round(float(share), 4) for share in shares],
            "fill_reached": [round(float(share), 4) for share in reached],
        }
        return Draft(assembled(parents, owner, grid), stitched, made)
