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
from evocity.operators.lambda_field import DIGITS, check_values, field_checks, field_weights
from evocity.operators.parameters import SHARE, Check

_WHAT = ("buildings", "quarters")
#: The largest factor.
_MOST_FACTOR = 10.0
#: The range of drawn factors.
_DRAWN = 0.625, 1.6


@dataclass(frozen=True)
class HeightScaling(Drafting):
    """Raise and lower buildings by whole storeys, so that the search can change the floor space.

    The operator draws buildings, or street blocks with all their buildings, and a factor for each
    drawn building or block. The target height of a building is its old height times the drawn
    factor. Each building changes by the whole number of storeys that brings its height nearest to
    the target. In each drawn block, the highest building changes by at least one storey.

    Roofs keep their shape, and buildings keep their footprint. No building falls below one storey,
    and neighbours of different height never become one building. Built components under 24 m² keep
    their heights. If a condensation locks a building, the building keeps its height; with
    "quarters", the whole street block keeps its heights. If a drawn building or block cannot
    change, the operator draws another building or block.

    The child's ``made`` holds the number of changed ``buildings``, and the storeys ``raised`` and
    ``lowered``, summed over buildings. The result ``fsi_change`` is the gain of floor space per
    unit of ground.

    The operator fits σ and β to the new heights in each lifs whose range block or domain block
    contains a changed building. Domain blocks stay. Collage repair finds new domain blocks for
    range blocks that still differ too much from the intended map.

    Parameters
    ----------
    what : objects to draw: "buildings", separated by gaps and steps (`CityMap.building_labels`), or
        "quarters", which are street blocks.
    share : share of the buildings, or of the street blocks, to draw, 0…1. The operator draws at
        least one building or block, unless the share is 0; ``made["scaled"]`` holds the number of
        changed buildings or blocks.
    factors : smallest and largest factor, 0.1…10. Factors are drawn evenly on a logarithmic scale.
        For example, the factors (1, 1.6) only raise buildings.
    storey : height of a storey, metres. By default, a storey is 3 m high, as in the measure
        ``fsi``.
    highest : largest height to which buildings rise, metres. By default, ``highest`` is 50 m, the
        height at which French law begins to call housing high-rise (Code de la construction,
        R146-3).
    repair, reach, domains : parameters of collage repair, as in `Drafting`. The intended map is the
        parent's decoded map with the new heights.

    Source: evocity's own operator, which is not in the papers.
    """

    what: str = "quarters"
    share: float = 0.1
    factors: Sequence[float] = _DRAWN
    storey: float = STOREY
    highest: float = 50.0

    #: Walls rise above all nearby, which domain blocks cannot show.
    clears: ClassVar[bool] = True
    keeps_streets: ClassVar[bool] = True
    name = "height_scaling"
    takes_turns: ClassVar[bool] = True
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

    The field has ``side`` × ``side`` factors, whose logarithms are interpolated smoothly. The
    factor of a street block is the mean of the field over the block. The target height of a
    building is its old height times the factor of the building's street block. Each building
    changes by the whole number of storeys that brings its height nearest to the target. A building
    keeps its height if this height differs from the target by less than half a storey. If all
    factors of the field are 1, the child equals the parent.

    Buildings keep their footprints and the shape of their roofs. Buildings that a condensation
    locks keep their heights, as in `HeightScaling`. If ``values`` are given, the operator draws
    nothing, so an optimiser can search the best field (``evocity refine --way heights``).

    Parameters
    ----------
    side : number of factors along each side of the field, 1…64.
    values : factors of the field, 0.1…10, row by row from the north-west, rounded to four digits.
        If ``values`` is None, the operator draws factors from 0.625 to 1.6, evenly on a logarithmic
        scale.
    storey, highest : height of a storey, and largest height of a roof, as in `HeightScaling`.
    repair, reach, domains : parameters of collage repair, as in `Drafting`.

    The child's ``made`` holds the entries ``values`` and ``scaled`` (the number of changed street
    blocks), and the entries of `HeightScaling` for buildings and floor space.

    Source: evocity's own operator, which is not in the papers.
    """

    side: int = 4
    values: Sequence[float] | None = None
    storey: float = STOREY
    highest: float = 50.0

    clears: ClassVar[bool] = True
    keeps_streets: ClassVar[bool] = True
    name = "height_field"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        return {**field_checks(1 / _MOST_FACTOR, _MOST_FACTOR), **height_checks()}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless the number of ``values`` is right for the field."""
        check_values(self)

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
