"""Block exchange: two macro-blocks of one size change places."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.groups import (
    Rearrangement,
    macro_block,
    macro_block_checks,
    macro_block_sides,
)
from evocity.operators.parameters import Check

#: The least and the largest side of macro-blocks unless told, metres.
_SPAN = 16.0, 64.0


@dataclass(frozen=True)
class BlockExchange(Drafting):
    """Exchange two macro-blocks of one size, gene by gene (Marsault 2002 §4.1).

    Two macro-blocks are admissible if they are clear of one another, if along the outlines of
    both what comes and what stands differ by at most ``tolerance`` metres on average, and if
    they differ by more than ``change`` metres on average within. Genes stay as they are: they
    call the domain blocks they called. (`Relocation` carries them along.)

    Parameters
    ----------
    side_min, side_max : sides of the macro-blocks, metres, drawn evenly; None for 16 and 64.
    size_min, size_max : the same in range blocks, 1 or more, of uniform pavements; deprecated.
    count : exchanges. A macro-block without an admissible partner is drawn again, 63 times at
        most: see ``made["exchanged"]``.
    tolerance : metres; None for any.
    change : metres; 0 passes over only what would change nothing.
    choice : of so many admissible partners, drawn at random, a macro-block takes the one whose
        outline differs least.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the parent's
        decoded map with the macro-blocks exchanged.
    """

    side_min: float | None = None
    side_max: float | None = None
    count: int = 4
    tolerance: float | None = 6.0
    change: float = 2.0
    choice: int = 60
    size_min: int | None = None
    size_max: int | None = None

    name = "block_exchange"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        return macro_block_checks(self, _SPAN[0])

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves = Rearrangement(parents[0], self.name)
        sizes = macro_block_sides(self, moves.grid, parents, *_SPAN)
        exchanged = moves.rearrange(
            lambda: macro_block(moves.grid, *sizes, rng),
            self.count,
            rng,
            tolerance=self.tolerance,
            change=self.change,
            choice=self.choice,
        )
        return moves.draft({"exchanged": exchanged})
