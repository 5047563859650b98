"""Gene copy: a gene takes the place of another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.grid import in_cells, side_checks
from evocity.operators.groups import Rearrangement, cells, corners, move_checks, square
from evocity.operators.parameters import Check


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
    group_side : side of a group, metres; None for 32.
    group : the same in range blocks, of uniform pavements; 1 copies lifs by lifs. Deprecated.
    tolerance : metres; None for any.
    change : metres; 0 passes over only what would change nothing.
    choice : of so many admissible models, drawn at random, the one whose outline differs least
        is copied.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the parent's
        decoded map with the groups copied.
    """

    rate: float = 0.05
    group_side: float | None = None
    tolerance: float | None = 6.0
    change: float = 1.0
    choice: int = 8
    group: int | None = None

    name = "gene_copy"
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
        ends, side = cells(moves.grid, side, rng)
        group = square(side)
        copied = 0
        for end in ends[rng.random(len(ends)) < self.rate]:
            starts = corners(moves.grid, group, rng)
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
