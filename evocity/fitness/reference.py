"""References: the cities that a measure compares a map with, their weights, and source cities."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError, is_number, spell
from evocity.genome import Genome

_HOW = "a CityMap, a list of them, or a list of pairs (CityMap, weight)"


@dataclass(frozen=True, eq=False)
class Reference:
    """Cities with which a measure compares a map, and a weight for each city.

    Make a reference with `Reference.of` or `Reference.sources`.

    cities : at least one map with which the measure compares other maps.
    weights : weight of each city; the weights sum to 1. If ``weights`` is None, the cities are the
        source cities of a run, and the genome of a map gives the weights for this map.
    """

    cities: tuple[CityMap, ...]
    weights: tuple[float, ...] | None

    @classmethod
    def of(cls, cities: "Reference | CityMap | Sequence") -> "Reference":
        """Make a reference from one city, a list of cities with equal weights, or a list of pairs
        (city, weight).

        Raises `FitnessError` for an argument that is not a city, a list of cities, or a list of
        pairs.
        """
        if isinstance(cities, cls):
            return cities
        if isinstance(cities, CityMap):
            return cls((cities,), (1.0,))
        listed = isinstance(cities, Sequence) and not isinstance(cities, str)
        pairs = [(c, 1.0) if isinstance(c, CityMap) else c for c in (cities if listed else ())]
        if not pairs or not all(map(_is_weighted, pairs)):
            raise FitnessError(
                f"the reference {spell(cities)} is invalid",
                f"{_HOW}, with weights above 0",
                'give for example reference=evocity.read_map("lyon-1er")',
            )
        total = float(sum(weight for _, weight in pairs))
        maps, weights = zip(*pairs, strict=True)
        return cls(maps, tuple(weight / total for weight in weights))

    @classmethod
    def sources(cls, cities: Sequence[CityMap]) -> "Reference":
        """Make a reference from the maps of a run's source cities; each map must have the name
        that the genomes use for its city."""
        return cls(tuple(cities), None)

    def shares(self, city: CityMap, genome: Genome | None) -> np.ndarray:
        """Compute the weights of the k cities, float64 ``(k,)``; the weights sum to 1.

        Without fixed weights, the weight of a source city is its share of the built ground of the
        map, according to the genome. All weights are 0 if no built ground of the map comes from the
        cities of the reference. The method raises `FitnessError` if a needed genome is missing, or
        if the genome has no city of the reference.
        """
        if self.weights is not None:
            return np.array(self.weights)
        if genome is None:
            raise FitnessError(
                f"{city.name} without its genome, and a reference without weights",
                "the genome, which gives the share of each city in the map",
                "give genome=, or a reference with weights of its own: " + _HOW,
            )
        from_each = np.bincount(
            city.of_whole(genome.pavement.raster(genome.parent))[city.built],
            minlength=len(genome.cities),
        )
        by_name = dict(zip(genome.cities, from_each, strict=False))
        names = [source.name for source in self.cities]
        if not any(name in by_name for name in names):
            raise FitnessError(
                f"the genome has the source cities {', '.join(genome.cities)}, but the reference "
                f"has only {', '.join(names)}",
                "a reference with the maps of the genome's source cities",
                "give these maps as the reference, with the names that the genome uses",
            )
        built = np.array([by_name.get(name, 0) for name in names], float)
        return built / max(built.sum(), 1)


def check_sources(sources) -> tuple[CityMap, ...]:
    """Check the maps of source cities: a map, or a list of maps with different names.

    Raises `FitnessError` for anything else.
    """
    if isinstance(sources, CityMap):
        return (sources,)
    listed = isinstance(sources, Sequence) and not isinstance(sources, str)
    maps = tuple(sources) if listed else ()
    if not listed or not all(isinstance(city, CityMap) for city in maps):
        raise FitnessError(
            f"sources = {spell(sources)} is not a list of maps",
            "a list of maps (CityMap) of the genome's source cities",
            "for a run give: [source.city for source in evocity.open_run(path).sources()]",
        )
    first: dict[str, CityMap] = {}
    twice = {city.name for city in maps if first.setdefault(city.name, city) is not city}
    if twice:
        raise FitnessError(
            f"two source cities have the name {', '.join(sorted(twice))}",
            "one map per city, with the name that the genome uses for the city",
            "remove the surplus maps of this name, or rename them",
        )
    return maps


def _is_weighted(pair) -> bool:
    if not (isinstance(pair, Sequence) and not isinstance(pair, str) and len(pair) == 2):
        return False
    city, weight = pair
    return isinstance(city, CityMap) and is_number(weight) and 0 < weight < np.inf
