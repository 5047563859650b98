"""Quarter fusion: one parent keeps its streets, its street blocks get the buildings of others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.grid import MOST, common_grid
from evocity.operators.parameters import Check
from evocity.operators.shares import TOLD, are_shares, shares_of
from evocity.operators.street_blocks import Filling


@dataclass(frozen=True)
class QuarterFusion(Drafting):
    """The first parent's streets, with buildings of the others in its street blocks.

    Street blocks are drawn one after another. Into each go the buildings of another parent from
    where they fit best, of all places and under all 8 isometries: much is built inside, little on
    the outline, façades stand where façades stood (`street_blocks.best_place`). The donor's built
    components that lie partly outside are left out whole, and what remains decides between the
    isometries. So no building is cut, neither the first parent's nor another's, and streets stay
    where they are. Lifs and their domain blocks are carried along. Where a component was left out,
    bare ground remains: the void's.

    A block keeps its buildings if too little would be built, if it is larger than the donor's
    map, or if something in it is locked (condensation).

    Parameters
    ----------
    fill : share of the map that gets the second parent's fabric, 0…1, or one share a parent (and
        one for the void, if it takes part), summing to 1; None for equal shares. What is reached
        is in ``made["fill_reached"]``.
    street_blocks : fill so many street blocks, whatever their area; ``fill`` then tells which
        parent's buildings how many of them get. None for as many as ``fill`` asks for.
    void : whether bare ground takes part as a last parent: squares in place of buildings.
    area_min : street blocks under this keep their buildings, m².
    spread : under each isometry four places are drawn of those whose score is within this of the
        best, and the best of all is taken once components that stick out are left out; 0 takes the
        best. Scores are shares of the block's area, at most 1.
    density : blocks that would have less than this share of what was built there before keep
        their buildings, 0 or more.
    facades : what it counts, in shares of the block's area, that all of the block's façades are
        built where they stood and nothing on the street before them, 0…10.
    repeats : by what share a built cell counts less whose stone stands elsewhere on the map
        already, 0…1; without it what fits anywhere would win in time.
    widened : metres by which a filled block gives way to the streets around it, rounded up to
        whole cells (the side of the finest range blocks).
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
    #: Bare ground without a stone may be laid.
    lays_void: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        return {"fill": (are_shares, TOLD), **filling_checks()}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless ``fill`` suits ``count`` parents (and the void)."""
        shares_of(self.name, self.fill, count, self.void)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        shares = shares_of(self.name, self.fill, len(parents), self.void)
        filling = Filling(
            parents,
            common_grid(self.name, parents, 0.0),
            spread=self.spread,
            density=self.density,
            facades=self.facades,
            repeats=self.repeats,
            widened=self.widened,
        )
        drawn = rng.permutation(filling.numbers(self.area_min))
        if self.street_blocks is None:
            filled = _by_area(filling, drawn, shares[1:], rng)
        else:
            filled = _by_number(filling, drawn, shares[1:], self.street_blocks, rng)
        reached = np.bincount(filling.given.ravel(), minlength=len(shares))
        made = {
            "fill": [round(float(share), 4) for share in shares],
            "fill_reached": [round(float(one), 4) for one in reached / filling.given.size],
            "street_blocks": filled,
        }
        return Draft(filling.genome(), filling.intended(), made)


def _by_area(filling: Filling, drawn, shares, rng: np.random.Generator) -> int:
    """Fill the street blocks ``drawn`` until each donor has its share of the map; how many."""
    left, filled = shares * filling.given.size, 0
    for number in drawn:
        donor = int(np.argmax(left))
        area = filling.host.area[number]
        # nearer to what is wanted than before
        if area < 2 * left[donor] and filling.fill(number, donor + 1, rng):
            left[donor] -= area
            filled += 1
    return filled


def _by_number(filling: Filling, drawn, shares, wanted: int, rng: np.random.Generator) -> int:
    """Fill ``wanted`` of the street blocks ``drawn``, of each donor its share; how many."""
    shares = shares / shares.sum() if shares.any() else np.full(shares.size, 1 / shares.size)
    given = np.zeros(shares.size)
    for number in drawn:
        if given.sum() >= wanted:
            break
        donor = int(np.argmax(shares * (given.sum() + 1) - given))
        given[donor] += filling.fill(number, donor + 1, rng)
    return int(given.sum())


def filling_checks() -> dict[str, Check]:
    """Checks of the parameters that quarter fusion and quarter refill share."""
    return {
        "street_blocks": (
            lambda count: count is None or 1 <= count <= MAX_SIDE**2,
            f"1…{MAX_SIDE**2}, or none",
        ),
        "area_min": (lambda area: 0 <= area <= MOST**2, f"0…{MOST**2:g} m²"),
        "spread": (lambda spread: 0 <= spread <= 1, "0…1"),
        "density": (lambda density: 0 <= density <= 100, "0…100"),
        "facades": (lambda worth: 0 <= worth <= 10, "0…10"),
        "repeats": (lambda share: 0 <= share <= 1, "0…1"),
        "widened": (lambda metres: 0 <= metres <= MOST, f"0…{MOST:g} m"),
    }
