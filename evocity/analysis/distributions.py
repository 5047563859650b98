"""Distributions of buildings: of an individual, its parents, and the cities of the run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.analysis.individual import Individual
from evocity.citymap import CityMap
from evocity.errors import EvocityError, check_word, spell
from evocity.genome import VOID
from evocity.pictures import city_colours

#: Quantities of buildings: name in words, unit, and whether the axis is logarithmic.
QUANTITIES = {
    "area": ("footprint", "m²", True),
    "height": ("height", "m", False),
    "perimeter": ("perimeter", "m", True),
    "volume": ("volume", "m³", True),
}


@dataclass(frozen=True, eq=False)
class Distribution:
    """A quantity of the buildings of one map.

    name : name of the map. role : "source", "reference", "parent" or "individual".
    values : rising, one per building. colour : of a source city, ``#rrggbb``; else None.
    """

    name: str
    role: str
    values: np.ndarray
    colour: str | None = None


def distributions(
    individual: Individual,
    of: str = "area",
    parents: bool = True,
    sources: Sequence[CityMap] | None = None,
    references: Sequence[CityMap] | None = None,
) -> list[Distribution]:
    """Return distributions of the run's source cities, then of the reference cities of its
    measures, then of the individual's parents, and last of the individual. ``of``: a key of
    `QUANTITIES`. ``sources``, ``references``: the run's cities, if they are read already."""
    if not isinstance(individual, Individual):
        raise EvocityError(
            f"the argument 'individual' has the value {spell(individual)}",
            "an individual of a run",
            "give an individual, for example run[97]",
        )
    check_word("of", of, QUANTITIES, "leave it out for area")
    run = individual.run

    def of_city(name: str, role: str, city: CityMap, colour: str | None = None) -> Distribution:
        return Distribution(name, role, np.sort(getattr(city.buildings, of)), colour)

    cities = [source.city for source in run.sources()] if sources is None else sources
    colours = city_colours([c for c in run.header.cities if c != VOID] or [])
    listed = [
        of_city(city.name, "source", city, colour)
        for city, colour in zip(cities, colours, strict=False)
    ]
    others = run.references() if references is None else references
    listed += [of_city(city.name, "reference", city) for city in others]
    bred = individual.parents if parents else ()
    listed += [of_city(f"parent {one.id}", "parent", one.city) for one in bred]
    return [*listed, of_city(f"individual {individual.id}", "individual", individual.city)]
