"""The births to keep as plain cards; for a run without an archive, the best of its last
generation."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from evocity.analysis.births import label
from evocity.analysis.goals import Aim, number_of, recipe_of
from evocity.analysis.individual import Individual, built_shares, command_for_gis
from evocity.analysis.shortlist import Shortlist, ShortlistEntry
from evocity.genome import VOID
from evocity.pictures import city_colours
from evocity.selection.algorithms import Ranked
from evocity.selection.thumbprints import distinct_first, look_of

#: Births to keep, at most; without an archive, births of the last generation.
MOST_KEPT, MOST_BEST = 5, 3
# Births of the last generation whose looks are compared, at most.
_MOST_COMPARED = 96


def shortlist_of(run: Any) -> Shortlist:
    """Return the births to keep; empty where the run does not record its goals, or where no birth
    keeps the constraints."""
    births = run.columns
    if not births.has_known_goals or not len(run.archive):
        return Shortlist()
    return run.keep(MOST_KEPT)


def cards_of(run: Any, kept: Shortlist, folder: str) -> list[dict]:
    """Return the births to keep as plain cards, the best first; ``folder`` is the run folder in the
    commands. Without births to keep, return the best births of the last generation."""
    if kept:
        return [_card(run, one, folder) for one in kept]
    aims = [aim for aim in run.columns.aims if aim.bounds]
    cards = []
    for identifier in best_of_last(run, MOST_BEST):
        one, row = Individual(run.columns, identifier), run.columns.rows([identifier])[0]
        why = "It is one of the best of the last generation."
        if aims:
            verb, listed = ("keeps" if one.feasible else "breaks"), aims
            if not one.feasible:  # only the bounds that it breaks
                of = run.columns.value
                listed = [aim for aim in aims if not aim.within(of(aim.name)[row])] or aims
            why += f" It {verb} the bounds: {'; '.join(map(_in_words, listed))}."
        entry = ShortlistEntry(one, "one of the best", why, "")
        cards.append(_card(run, entry, folder))
    return cards


def _in_words(aim: Aim) -> str:
    return f"{aim.name.replace('_', ' ')} {aim.bounds}"


def _card(run: Any, entry: ShortlistEntry, folder: str) -> dict:
    one = entry.individual
    return {
        "id": one.id,
        "role": entry.role,
        "why": entry.why,
        "gave_up": entry.gave_up,
        "scarce": entry.scarce,
        "alive": one.alive,
        "feasible": one.feasible,
        "generation": one.generation,
        "operator": one.operator,
        "parents": [int(parent) for parent in one.birth.parents],
        "command": command_for_gis(folder, one.id, one.ground),
        "shares": _shares(run, one),
        "values": {
            label(aim.name): plain(one.birth.values.get(aim.name)) for aim in run.columns.logged
        },
    }


def _shares(run: Any, one: Individual) -> list[dict]:
    """Return the share of each source city in the map and in the buildings; nothing without source
    cities."""
    header = run.header
    fabric = header.chromosome.fabric(one.genome)
    if fabric is None:
        return []
    every, built = fabric.shares, built_shares(header, fabric, one.city)
    listed = zip(
        city_labels(header.cities), every.tolist(), built.tolist(), city_colours(header.cities),
        strict=True,
    )  # fmt: skip
    keys = ("city", "share", "built", "colour")
    return [dict(zip(keys, part, strict=True)) for part in listed if part[1] > 0]


def city_labels(cities: Sequence[str]) -> list[str]:
    """Return the names of the cities for people; the share of no city is open ground."""
    return ["open ground added" if city == VOID else str(city) for city in cities]


def best_of_last(run: Any, count: int) -> list[int]:
    """Return the ids of the best ``count`` of the last generation, by each goal in turn, if they
    look different. Raises `RunError` if a birth has no map."""
    births = run.columns
    ids, _ = births.ranked()
    rows = births.rows(ids)
    broken = ~births.feasible[rows]
    by_aim = [
        ids[np.lexsort((ids, aim.losses(births.value(aim.name)[rows]), broken))].tolist()
        for aim in births.sought
    ]
    best = list(dict.fromkeys(one for turn in zip(*by_aim, strict=True) for one in turn))
    best = best[:_MOST_COMPARED]
    looks = []
    for birth in run.individuals(best) if best else ():
        city = births.expressed(birth).city
        looks.append(look_of(Individual(births, birth.id).city if city is None else city))
    first = distinct_first(looks, _apart(run), count)[:count]
    order = {one: place for place, one in enumerate(ids.tolist())}
    return sorted((best[place] for place in first.tolist()), key=order.__getitem__)


def _apart(run: Any) -> float:
    """Return the least share of the map in which different births differ, by the recipe."""
    section = recipe_of(run).get("search")
    stated = number_of(section.get("apart")) if isinstance(section, dict) else None
    default = Ranked.Keys.model_fields["apart"].default
    return default if stated is None or not 0 <= stated <= 1 else stated


def plain(value: Any) -> float | None:
    """Return a finite number of Python; None for other values."""
    return float(value) if value is not None and np.isfinite(value) else None
