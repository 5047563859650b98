"""Relocation: a group of lifs is moved or copied to another place of its city."""

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

_MODES, _SHAPES = ("move", "copy"), ("square", "buildings")
#: The least and the largest side of macro-blocks unless told, metres.
_SPAN = 32.0, 128.0


@dataclass(frozen=True)
class Relocation(Drafting):
    """Move or copy groups of lifs elsewhere (Marsault 2005 §4.2).

    A place is admissible if it is clear of the group's own, if what comes and what stands there
    differ by at most ``tolerance`` metres on average along the outline, and if they differ by
    more than ``change`` metres on average within. Domain blocks that lie wholly inside the
    group are carried along, and turned with it; others stay where they are.

    Parameters
    ----------
    mode : "move" exchanges the two places: what gives way stands where the group stood, and
        domain blocks inside either go along with it, also those that lifs elsewhere call.
        "copy" leaves the group where it is as well, and what gave way is lost.
    shape : "square" takes macro-blocks; "buildings" grows each over every building it would
        cut and the courts these enclose, and takes none beyond ``side_max``².
    side_min, side_max : sides of the macro-blocks, metres, drawn evenly; None for 32 and 128.
    size_min, size_max : the same in range blocks, 1 or more, of uniform pavements; deprecated.
    count : groups to relocate. One without an admissible place is drawn again, 63 times at
        most: see ``made["relocated"]``.
    tolerance : metres, at both places if they are exchanged; None for any.
    change : metres; 0 passes over only what would change nothing.
    choice : of so many admissible places, drawn at random, the group takes the one whose
        outline differs least.
    isometries : whether a group is laid turned or mirrored: for each place that is looked at one
        of the 8 isometries is drawn. Of two places that are exchanged, what gives way is turned
        back.
    repair, reach, domains : as in `PavementFusion`; what is meant to be laid is the parent's
        decoded map with the groups at their new places.
    """

    mode: str = "move"
    shape: str = "buildings"
    side_min: float | None = None
    side_max: float | None = None
    count: int = 2
    tolerance: float | None = 6.0
    change: float = 2.0
    choice: int = 60
    isometries: bool = False
    size_min: int | None = None
    size_max: int | None = None

    name = "relocation"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        return {
            "mode": (lambda mode: mode in _MODES, " or ".join(_MODES)),
            "shape": (lambda shape: shape in _SHAPES, " or ".join(_SHAPES)),
            **macro_block_checks(self, _SPAN[0]),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves = Rearrangement(parents[0], self.name)
        sizes = macro_block_sides(self, moves.grid, parents, *_SPAN)

        def draw() -> tuple[np.ndarray, np.ndarray]:
            group, corner = macro_block(moves.grid, *sizes, rng)
            if self.shape == "square":
                return group, corner
            return moves.grown(group, corner, sizes[1] ** 2)

        relocated = moves.rearrange(
            draw,
            self.count,
            rng,
            copied=self.mode == "copy",
            carried=True,
            turned=self.isometries,
            tolerance=self.tolerance,
            change=self.change,
            choice=self.choice,
        )
        return moves.draft({"mode": self.mode, "shape": self.shape, "relocated": relocated})
