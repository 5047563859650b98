"""Buildings of an individual beside those of its parents and cities, one number a building."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.analysis.individual import Individual
from evocity.citymap import CityMap
from evocity.errors import EvocityError, check_word, shown
from evocity.genome import VOID
from evocity.pictures import city_colours

#: What can be told of buildings, in words, its unit, and whether on a scale of powers.
QUANTITIES = {
    "area": ("footprint", "m²", True),
    "height": ("height", "m", False),
    "perimeter": ("perimeter", "m", True),
    "volume": ("volume", "m³", True),
}


@dataclass(frozen=True, eq=False)
class Distribution:
    """Of the buildings of one map.

    name : what the map is called. role : "source", "reference", "parent" or "individual".
    values : rising, one a building. colour : of a source city, ``#rrggbb``; else None.
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
    """Of the run's source cities as read, of the cities that its measures compare with, of those
    that an individual was bred from, and of itself last.

    of : a key of `QUANTITIES`.
    parents : whether those it was bred from are told.
    sources, references : the run's, where they are at hand.

    Raises `EvocityError` for another ``of``, and for what is no individual; `RunError` if it, or
    one of its parents, has no map.
    """
    if not isinstance(individual, Individual):
        raise EvocityError(shown(individual), "an individual of a run", "give run[97]")
    check_word("of", of, QUANTITIES, "leave it out for area")
    run = individual.run

    def told(name: str, role: str, city: CityMap, colour: str | None = None) -> Distribution:
        return Distribution(name, role, np.sort(getattr(city.buildings, of)), colour)

    cities = [source.city for source in run.sources()] if sources is None else sources
    colours = city_colours([c for c in run.header.cities if c != VOID] or [])
    found = [
        told(city.name, "source", city, colour)
        for city, colour in zip(cities, colours, strict=False)
    ]
    others = run.references() if references is None else references
    found += [told(city.name, "reference", city) for city in others]
    bred = individual.parents if parents else ()
    found += [told(f"parent {one.id}", "parent", one.city) for one in bred]
    return [*found, told(f"individual {individual.id}", "individual", individual.city)]


__all__ = ["QUANTITIES", "Distribution", "distributions"]
