"""A measure of a part of a map: this quarter, that bank."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness.measure import Measure
from evocity.fitness.reference import Reference
from evocity.genome import Genome

#: Stands between a measure's own name and that of the part it is taken of.
OF = "@"
#: What belongs to a whole map, and to no part of it.
_OF_WHOLE = ("genome", "parents", "sources")


def within(measure: Measure, part: str) -> Measure:
    """The same measure by the name of what it is taken of: ``gsi@quarter``."""
    named = replace(measure, name=f"{measure.name}{OF}{part}")
    named.__dict__["source_hash"] = measure.source_hash  # of the source as it was when loaded
    return named


def own_name(name: str) -> str:
    """A measure's name without that of a part."""
    return name.partition(OF)[0]


def part_of(name: str) -> str:
    """What the part is called that a measure of this name is taken of; "" of the whole map."""
    return name.partition(OF)[2]


@dataclass(frozen=True, eq=False)
class Part:
    """A part of all maps of one size.

    name : what it is called. mask : bool ``(H, W)``, which pixels are its own, at least one.
    """

    name: str
    mask: np.ndarray = field(repr=False)

    @property
    def is_rectangle(self) -> bool:
        """Whether it fills the smallest rectangle about it."""
        rows, columns = self.mask.any(axis=1), self.mask.any(axis=0)
        spans = (np.ptp(np.flatnonzero(one)) + 1 for one in (rows, columns))
        return np.count_nonzero(self.mask) == np.prod([*spans])

    def of(self, city: CityMap) -> CityMap:
        """The part of ``city``, cut once: its measures share their views."""
        cuts = _cuts.setdefault(city, {})
        if self not in cuts:
            cuts[self] = city.within(self.mask)
        return cuts[self]

    def check(self, measure: Measure) -> None:
        """Raise `FitnessError` unless the ``measure`` can be taken of it."""
        check_map_alone(measure)
        if not (measure.any_site or self.is_rectangle):
            raise FitnessError(
                f"{own_name(measure.name)} within {self.name}, which is no rectangle: it would "
                "take what lies beside for open ground",
                "a rectangle along the pixels, or a measure that knows of parts (any_site)",
                "draw a rectangle; a measure of your own that minds city.site says so: "
                "@evocity.fitness(…, any_site=True)",
            )

    def measured(
        self,
        measure: Measure,
        city: CityMap,
        reference: Reference | CityMap | Sequence | None = None,
        genome: Genome | None = None,
    ) -> float:
        """What ``measure`` says of the part of ``city``; the ``genome`` of the whole tells those
        that compare cities how much of the part comes from each. Raises as the measure does, and
        as `check`."""
        self.check(measure)
        compares = "reference" in measure.takes
        return measure(self.of(city), reference=reference, genome=genome if compares else None)


def check_map_alone(measure: Measure) -> None:
    """Raise `FitnessError` if the ``measure`` asks for what no part of a map has."""
    asked = [one for one in measure.needs if one in _OF_WHOLE]
    if asked:
        raise FitnessError(
            f"{own_name(measure.name)} within a part: it asks for the {' and the '.join(asked)}, "
            "which tell of the whole map",
            "a measure of the map alone",
            "take it of the whole map",
        )


# A part is cut once a map, for all measures that are taken of it.
_cuts: WeakKeyDictionary[CityMap, dict[Part, CityMap]] = WeakKeyDictionary()

__all__ = ["Part", "check_map_alone", "own_name", "part_of", "within"]
