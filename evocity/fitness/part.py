"""Parts of a map, such as a quarter or a bank, and measures within them."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness.measure import Measure
from evocity.fitness.reference import Reference
from evocity.genome import Genome

#: Separator between the name of a measure and that of its part.
OF = "@"
#: Arguments that describe a whole map and no part of it.
_OF_WHOLE = ("genome", "parents", "sources")


def within(measure: Measure, part: str) -> Measure:
    """Rename a measure for a part: ``gsi@quarter``."""
    named = replace(measure, name=f"{measure.name}{OF}{part}")
    named.__dict__["source_hash"] = measure.source_hash  # the hash of the source as loaded
    return named


def own_name(name: str) -> str:
    """Strip the part from a measure's name."""
    return name.partition(OF)[0]


def part_name(name: str) -> str:
    """Read the part from a measure's name; "" for the whole map."""
    return name.partition(OF)[2]


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a map, such as a quarter of a city; the part applies to every map that has the size
    of the mask.

    name : name of the part of the map.
    mask : bool ``(H, W)``, true on the pixels of the part; at least one pixel is true.
    """

    name: str
    mask: np.ndarray = field(repr=False)

    @property
    def is_rectangle(self) -> bool:
        """Whether the part is a rectangle whose sides follow rows and columns of pixels."""
        rows, columns = self.mask.any(axis=1), self.mask.any(axis=0)
        spans = (np.ptp(np.flatnonzero(line)) + 1 for line in (rows, columns))
        return np.count_nonzero(self.mask) == np.prod([*spans])

    def of(self, city: CityMap) -> CityMap:
        """Cut this part out of the map ``city``. The method cuts each map only once, and gives the
        result to all measures."""
        cuts = _cuts.setdefault(city, {})
        if self not in cuts:
            cuts[self] = city.within(self.mask)
        return cuts[self]

    def check(self, measure: Measure) -> None:
        """Raise `FitnessError` unless the ``measure`` can be limited to this part of a map."""
        check_map_alone(measure)
        if not (measure.any_site or self.is_rectangle):
            raise FitnessError(
                f"{own_name(measure.name)} cannot be limited to {self.name}: this part of the map "
                "is not a rectangle, and the measure would count the surroundings as open ground",
                "a rectangle of whole pixels, or a measure that was declared with any_site=True",
                "draw a rectangle; if your own measure respects city.site, declare it with "
                "@evocity.fitness(…, any_site=True)",
            )

    def measured(
        self,
        measure: Measure,
        city: CityMap,
        reference: Reference | CityMap | Sequence | None = None,
        genome: Genome | None = None,
    ) -> float:
        """Apply ``measure`` to this part of the map ``city``.

        Measures that compare cities take the share of each source city from the ``genome`` of the
        whole map. The method raises the errors that the measure raises, and those that the method
        `check` raises.
        """
        self.check(measure)
        compares = "reference" in measure.takes
        return measure(self.of(city), reference=reference, genome=genome if compares else None)


def check_map_alone(measure: Measure) -> None:
    """Raise `FitnessError` if the ``measure`` needs an argument that describes the whole map."""
    needs = [need for need in measure.needs if need in _OF_WHOLE]
    if needs:
        raise FitnessError(
            f"{own_name(measure.name)} cannot be limited to a part of the map, because its "
            f"arguments describe the whole map: {' and '.join(needs)}",
            "a measure that needs only the map",
            "use the measure for the whole map",
        )


# Each map keeps its cut parts, so that all measures of a part share one map.
_cuts: WeakKeyDictionary[CityMap, dict[Part, CityMap]] = WeakKeyDictionary()
