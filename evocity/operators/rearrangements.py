"""Operators that rearrange one parent: gene copy, gene exchange, block exchange, relocation."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from evocity.genome import Genome
from evocity.operators.crossover import Draft, Drafting
from evocity.operators.grid import in_cells, side_checks, span_checks
from evocity.operators.groups import (
    Rearrangement,
    cells,
    corners,
    macro_block,
    macro_block_sides,
    rule_checks,
    square,
)
from evocity.operators.parameters import SHARE, Check

_MODES, _SHAPES = ("move", "copy"), ("square", "buildings")
_COUNT: Check = (lambda count: 1 <= count <= 1000, "1…1000")
#: The default sides of macro-blocks, metres: least and largest.
_EXCHANGE_SPAN, _RELOCATION_SPAN = (16.0, 64.0), (32.0, 128.0)


@dataclass(frozen=True)
class _GeneMoves(Drafting):
    rate: float = 0.05
    group_side: float | None = None
    tolerance: float | None = 6.0
    change: float = 1.0
    choice: int = 8
    group: int | None = None

    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        return {"rate": SHARE, **side_checks(self, "group"), **rule_checks()}

    def _groups(self, parents, rng) -> tuple[Rearrangement, np.ndarray, np.ndarray]:
        """Lay a grid of groups on the parent: rearrangement, places ``(m, 2)``, cells of one."""
        moves = Rearrangement(parents[0], self.name)
        places, side = cells(moves.grid, in_cells(self, "group", 32.0, moves.grid, parents), rng)
        return moves, places, square(side)


@dataclass(frozen=True)
class GeneCopy(_GeneMoves):
    """Copy genes from one place of the genome to another (Marsault 2002 §4.2).

    Lifs are copied in square groups, so that a change is as large as a building. Genes do not
    change: a copied lifs reads the domain block that the original lifs reads.

    A group to copy, called a model, is admissible if it fits the surroundings of the copy. Along
    the outline, a model and the fabric that its copy replaces differ by at most ``tolerance``
    metres on average. Inside the outline, a model and the fabric that its copy replaces differ by
    more than ``change`` metres on average.

    Parameters
    ----------
    rate : share of all groups of lifs that copies replace, 0…1. A group of lifs stays unchanged if
        no admissible model can replace the group; ``made["copied"]`` holds the number of copies.
    group_side : side of a square group of lifs, metres; by default 32 m.
    group : side of a square group of lifs, counted in range blocks of equal size; 1 copies single
        lifs. Deprecated.
    tolerance : largest mean difference along the outline, metres; None allows any difference.
    change : lower limit of the mean difference between a copy and the fabric that the copy
        replaces, metres. If ``change`` is 0, the operator skips copies that change nothing.
    choice : number of admissible models that the operator draws before it chooses the best, 1 or
        more. Among the drawn models, the operator copies the model with the least difference along
        the outline.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map is the parent's decoded map with the groups copied.
    """

    name = "gene_copy"

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves, ends, group = self._groups(parents, rng)
        copied = 0
        for end in ends[rng.random(len(ends)) < self.rate]:
            starts = corners(moves.grid, group, rng)
            model = moves.find_move(group, starts, end, self)
            if model is not None:
                moves.copy(group, starts[model], end)
                copied += 1
        return moves.draft({"copied": copied})


@dataclass(frozen=True)
class GeneExchange(_GeneMoves):
    """Exchange genes in pairs (Marsault 2002 §4.1).

    Lifs are exchanged in square groups, so that a change is as large as a building. Each group is
    exchanged at most once. Genes do not change, so each lifs reads the domain block that it read
    before the exchange. Two groups are admissible partners if each group fits the surroundings of
    its partner, as in `GeneCopy`.

    Parameters
    ----------
    rate : share of the groups of lifs that change places, 0…1. A group without an admissible
        partner stays at its place; ``made["exchanged"]`` holds the number of groups that changed
        places.
    group_side : side of a square group of lifs, metres; by default 32 m.
    group : side of a square group of lifs, counted in range blocks of equal size; 1 exchanges
        single lifs. Deprecated.
    tolerance, change, choice : rules for the choice of partners; `GeneCopy` explains these three
        parameters.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map is the parent's decoded map with the groups exchanged.
    """

    name = "gene_exchange"

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves, places, group = self._groups(parents, rng)
        leads = rng.random(len(places)) < self.rate / 2
        free = ~leads
        for lead in places[leads]:
            partners = rng.permutation(np.flatnonzero(free))
            move = moves.find_move(group, lead, places[partners], self, exchanged=True)
            if move is not None:
                free[partners[move]] = False
                moves.exchange(group, lead, places[partners[move]])
        exchanged = 2 * np.count_nonzero(~(free | leads))
        return moves.draft({"exchanged": int(exchanged)})


@dataclass(frozen=True)
class BlockExchange(Drafting):
    """Exchange two macro-blocks of the same size, gene by gene (Marsault 2002 §4.2).

    Two macro-blocks are admissible partners if they do not overlap, and if each macro-block fits
    the surroundings of its partner, as in `GeneCopy`. Genes do not change, so each lifs reads the
    domain block that it read before the exchange. (The operator `Relocation`, in contrast, moves
    domain blocks together with the lifs that read them.)

    Parameters
    ----------
    side_min, side_max : smallest and largest side of macro-blocks, metres; sides are drawn evenly
        between these limits. By default, macro-blocks have sides from 16 m to 64 m.
    size_min, size_max : smallest and largest side of macro-blocks, counted in range blocks of equal
        size, 1 or more. Deprecated.
    count : number of exchanges, 1…1000. If a macro-block has no admissible partner, the operator
        draws another macro-block, at most 63 times; ``made["exchanged"]`` holds the number of
        exchanges.
    tolerance, change, choice : rules for the choice of partners; `GeneCopy` explains these three
        parameters.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map is the parent's decoded map with the macro-blocks exchanged.
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
        return {**span_checks(self, _EXCHANGE_SPAN[0]), "count": _COUNT, **rule_checks()}

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves = Rearrangement(parents[0], self.name)
        sizes = macro_block_sides(self, moves.grid, parents, *_EXCHANGE_SPAN)
        draw = partial(macro_block, moves.grid, *sizes, rng)
        return moves.draft({"exchanged": moves.rearrange(draw, self.count, rng, self)})


