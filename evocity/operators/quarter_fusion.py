"""Quarter fusion and quarter refill: street blocks of the first parent get other buildings."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.genome import Genome
from evocity.operators.crossover import Draft, Drafting
from evocity.operators.grid import common_grid
from evocity.operators.parameters import FILL, MOST_METRES, SHARE, Check, fill_report, shares_of
from evocity.operators.street_blocks import Filling


def filling_checks() -> dict[str, Check]:
    """Return the checks of the parameters that quarter fusion and quarter refill share."""
    return {
        "street_blocks": (
            lambda count: count is None or 1 <= count <= MAX_SIDE**2,
            f"1…{MAX_SIDE**2}, or none",
        ),
        "area_min": (lambda area: 0 <= area <= MOST_METRES**2, f"0…{MOST_METRES**2:g} m²"),
        "spread": SHARE,
        "density": (lambda density: 0 <= density <= 100, "0…100"),
        "facades": (lambda worth: 0 <= worth <= 10, "0…10"),
        "repeats": SHARE,
        "widened": (lambda metres: 0 <= metres <= MOST_METRES, f"0…{MOST_METRES:g} m"),
    }


def _begin_filling(operator, parents: Sequence[Genome]) -> Filling:
    keys = ("spread", "density", "facades", "repeats", "widened")
    how = {key: getattr(operator, key) for key in keys}
    return Filling(parents, common_grid(operator.name, parents, 0.0), **how)


@dataclass(frozen=True)
class QuarterFusion(Drafting):
    """Keep the first parent's streets, and fill its street blocks with buildings of the others.

    Street blocks are drawn one after another. Each gets the buildings of another parent from the
    place where they fit best, of all places and under all 8 isometries: much is built inside,
    little on the outline, façades stand where façades stood (`street_blocks.best_place`). The
    donor's built components that lie partly outside are left out whole, and the rest decides
    between the isometries. So the child cuts no building and keeps the streets. Lifs and their
    domain blocks move together. Bare ground, the void's, replaces omitted components.

    A block keeps its buildings if too little would be built, if it is larger than the donor's
    map, or if something in it is locked (condensation).

    Parameters
    ----------
    fill : share of the map that gets the second parent's fabric, 0…1, or a share for each parent
        (and the void, if it takes part), summing to 1; None for equal shares.
        ``made["fill_reached"]`` holds the resulting shares.
    street_blocks : number of street blocks to fill, whatever their area; ``fill`` then gives the
        parents' shares of them. None for as many as ``fill`` demands.
    void : whether bare ground takes part as a last parent: squares in place of buildings.
    area_min : smaller street blocks keep their buildings, m².
    spread : under each isometry four places are drawn among those whose score is within this of
        the best; the best of all after omission of partial components wins. 0 takes the best
        place. Scores are shares of the block's area, at most 1.
    density : a block keeps its buildings if the new ones would cover less than this share of the
        old ones' area, 0 or more.
    facades : the score, in shares of the block's area, of a block whose façades all stand at their
        old places with nothing on the street before them, 0…10.
    repeats : the discount of a built cell whose origin stands elsewhere on the map already, 0…1;
        without it, what fits everywhere would win in time.
    widened : metres that a filled block gives to the streets around it, rounded up to whole cells
        (the side of the finest range blocks).
    repair, reach, domains : as in `Drafting`.

    Source: ours, after the wish of Marsault 2002 §6.1 that operators keep the identity of
    buildings.
    """

    fill: float | Sequence[float] | None = None
    street_blocks: int | None = None
    void: bool = False
    area_min: float = 300.0
    spread: float = 0.03
    density: float = 0.5
    facades: float = 0.25
    repeats: float = 0.65
    widened: float = 0.0

    name = "quarter_fusion"
    parents = (2, None)
    #: Bare ground of the void may be laid.
    lays_void: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        return {"fill": FILL, **filling_checks()}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless ``fill`` suits ``count`` parents (and the void)."""
        shares_of(self.name, self.fill, count, self.void)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        shares = shares_of(self.name, self.fill, len(parents), self.void)
        filling = _begin_filling(self, parents)
        drawn = rng.permutation(filling.numbers(self.area_min))
        if self.street_blocks is None:
            count = _fill_by_area(filling, drawn, shares[1:], rng)
        else:
            count = _fill_by_number(filling, drawn, shares[1:], self.street_blocks, rng)
        made = {**fill_report(shares, filling.owner), "street_blocks": count}
        return Draft(filling.genome(), filling.intended(), made)


def _fill_by_area(filling: Filling, drawn, shares, rng: np.random.Generator) -> int:
    """Fill the street blocks ``drawn`` until each donor has its share of the map; count them."""
    left, count = shares * filling.owner.size, 0
    for number in drawn:
        donor = int(np.argmax(left))
        area = filling.host.area[number]
        # only if the share comes nearer to its goal
        if area < 2 * left[donor] and filling.fill(number, donor + 1, rng):
            left[donor] -= area
            count += 1
    return count


def _fill_by_number(filling: Filling, drawn, shares, count: int, rng: np.random.Generator) -> int:
    """Fill ``count`` of the street blocks ``drawn``, each donor by its share; count them."""
    shares = shares / shares.sum() if shares.any() else np.full(shares.size, 1 / shares.size)
    counts = np.zeros(shares.size)
    for number in drawn:
        if counts.sum() >= count:
            break
        donor = int(np.argmax(shares * (counts.sum() + 1) - counts))
        counts[donor] += filling.fill(number, donor + 1, rng)
    return int(counts.sum())


@dataclass(frozen=True)
class QuarterRefill(Drafting):
    """Fill single street blocks of the first parent again, from anywhere in any parent.

    Each drawn street block gets the best fitting buildings of a parent drawn for it: the first
    parent, from elsewhere on its map, or one of the others. In a search the source cities are among
    these. All else is as in `QuarterFusion`, whose mutation this is.

    Parameters
    ----------
    street_blocks : number of street blocks to fill, 1 or more, as far as possible.
        ``made["street_blocks"]`` holds the resulting number, ``made["filled_by"]`` the number for
        each parent.
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
    #: Bare ground of the void may be laid.
    lays_void: ClassVar[bool] = True
    #: In a search the source cities are further parents, so none of their fabric is lost for good.
    takes_founders: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        return filling_checks()

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        filling = _begin_filling(self, parents)
        filled_by = [0] * len(parents)
        for number in rng.permutation(filling.numbers(self.area_min)):
            if sum(filled_by) == self.street_blocks:
                break
            donor = int(rng.integers(len(parents)))
            filled_by[donor] += filling.fill(number, donor, rng)
        made = {"street_blocks": sum(filled_by), "filled_by": filled_by}
        return Draft(filling.genome(), filling.intended(), made)
