"""Height scaling: whole buildings, or all of a street block, rise or fall by whole storeys."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.citymap import STOREY
from evocity.genome import Genome
from evocity.operators.crossing import Draft, Drafting
from evocity.operators.heights import Heights, height_checks
from evocity.operators.parameters import Check

_WHAT = ("buildings", "quarters")
#: The largest factor.
MOST_FACTOR = 10.0


@dataclass(frozen=True)
class HeightScaling(Drafting):
    """Raise and lower buildings by whole storeys, so that floor space can be bred.

    Each building, or each street block with all its buildings (`street_blocks`), that is drawn
    gets a factor. Every building of it then changes by the whole number of storeys that brings it
    nearest to its height times the factor; the highest changes by one at least. Roofs keep
    their shape. A building keeps its footprint too: it is no lower than a storey, and nowhere does
    a wall between two buildings shrink until they are one (`evocity.operators.storeys`). Crumbs,
    components under 24 m², stay. So does a building of which a pixel is locked (condensation), and
    a street block with such a building. What cannot change is passed over for another.

    ``made`` tells how many ``buildings`` changed; ``raised`` and ``lowered``, storeys summed over
    buildings (three raised by two storeys each make 6); and ``fsi_change``, the floor space gained
    for each unit of ground.

    σ and β of the lifs that show, or call, what has changed are fitted to the new heights, σ
    within its cap; domain blocks stay, and collage repair matches again what then strays.

    Parameters
    ----------
    what : "buildings", told apart by gaps and steps (`CityMap.building_labels`), or "quarters",
        which are street blocks.
    share : share of the buildings, or of the street blocks, that are drawn, 0…1; one at least
        unless it is 0. How many changed is in ``made["scaled"]``.
    factors : the least and the largest factor, 0.1…10; drawn evenly by their logarithm. (1, 1.6)
        only raises.
    storey : metres; 3, as the measure `fsi` counts floors.
    highest : no building is raised above this, metres. 50 m is where French law begins to call
        housing high-rise (Code de la construction, R146-3).
    repair, reach, domains : as in `Drafting`; what is meant to be laid is the parent's decoded map
        with the new heights.

    Source: ours.
    """

    what: str = "quarters"
    share: float = 0.1
    factors: Sequence[float] = (0.625, 1.6)
    storey: float = STOREY
    highest: float = 50.0

    #: Walls are raised above all nearby, which domain blocks cannot show.
    clears: ClassVar[bool] = True
    name = "height_scaling"
    parents = (1, 1)

    def _checks(self) -> dict[str, Check]:
        factor = MOST_FACTOR
        return {
            "what": (lambda what: what in _WHAT, " or ".join(_WHAT)),
            "share": (lambda share: 0 <= share <= 1, "0…1"),
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
        wanted = max(math.ceil(self.share), round(self.share * len(groups)))
        factors = np.exp(rng.uniform(*np.log(self.factors), len(groups)))
        scaled = 0
        for number in rng.permutation(len(groups)):
            if scaled == wanted:
                break
            scaled += factors[number] != 1 and heights.scale(groups[number], factors[number])
        return heights.draft({"what": self.what, "scaled": scaled})
