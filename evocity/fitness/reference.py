"""What a measure may compare a city with: other cities' maps, and how much each of them counts;
the maps of the cities it was bred from."""

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError, shown
from evocity.genome import Genome

_HOW = "a CityMap, a list of them, or a list of pairs (CityMap, weight)"


@dataclass(frozen=True, eq=False)
class Reference:
    """The cities that a map is compared with; made by `Reference.of` or `Reference.sources`.

    cities : at least one map.
    weights : a number a city, together 1; None if the genome tells how much of a map comes from
        each of them, as in a run, whose source cities they are.
    """

    cities: tuple[CityMap, ...]
    weights: tuple[float, ...] | None

    @classmethod
    def of(cls, told: "Reference | CityMap | Sequence") -> "Reference":
        """A city, a list of cities weighted alike, or of (city, weight). Raises `FitnessError`."""
        if isinstance(told, cls):
            return told
        if isinstance(told, CityMap):
            return cls((told,), (1.0,))
        listed = list(told) if isinstance(told, Sequence) and not isinstance(told, str) else []
        pairs = [(one, 1.0) if isinstance(one, CityMap) else one for one in listed]
        if not pairs or not all(map(_weighted, pairs)):
            raise FitnessError(
                f"a reference of {shown(told)}",
                f"{_HOW}, weights above 0",
                'for example reference=evocity.read_map("lyon-1er")',
            )
        total = float(sum(weight for _, weight in pairs))
        cities, weights = zip(*pairs, strict=True)
        return cls(cities, tuple(weight / total for weight in weights))

    @classmethod
    def sources(cls, cities: Sequence[CityMap]) -> "Reference":
        """The source cities of a run, under the names that its genomes have for them."""
        return cls(tuple(cities), None)

    def shares(self, city: CityMap, genome: Genome | None) -> np.ndarray:
        """Float64 ``(k,)``, together 1: how much each city counts. Where the ``genome`` of
        ``city`` tells that, it is the share of what is built that comes from each; 0 throughout
        if none does.

        Raises `FitnessError` if the genome is wanted and not there, or of none of the cities.
        """
        if self.weights is not None:
            return np.array(self.weights)
        if genome is None:
            raise FitnessError(
                f"{city.name} without its genome, beside the cities it may have been bred from",
                "the genome, which tells how much comes from each",
                "give genome=, or a reference with weights of its own: " + _HOW,
            )
        from_each = np.bincount(
            city.of_whole(genome.pavement.raster(genome.parent))[city.built],
            minlength=len(genome.cities),
        )
        by_name = dict(zip(genome.cities, from_each, strict=False))
        names = [one.name for one in self.cities]
        if not any(name in by_name for name in names):
            raise FitnessError(
                f"a genome of {', '.join(genome.cities)}, beside {', '.join(names)}",
                "the maps of the cities that it was bred from",
                "give these as the reference, under the names that the genome has for them",
            )
        built = np.array([by_name.get(name, 0) for name in names], float)
        return built / max(built.sum(), 1)


def maps_of(sources) -> tuple[CityMap, ...]:
    """The maps of source cities, each of a name of its own; one alone may be told without a list.
    Raises `FitnessError`."""
    if isinstance(sources, CityMap):
        return (sources,)
    listed = isinstance(sources, Sequence) and not isinstance(sources, str)
    maps = tuple(sources) if listed else ()
    if not listed or not all(isinstance(one, CityMap) for one in maps):
        raise FitnessError(
            f"sources = {shown(sources)}",
            "a list of maps, CityMap, of the cities that the genome is made of",
            "of a run: [source.city for source in evocity.open_run(path).sources()]",
        )
    names = [one.name for one in maps]
    twice = {
        name for name, one in zip(names, maps, strict=True) if maps[names.index(name)] is not one
    }
    if twice:
        raise FitnessError(
            f"two source cities called {', '.join(sorted(twice))}",
            "a map a city, under the name that the genome has for it",
            "give each map once",
        )
    return maps


def _weighted(pair) -> bool:
    if not (isinstance(pair, Sequence) and not isinstance(pair, str) and len(pair) == 2):
        return False
    city, weight = pair
    real = isinstance(weight, Real) and not isinstance(weight, bool)
    return isinstance(city, CityMap) and real and 0 < weight < np.inf


__all__ = ["Reference", "maps_of"]
