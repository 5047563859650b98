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
    """Keep the first parent's streets, and fill its street blocks with buildings of other parents.

    Street blocks are drawn at random, one after another. Each street block takes buildings of
    another parent from the place where these buildings fit best, among all places and all 8
    isometries. A place fits well if it has much built ground inside the block, little along the
    block's outline, and façades where the block has façades (`street_blocks.best_place`). If a
    built component of the donor lies partly outside the block, the whole component is left out, so
    the child cuts no building. Bare ground replaces the buildings that are left out. A lifs and its
    domain block move together.

    A street block keeps its buildings in three cases: too little would be built; the block is
    larger than the donor's map; a condensation locks something in the block.

    Parameters
    ----------
    fill : share of the map that the second parent fills, 0…1, or a list with the share of each
        parent. The shares in a list add up to 1; with ``void``, the list ends with the share of
        bare ground. If ``fill`` is None, all parents have equal shares; ``made["fill_reached"]``
        holds the resulting shares.
    street_blocks : number of street blocks to fill, whatever their area; ``fill`` then gives the
        share of each parent in this number. If ``street_blocks`` is None, the operator fills as
        many blocks as ``fill`` demands.
    void : whether bare ground counts as an additional, last parent, so that open squares replace
        buildings.
    area_min : smallest area of a street block to fill, m².
    spread : largest difference between the best score and the score of a place that the operator
        draws, 0…1. The operator draws four places under each isometry, leaves out buildings that
        the block would cut, and takes the best of these places. If ``spread`` is 0, the operator
        takes the best place. The score of a place is counted as a share of the block's area.
    density : smallest area of the new buildings, as a share of the old buildings' area, 0 or more.
    facades : weight of façades in the score of a place, 0…10; only façades that replace old façades
        count, as a share of the block's area.
    repeats : discount on the score of a place for each built cell that the map already shows
        elsewhere, 0…1. Without the discount ``repeats``, fabric that fits everywhere would fill the
        whole map after some generations.
    widened : width by which a filled block widens the streets around it, metres, rounded up to
        whole cells. A cell is a square as large as the smallest range block.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: evocity's own operator. Marsault 2002 §6.1 wishes for operators that keep the identity
    of buildings.
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
    takes_turns: ClassVar[bool] = True
    parents = (2, None)
    lays_void: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        return {"fill": FILL, **filling_checks()}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless ``fill`` suits ``count`` parents and the parameter
        `void`."""
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
    """Refill a few street blocks of the first parent with buildings from any place of any parent.

    Each drawn street block gets the best fitting buildings of a parent that the operator draws at
    random. Buildings from the first parent come from another place on its map. In a search, the
    source cities are among the parents. The operator is a mutation that fills street blocks as
    `QuarterFusion` does.

    Parameters
    ----------
    street_blocks : number of street blocks to fill, 1 or more. The genome's
        ``made["street_blocks"]`` holds the number of filled blocks, and ``made["filled_by"]`` holds
        the number of blocks filled from each parent.
    area_min, spread, density, facades, repeats, widened : rules for filling street blocks, as in
        `QuarterFusion`.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    Source: evocity's own operator. Marsault 2002 §6.1 wishes for operators that keep the identity
    of buildings.
    """

    street_blocks: int = 3
    area_min: float = 300.0
    spread: float = 0.03
    density: float = 0.5
    facades: float = 0.25
    repeats: float = 0.65
    widened: float = 0.0

    name = "quarter_refill"
    takes_turns: ClassVar[bool] = True
    parents = (1, None)
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
