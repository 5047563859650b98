"""Selection algorithms by name: evocity's own, and those of other packages.

A package adds an algorithm by an entry point of the group ``evocity.algorithms``. Its name is the
value of ``algorithm`` under ``[search]``, its object a subclass of `Algorithm`.
"""

from functools import cache
from importlib.metadata import EntryPoint

from evocity.plugins import load_plugins
from evocity.selection.algorithms.algorithm import Algorithm, First, Ranked
from evocity.selection.algorithms.cma import Cma
from evocity.selection.algorithms.map_elites import MapElites
from evocity.selection.algorithms.nsga3 import Nsga3
from evocity.selection.algorithms.ordered import HypervolumeContribution, Nsga2, Single

#: The algorithm of a recipe that names none.
DEFAULT = "hypervolume"
_BUILT_IN = (HypervolumeContribution, Nsga2, Nsga3, Single, MapElites, Cma)


def algorithms() -> dict[str, type[Algorithm]]:
    """Return the algorithms by name: evocity's own, then those of other packages."""
    return dict(_load_all()[0])


def algorithm_faults() -> tuple[str, ...]:
    """Say which algorithms of other packages could not be loaded, and why."""
    return _load_all()[1]


@cache
def _load_all() -> tuple[dict[str, type[Algorithm]], tuple[str, ...]]:
    known: dict[str, type[Algorithm]] = {one.name: one for one in _BUILT_IN}

    def take(entry: EntryPoint) -> None:
        kind = entry.load()
        if not (isinstance(kind, type) and issubclass(kind, Algorithm)):
            raise TypeError(f"{kind!r} is not a subclass of evocity.selection.algorithms.Algorithm")
        if entry.name in known:
            raise ValueError(f"another algorithm is called {entry.name} already")
        known[entry.name] = kind

    return known, load_plugins("evocity.algorithms", take)


__all__ = ["DEFAULT", "Algorithm", "First", "Ranked", "algorithm_faults", "algorithms"]
