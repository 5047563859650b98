"""Arguments of plots: births of a run, their measures, genomes and maps."""

from collections.abc import Iterable, Sequence

import numpy as np

from evocity.analysis import Aim, Individual, Run
from evocity.analysis.arguments import ids_of_any
from evocity.analysis.births import Births, unknown
from evocity.analysis.individual import fabric_of
from evocity.citymap import CityMap
from evocity.errors import EvocityError, spell
from evocity.genome import Genome


def births_of(run: object) -> Births:
    """Return the births of a ``run``. Raises `EvocityError` for an object that is not an open
    run."""
    if not isinstance(run, Run):
        raise EvocityError(
            f"run = {spell(run)} is not an open run",
            "a run that evocity.open_run returned",
            'write run = evocity.open_run("runs/demo")',
        )
    return run.columns


def rows_of(births: Births, of: object, usual: Iterable[int]) -> np.ndarray:
    """Return the rows of the births that ``of`` names, see `evocity.analysis.Run`; or the
    ``usual``."""
    return births.rows(ids_of_any(usual if of is None else of, births))


def aims_on(births: Births, measures: str | Sequence[str] | None) -> list[Aim]:
    """Return the goals of the ``measures``; None for the measures with a goal or bounds."""
    if measures is None:
        return list(births.aims) or list(births.recorded)
    known = {aim.name: aim for aim in births.logged}
    names = [measures] if isinstance(measures, str) else list(measures)
    for name in names:
        if name not in known:
            raise unknown(name, list(known), str(births.run.path))
    if not names:
        raise EvocityError(
            "the list of measures is empty",
            "at least one measure",
            f"choose one or more of the measures {', '.join(known)}",
        )
    return [known[name] for name in names]


def aim_on(births: Births, measure: str) -> Aim:
    return aims_on(births, [measure])[0]


def axis_label(aim: Aim) -> str:
    """Return a measure with its unit and its sign: "street_width, m ↑"."""
    return f"{aim.title} {aim.sign}".rstrip()


def genome_of(thing: object) -> Genome:
    """Return a genome, or an individual's. Raises `EvocityError` for another object."""
    if isinstance(thing, Individual):
        return fabric_of(thing.run.header, thing.genome, "a plot of source cities")
    if not isinstance(thing, Genome):
        raise _unsuitable(thing, "genome", "run[97].genome")
    return thing


def city_of(thing: object) -> CityMap:
    """Return a map, or an individual's. Raises `EvocityError` for another object."""
    if isinstance(thing, Individual):
        return thing.city
    if not isinstance(thing, CityMap):
        raise _unsuitable(thing, "map", "a CityMap")
    return thing


def _unsuitable(thing: object, kind: str, example: str) -> EvocityError:
    expected, remedy = f"a {kind}, or an individual of a run", f"give run[97] or {example}"
    return EvocityError(f"the first argument is {spell(thing)}", expected, remedy)
