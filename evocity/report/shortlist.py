"""The shortlist: individuals worth keeping, in plan and in three dimensions, compared with the
parents and the archive."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evocity.analysis.individual import command_for_gis
from evocity.report.gallery import Lineage, Row, rows_of
from evocity.report.pictures import Pictures, scene_uris
from evocity.report.shown_births import Shown, ShownBirths
from evocity.templates import number

# Individuals of the last generation in three dimensions, where there is no archive.
_MOST_BEST = 3

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


@dataclass(frozen=True)
class Compared:
    """A measure: its value, its range in the archive, and the parents' values."""

    name: str
    goal: str
    value: str
    archive: str
    parents: str


@dataclass(frozen=True)
class ShortlistCard:
    """An individual worth keeping. ``rows``: logged measures; ``others``: all other measures."""

    id: int
    role: str
    why: str
    gave_up: str
    scarce: str
    alive: bool
    plan: str
    scene: str
    width: int
    rows: list[Compared]
    lineage: Lineage
    others: list[tuple[str, str]]
    command: str


def shortlist_cards(shown: ShownBirths, pictures: Pictures) -> list[ShortlistCard]:
    """Return the cards of the shortlist, the best first."""
    births = shown.individuals([one.individual.id for one in shown.shortlist])
    others = _other_measures(shown, births)
    cities = [shown.city(birth) for birth in births]
    scenes = scene_uris(cities, pictures.highest)
    ids = [] if shown.archive is None else shown.archive.ids
    archive = shown.births.values[shown.births.rows(ids)]
    return [
        ShortlistCard(
            birth.id,
            kept.role[:1].upper() + kept.role[1:],
            kept.why,
            kept.gave_up,
            kept.scarce,
            kept.individual.alive,
            pictures.of(birth.id, city),
            uri,
            city.shape[1],
            _compared(shown, archive, birth.values),
            Lineage(shown, birth),
            others[birth.id],
            command_for_gis("RUN", birth.id, kept.individual.ground),
        )
        for kept, birth, city, uri in zip(shown.shortlist, births, cities, scenes, strict=True)
    ]


def _compared(shown: ShownBirths, archive: np.ndarray, values: Mapping) -> list[Compared]:
    """A row of each measure of the columns of ``archive``."""
    rows = []
    for column, aim in zip(archive.T, shown.births.logged, strict=True):
        parents = [number(birth.values.get(aim.name)) for birth in shown.source_births]
        value = number(values.get(aim.name), aim.unit)
        rows.append(
            Compared(aim.name, aim.wanted, value, _range(column), ", ".join(parents) or "–")
        )
    return rows


def _other_measures(shown: ShownBirths, births: Sequence) -> dict[int, list[tuple[str, str]]]:
    """Id -> name and value of each measure that the run did not log."""
    return {
        one: [(name, number(value, unit)) for name, value, unit in values]
        for one, values in shown.unlogged(births).items()
    }


def _range(values: np.ndarray) -> str:
    """From the least to the most of ``values``."""
    known = values[np.isfinite(values)]
    if not known.size:
        return "–"
    least, most = number(float(known.min())), number(float(known.max()))
    return least if least == most else f"{least} to {most}"


def title_of(cards: Sequence[ShortlistCard]) -> str:
    """Return the heading of the shortlist."""
    many = len(cards)
    return f"{_NUMBERS[many] if many < len(_NUMBERS) else many} to keep".capitalize()


def search_for(untraced: Sequence[str]) -> str:
    """Return Python that finds births with stones of the ``untraced`` source cities."""
    return (
        'import evocity\nrun = evocity.open_run("RUN")\n'
        f"untraced = {list(untraced)!r}\n"
        'shares = run.ancestry("feasible")\n'
        "some = shares[(shares[untraced] > 0.05).all(axis=1)]\n"
        "print(run.keep(5, of=some))"
    )


@dataclass(frozen=True)
class Best:
    """One of the best of the last generation, in three dimensions."""

    id: int
    scene: str
    caption: str
    rows: list[Row]
    others: list[tuple[str, str]]


def best_of_last(shown: ShownBirths, highest: float) -> list[Best]:
    """Return the best of the last generation by each goal, for runs without an archive."""
    best = shown.best(_MOST_BEST)
    others = _other_measures(shown, [one.birth for one in best])
    scenes = scene_uris([one.city for one in best], highest)
    return [
        Best(
            one.birth.id,
            uri,
            f"{_values(shown.births.sought, one)}{_bounded(shown, one)}",
            rows_of(shown.births, one.birth.values),
            others[one.birth.id],
        )
        for one, uri in zip(best, scenes, strict=True)
    ]


def _values(aims, one: Shown) -> str:
    values = one.birth.values
    return ", ".join(f"{aim.name} {number(values.get(aim.name), aim.unit)}" for aim in aims)


def _bounded(shown: ShownBirths, one: Shown) -> str:
    """Constraints in a caption: values and bounds."""
    constraints = [aim for aim in shown.births.aims if not aim.sought]
    texts = "; ".join(f"{_values([aim], one)} ({aim.bounds})" for aim in constraints)
    verb = "breaks a constraint" if one.birth.id in shown.broken else "constraints"
    return f". {verb.capitalize()}: {texts}" if texts else ""
