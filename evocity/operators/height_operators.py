"""Height scaling and height field: buildings or street blocks rise and fall by whole storeys."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.citymap import STOREY
from evocity.genome import Genome
from evocity.operators.building_heights import Heights, height_checks
from evocity.operators.crossover import Draft, Drafting
from evocity.operators.fields import DIGITS, MOST_SIDE, field_weights
from evocity.operators.parameters import SHARE, Check, at_fault

_WHAT = ("buildings", "quarters")
#: The largest factor.
_MOST_FACTOR = 10.0
#: The range of drawn factors.
_DRAWN = 0.625, 1.6


@dataclass(frozen=True)
class HeightScaling(Drafting):
    """Raise and lower buildings by whole storeys. So the search can change the floor space.

    The operator draws buildings, or street blocks with all their buildings (`street_blocks`), and a
    factor for each. The target of a building is its height times the factor. The building changes
    by the whole number of storeys that brings it nearest to this target. The highest changes by at
    least one storey.

    Roofs keep their shape, and buildings their footprint. No building falls below one storey, and
    neighbours of different height never become one building (`evocity.operators.storeys`). Crumbs,
    which are components under 24 m², stay. A building with a pixel locked by a condensation also
    stays, with its street block. If a drawn building or block cannot change, another is drawn in
    its place.

    Results in ``made`` include the number of changed buildings. The results ``raised`` and
    ``lowered`` are storeys summed over buildings: three buildings raised by two storeys each make
    6. The result ``fsi_change`` is the floor space gained per unit of ground.

    The operator fits σ and β of lifs that show, or call, changed buildings to the new heights. σ
    stays within its cap, and domain blocks stay. Collage repair then matches the blocks again that
    still differ too much.

    Parameters
    ----------
    what : "buildings", separated by gaps and steps (`CityMap.building_labels`), or "quarters",
        which are street blocks.
    share : share of the buildings, or of the street blocks, to draw, 0…1. At least one is drawn
        unless the share is 0. The genome's ``made["scaled"]`` holds the number that changed.
    factors : smallest and largest factor, 0.1…10. Factors are drawn evenly by their logarithm. (1,
        1.6) only raises buildings.
    storey : height of a storey, metres. The default 3 is also the storey of the measure ``fsi``.
    highest : largest height to which buildings rise, metres. The default is 50 m, where French law
        begins to call housing high-rise (Code de la construction, R146-3).
    repair, reach, domains : as in `Drafting`. The intended map is the parent's decoded map with the
        new heights.

    Source: this operator comes from evocity, not from the papers.
    """

    what: str = "quarters"
    share: float = 0.1
    factors: Sequence[float] = _DRAWN
    storey: float = STOREY
    highest: float = 50.0

    #: Walls rise above all nearby, which domain blocks cannot show.
    clears: ClassVar[bool] = True
    name = "height_scaling"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        factor = _MOST_FACTOR
        return {
            "what": (lambda what: what in _WHAT, " or ".join(_WHAT)),
            "share": SHARE,
            "factors": (
                lambda pair: len(pair) == 2 and 1 / factor <= pair[0] <= pair[1] <= factor,
                f"two numbers {1 / factor:g}…{factor:g}, the least and the largest",
            ),
            **height_checks(),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        (parent,) = parents
        heights = Heights(parent, self.storey, self.highest)
        groups = heights.groups(self.what, self.name)
        most = max(math.ceil(self.share), round(self.share * len(groups)))
        factors = np.exp(rng.uniform(*np.log(self.factors), len(groups)))
        scaled = 0
        for number in rng.permutation(len(groups)):
            if scaled == most:
                break
            if factors[number] == 1:
                continue
            changed = heights.scale(groups[number], factors[number])
            if changed:
                scaled += 1
        return heights.draft({"what": self.what, "scaled": scaled})


@dataclass(frozen=True)
class HeightField(Drafting):
    """Raise and lower street blocks by whole storeys, according to a field of factors.

    The field has ``side`` × ``side`` factors, interpolated smoothly by their logarithms. The factor
    of a street block is the mean of the field over the block. Each building of the block then has a
    target: its height times this factor. The building changes by the whole number of storeys that
    brings it nearest to its target. Changes below half a storey do not count. Factors of 1 return
    the parent.

    Buildings keep their footprints and the shape of their roofs. Locked buildings stay, as in
    `HeightScaling`. If the values are given, nothing is drawn, so an optimiser can search the best
    field (``evocity refine --way heights``).

    Parameters
    ----------
    side : number of factors along each side of the field, 1…64.
    values : factors of the field, 0.1…10, row by row from the north-west. None draws them within
        0.625…1.6, evenly by their logarithm. Only four digits count.
    storey, highest : as in `HeightScaling`.
    repair, reach, domains : as in `Drafting`.

    Results in ``made`` are the ``values``, the number of ``scaled`` street blocks, and the entries
    of `HeightScaling` for buildings and floor space.

    Source: this operator comes from evocity, not from the papers.
    """

    side: int = 4
    values: Sequence[float] | None = None
    storey: float = STOREY
    highest: float = 50.0

    clears: ClassVar[bool] = True
    name = "height_field"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        least, most = 1 / _MOST_FACTOR, _MOST_FACTOR
        return {
            "side": (lambda side: 1 <= side <= MOST_SIDE, f"1…{MOST_SIDE}"),
            "values": (
                lambda values: values is None or all(least <= value <= most for value in values),
                f"numbers of {least:g}…{most:g}, or none",
            ),
            **height_checks(),
        }

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless the number of ``values`` is right for the field."""
        size = self.side**2
        if self.values is not None and len(self.values) != size:
            fault = f"{len(self.values)} numbers", f"{size}, {self.side} × {self.side}"
            raise at_fault(self.name, {"values": fault})

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        (parent,) = parents
        self.check_count(1)
        values = self.values
        if values is None:
            values = np.exp(rng.uniform(*np.log(_DRAWN), self.side**2))
        values = np.round(np.asarray(values, float), DIGITS)
        heights = Heights(parent, self.storey, self.highest)
        groups = heights.groups("quarters", self.name)
        of = np.zeros(int(heights.labels.max(initial=0)) + 1, np.int64)
        for number, group in enumerate(groups, 1):
            of[group] = number
        numbers = np.arange(1, len(groups) + 1)
        weights = field_weights(of[heights.labels], numbers, self.side)
        scaled = 0
        for group, factor in zip(groups, np.exp((weights * np.log(values)).sum(1)), strict=True):
            scaled += heights.scale(group, float(factor), at_least_one=False)
        return heights.draft({"side": self.side, "values": values.tolist(), "scaled": scaled})
