"""How a search selects: an algorithm a file, by names, and those that other packages add.

A package adds one by an entry point of the group ``evocity.algorithms``, whose name is what a
recipe writes as ``algorithm`` under ``[search]``, and which is a subclass of `Algorithm`.
"""

from functools import cache
from importlib.metadata import EntryPoint

from evocity.plugins import load_plugins
from evocity.search.algorithms.algorithm import Algorithm, First, Ranked
from evocity.search.algorithms.cma import Cma
from evocity.search.algorithms.hypervolume import HypervolumeContribution
from evocity.search.algorithms.map_elites import MapElites
from evocity.search.algorithms.nsga2 import Nsga2
from evocity.search.algorithms.nsga3 import Nsga3
from evocity.search.algorithms.single import Single

#: What a recipe selects by where it says nothing.
DEFAULT = "hypervolume"
_OWN = {one.name: one for one in (HypervolumeContribution, Nsga2, Nsga3, Single, MapElites, Cma)}


def algorithms() -> dict[str, type[Algorithm]]:
    """The algorithms by name: evocity's own, then those of other packages."""
    return dict(_known()[0])


def algorithm_faults() -> tuple[str, ...]:
    """In words, which algorithms of other packages could not be loaded, and why."""
    return _known()[1]


@cache
def _known() -> tuple[dict[str, type[Algorithm]], tuple[str, ...]]:
    found = dict(_OWN)

    def take(entry: EntryPoint) -> None:
        kind = entry.load()
        if not (isinstance(kind, type) and issubclass(kind, Algorithm)):
            raise TypeError(f"{kind!r} is no subclass of evocity.search.algorithms.Algorithm")
        if entry.name in found:
            raise ValueError(f"there is an algorithm called {entry.name} already")
        found[entry.name] = kind

    return found, load_plugins("evocity.algorithms", take)


__all__ = ["DEFAULT", "Algorithm", "First", "Ranked", "algorithm_faults", "algorithms"]
