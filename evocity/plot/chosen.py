"""What a plot is drawn of: births of a run, their cities, one scale of heights."""

from collections.abc import Iterable, Sequence

import numpy as np

from evocity.analysis import Aim, Individual, Run
from evocity.analysis.asked import ids_of_any
from evocity.analysis.births import Told, unknown
from evocity.analysis.fabrics import fabric_of
from evocity.analysis.thumbnails import cities_of, highest_of, thumbnail
from evocity.analysis.wanted import stated_aim
from evocity.citymap import CityMap
from evocity.errors import EvocityError, shown
from evocity.genome import Genome


def told_of(run: object) -> Told:
    """The births of a ``run``. Raises `EvocityError` for what is no open run, `RunError` where it
    has no whole generation yet."""
    if not isinstance(run, Run):
        raise EvocityError(
            f"run = {shown(run)}",
            "a run, as evocity.open_run opens it",
            'write run = evocity.open_run("runs/demo")',
        )
    return run.told


def rows_of(told: Told, of: object, usual: Iterable[int]) -> np.ndarray:
    """The rows of the births that ``of`` names: ids, individuals, a frame of births, a condition as
    `evocity.analysis.Run.where` has it; of those ``usual`` if it is None."""
    return told.rows(ids_of_any(usual if of is None else of, told))


def aims_on(told: Told, measures: str | Sequence[str] | None) -> list[Aim]:
    """What was wanted of each of the ``measures``; None for those that something was wanted of, and
    those that only had bounds. Raises `RunError` for one that the run does not log."""
    if measures is None:
        return list(told.aims) or list(told.recorded)
    known = {aim.name: aim for aim in told.logged}
    names = [measures] if isinstance(measures, str) else list(measures)
    for name in names:
        if name not in known:
            raise unknown(name, list(known), str(told.run.path))
    if not names:
        raise EvocityError("measures = []", "some measures", f"name some of {', '.join(known)}")
    return [known[name] for name in names]


def aim_on(told: Told, measure: str) -> Aim:
    """What was wanted of one ``measure``. Raises as `aims_on`."""
    return aims_on(told, [measure])[0]


def aim_named(name: str) -> Aim:
    """What a measure that no run logged is and should be, as far as it is known here."""
    return stated_aim(name, {})


def worded(aim: Aim) -> str:
    """A measure, its unit and its sign: "street_width, m ↑"."""
    named = f"{aim.name}, {aim.unit}" if aim.unit else aim.name
    return f"{named} {aim.sign}".rstrip()


def genome_of(thing: object) -> Genome:
    """A genome, or an individual's. Raises `EvocityError` for another thing."""
    if isinstance(thing, Individual):
        return fabric_of(thing.run.header, thing.genome, "what is drawn of stones")
    if not isinstance(thing, Genome):
        raise EvocityError(
            shown(thing), "a genome, or an individual of a run", "give run[97] or run[97].genome"
        )
    return thing


def city_of(thing: object) -> CityMap:
    """A map, or an individual's. Raises `EvocityError` for another thing."""
    if isinstance(thing, Individual):
        return thing.city
    if not isinstance(thing, CityMap):
        raise EvocityError(
            shown(thing), "a map, or an individual of a run", "give run[97] or a CityMap"
        )
    return thing


__all__ = [
    "aim_named",
    "aim_on",
    "aims_on",
    "cities_of",
    "city_of",
    "genome_of",
    "highest_of",
    "rows_of",
    "thumbnail",
    "told_of",
    "worded",
]
