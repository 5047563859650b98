"""Gene exchange: two genes of a city change places."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.grid import in_cells, side_checks
from evocity.operators.groups import Rearrangement, cells, move_checks, square
from evocity.operators.parameters import Check


@dataclass(frozen=True)
class GeneExchange(Drafting):
    """Exchange genes two by two (Marsault 2002 §4.1).

    Lifs are exchanged in square groups, so that a change is as large as a building and not as
    small as a block; each takes part once at most. Genes stay as they are: they call the
    domain blocks they called.

    Two groups are admissible if along the outlines of both what comes and what stands differ by
    at most ``tolerance`` metres on average, and within by more than ``change`` metres.

    Parameters
    ----------
    rate : share of the groups that change places, 0…1. One without an admissible partner stays:
        see ``made["exchanged"]``, the number of groups that changed.
    group_side : side of a group, metres; None for 32.
    group : the same in range blocks, of uniform pavements; 1 exchanges lifs by lifs. Deprecated.
    tolerance : metres; None for any.
    change : metres; 0 passes over only what would change nothing.
    choice : of so many admissible partners, drawn at random, the one whose outline differs least
        is taken.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the parent's
        decoded map with the groups exchanged.
    """

    rate: float = 0.05
    group_side: float | None = None
    tolerance: float | None = 6.0
    change: float = 1.0
    choice: int = 8
    group: int | None = None

    name = "gene_exchange"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        return {
            "rate": (lambda rate: 0 <= rate <= 1, "0…1"),
            **side_checks(self, "group"),
            **move_checks(),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves = Rearrangement(parents[0], self.name)
        side = in_cells(self.name, "group", self.group_side, self.group, 32.0, moves.grid, parents)
        places, side = cells(moves.grid, side, rng)
        group = square(side)
        leads = rng.random(len(places)) < self.rate / 2
        free = ~leads
        for lead in places[leads]:
            partners = rng.permutation(np.flatnonzero(free))
            found = moves.best(
                group,
                lead,
                places[partners],
                exchanged=True,
                tolerance=self.tolerance,
                change=self.change,
                choice=self.choice,
            )
            if found is not None:
                free[partners[found]] = False
                moves.exchange(group, lead, places[partners[found]])
        exchanged = 2 * np.count_nonzero(~(free | leads))
        return moves.draft({"exchanged": int(exchanged)})
