"""Arguments of plots: births of a run, their measures, genomes and maps."""

from collections.abc import Iterable, Sequence

import numpy as np

from evocity.analysis import Aim, Individual, Run
from evocity.analysis.arguments import ids_of_any
from evocity.analysis.births import Births, unknown
from evocity.analysis.fabric_genomes import fabric_of
from evocity.citymap import CityMap
from evocity.errors import EvocityError, spell
from evocity.genome import Genome


def births_of(run: object) -> Births:
    """Return the births of a ``run``. Raises `EvocityError` for an object that is not an open run,
    `RunError` where it has no whole generation yet."""
    if not isinstance(run, Run):
        raise EvocityError(
            f"run = {spell(run)}",
            "a run, as evocity.open_run opens it",
            'write run = evocity.open_run("runs/demo")',
        )
    return run.columns


def rows_of(births: Births, of: object, usual: Iterable[int]) -> np.ndarray:
    """Return the rows of the births that ``of`` names: ids, individuals, a frame, a condition, see
    `evocity.analysis.Run.where`; of those ``usual`` if it is None."""
    return births.rows(ids_of_any(usual if of is None else of, births))


def aims_on(births: Births, measures: str | Sequence[str] | None) -> list[Aim]:
    """Return what was wanted of each of the ``measures``; None for those with a goal or bounds.
    Raises `RunError` for a measure that the run does not log."""
    if measures is None:
        return list(births.aims) or list(births.recorded)
    known = {aim.name: aim for aim in births.logged}
    names = [measures] if isinstance(measures, str) else list(measures)
    for name in names:
        if name not in known:
            raise unknown(name, list(known), str(births.run.path))
    if not names:
        raise EvocityError(
            "measures = []", "at least one measure", f"choose some of {', '.join(known)}"
        )
    return [known[name] for name in names]


def aim_on(births: Births, measure: str) -> Aim:
    """Return what was wanted of one ``measure``. Raises as `aims_on`."""
    return aims_on(births, [measure])[0]


def axis_label(aim: Aim) -> str:
    """Return a measure with its unit and its sign: "street_width, m ↑"."""
    return f"{aim.title} {aim.sign}".rstrip()


def genome_of(thing: object) -> Genome:
    """Return a genome, or an individual's. Raises `EvocityError` for another object."""
    if isinstance(thing, Individual):
        return fabric_of(thing.run.header, thing.genome, "a plot of source cities")
    if not isinstance(thing, Genome):
        raise EvocityError(
            spell(thing),
            "a genome, or an individual of a run",
            "give run[97] or run[97].genome",
        )
    return thing


def city_of(thing: object) -> CityMap:
    """Return a map, or an individual's. Raises `EvocityError` for another object."""
    if isinstance(thing, Individual):
        return thing.city
    if not isinstance(thing, CityMap):
        raise EvocityError(
            spell(thing), "a map, or an individual of a run", "give run[97] or a CityMap"
        )
    return thing
