"""Block exchange: two macro-blocks of one size change places."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.groups import Rearrangement, macro_block, macro_block_checks
from evocity.operators.parameters import check_parameters, repair_checks


@dataclass(frozen=True)
class BlockExchange(Drafting):
    """Exchange two macro-blocks of one size, gene by gene (Marsault 2002 §4.1).

    Two macro-blocks are admissible if they are clear of one another, if along the outlines of
    both what comes and what stands differ by at most ``tolerance`` metres on average, and if
    they differ by more than ``change`` metres on average within. Genes stay as they are: they
    call the domain blocks they called. (`Relocation` carries them along.)

    Parameters
    ----------
    size_min, size_max : sides of the macro-blocks, in range blocks, 1 or more; drawn evenly.
    count : exchanges. A macro-block without an admissible partner is drawn again, 63 times at
        most: see ``made["exchanged"]``.
    tolerance : metres; None for any.
    change : metres; 0 passes over only what would change nothing.
    choice : of so many admissible partners, drawn at random, a macro-block takes the one whose
        outline differs least.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the parent's
        decoded map with the macro-blocks exchanged.
    """

    size_min: int = 2
    size_max: int = 8
    count: int = 4
    tolerance: float | None = 6.0
    change: float = 2.0
    choice: int = 60
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    name = "block_exchange"
    parents = (1, 1)

    def __post_init__(self):
        check_parameters(self, {**macro_block_checks(self), **repair_checks()})

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves = Rearrangement(parents[0])
        exchanged = moves.rearrange(
            lambda: macro_block(moves.pavement, self.size_min, self.size_max, rng),
            self.count,
            rng,
            tolerance=self.tolerance,
            change=self.change,
            choice=self.choice,
        )
        return moves.draft({"exchanged": exchanged})