@dataclass(frozen=True)
class Relocation(Drafting):
    """Move or copy groups of lifs to new places (Marsault 2005 §4.2).

    A place is admissible if it does not overlap the group's old place, and if the group fits the
    surroundings of the new place, as in `GeneCopy`. Domain blocks wholly inside the group move and
    turn with the group; all other domain blocks stay.

    Parameters
    ----------
    mode : kind of relocation: "move" or "copy". With "move", the operator exchanges two places, so
        the replaced fabric goes to the group's old place. Domain blocks inside the two exchanged
        places move, even if lifs outside these places read them. With "copy", the group stays at
        its old place, and the replaced fabric is lost.
    shape : shape of the groups: "square" or "buildings". Square groups are macro-blocks. With
        "buildings", each macro-block is extended over every building that it would cut, and over
        the courts that these buildings enclose, up to the area ``side_max``².
    side_min, side_max : smallest and largest side of macro-blocks, metres; sides are drawn evenly
        between these limits. By default, macro-blocks have sides from 32 m to 128 m.
    size_min, size_max : smallest and largest side of macro-blocks, counted in range blocks of equal
        size, 1 or more. Deprecated.
    count : number of groups to relocate, 1…1000. If a group has no admissible place, the operator
        draws another group, at most 63 times; ``made["relocated"]`` holds the number of relocated
        groups.
    tolerance : largest mean difference along the outline, metres; None allows any difference. With
        "move", the limit ``tolerance`` holds at both places that the operator exchanges.
    change, choice : rules for the choice of new places; `GeneCopy` explains these two parameters.
    isometries : whether the operator turns and mirrors each group by one of the 8 isometries. The
        operator draws a random isometry for each new place. With "move", the inverse of the
        isometry turns the replaced fabric.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map is the parent's decoded map with the groups at their new places.
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
    takes_turns: ClassVar[bool] = True
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        return {
            "mode": (lambda mode: mode in _MODES, " or ".join(_MODES)),
            "shape": (lambda shape: shape in _SHAPES, " or ".join(_SHAPES)),
            **span_checks(self, _RELOCATION_SPAN[0]),
            "count": _COUNT,
            **rule_checks(),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        moves = Rearrangement(parents[0], self.name)
        sizes = macro_block_sides(self, moves.grid, parents, *_RELOCATION_SPAN)

        def draw() -> tuple[np.ndarray, np.ndarray]:
            group, corner = macro_block(moves.grid, *sizes, rng)
            if self.shape == "square":
                return group, corner
            return moves.grow_group(group, corner, sizes[1] ** 2)

        how = {"copied": self.mode == "copy", "carried": True, "turned": self.isometries}
        relocated = moves.rearrange(draw, self.count, rng, self, **how)
        return moves.draft({"mode": self.mode, "shape": self.shape, "relocated": relocated})
