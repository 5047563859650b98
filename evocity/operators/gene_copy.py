"""Gene copy: a gene takes the place of another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.groups import Rearrangement, cells, corners, move_checks, square
from evocity.operators.parameters import check_parameters, repair_checks


@dataclass(frozen=True)
class GeneCopy(Drafting):
    """Copy genes to other places (Marsault 2002 §4.1).

    Lifs are copied in square groups, so that a change is as large as a building and not as
    small as a block. Genes stay as they are: a copy calls the domain block its model calls.

    A model is admissible if along the outline of its copy what comes and what stands differ by
    at most ``tolerance`` metres on average, and within by more than ``change`` metres.

    Parameters
    ----------
    rate : share of the groups that a copy replaces, 0…1. One without an admissible model stays:
        see ``made["copied"]``.
    group : side of a group, in range blocks; 1 copies lifs by lifs.
    tolerance : metres; None for any.
    change : metres; 0 passes over only what would change nothing.
    choice : of so many admissible models, drawn at random, the one whose outline differs least
        is copied.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the parent's
        decoded map with the groups copied.
    """

    rate: float = 0.05
    group: int = 4
    tolerance: float | None = 6.0
    change: float = 1.0
    choice: int = 8
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    name = "gene_copy"
    parents = (1, 1)

    def __post_init__(self):
        check_parameters(
            self,
            {
                "rate": (lambda rate: 0 <= rate <= 1, "0…1"),
                "group": (lambda side: 1 <= side <= MAX_SIDE, f"1…{MAX_SIDE} blocks"),
                **move_checks(),
                **repair_checks(),
            },
        )

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves = Rearrangement(parents[0])
        ends, side = cells(moves.pavement, self.group, rng)
        group = square(side)
        copied = 0
        for end in ends[rng.random(len(ends)) < self.rate]:
            starts = corners(moves.pavement, group, rng)
            found = moves.best(
                group,
                starts,
                end,
                tolerance=self.tolerance,
                change=self.change,
                choice=self.choice,
            )
            if found is not None:
                moves.copy(group, starts[found], end)
                copied += 1
        return moves.draft({"copied": copied})
