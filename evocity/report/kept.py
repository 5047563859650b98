"""The few that are worth keeping, in plan and in three dimensions, and what they have beside the
parents and all of the archive."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.analysis.placing import command_for_gis
from evocity.pages import number
from evocity.report.facts import Facts, Shown
from evocity.report.gallery import Lineage, Row, rows_of
from evocity.report.pictures import Pictures, scene_uris

#: Of the last generation, where there is no archive, so many are shown in three dimensions.
_MOST_BEST = 3

_NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


@dataclass(frozen=True)
class Compared:
    """A measure of one that is kept: what it has, the range in the archive, and the parents'."""

    name: str
    wanted: str
    told: str
    archive: str
    parents: str


@dataclass(frozen=True)
class Worth:
    """One that is worth keeping. ``rows``: what the run logged; ``others``: all other measures;
    ``command``: what writes it for QGIS."""

    id: int
    role: str
    why: str
    gave_up: str
    alive: bool
    plan: str
    scene: str
    width: int
    rows: list[Compared]
    lineage: Lineage
    others: list[tuple[str, str]]
    command: str


def few_to_keep(facts: Facts, pictures: Pictures) -> list[Worth]:
    """Those that are worth keeping, best first; none where there is no archive."""
    births = facts.individuals([one.individual.id for one in facts.kept_few])
    others, compared = facts.unlogged(births), _Compared(facts)
    cities = [facts.city(birth) for birth in births]
    scenes = scene_uris(cities, pictures.highest)
    found = []
    for kept, birth, city, uri in zip(facts.kept_few, births, cities, scenes, strict=True):
        found.append(
            Worth(
                birth.id,
                kept.role[:1].upper() + kept.role[1:],
                kept.why,
                kept.gave_up,
                kept.individual.alive,
                pictures.of(birth.id, city),
                uri,
                city.shape[1],
                compared.rows(birth.values),
                Lineage(facts, birth),
                [(name, number(value, unit)) for name, value, unit in others[birth.id]],
                command_for_gis("RUN", birth.id, kept.individual.ground),
            )
        )
    return found


class _Compared:
    """What the archive and the parents have of each measure."""

    def __init__(self, facts: Facts):
        self.facts = facts
        told = facts.told
        ids = [] if facts.archive is None else facts.archive.ids
        self.archive = told.values[told.rows(ids)]
        self.parents = [birth.values for birth in facts.source_births]

    def rows(self, values) -> list[Compared]:
        facts, found = self.facts, []
        for column, aim in enumerate(facts.told.logged):
            own = [one.get(aim.name) for one in self.parents]
            found.append(
                Compared(
                    aim.name,
                    aim.wanted,
                    number(values.get(aim.name), aim.unit),
                    _range(self.archive[:, column]),
                    ", ".join(number(value) for value in own) or "–",
                )
            )
        return found


def _range(values: np.ndarray) -> str:
    """From the least to the most of them."""
    known = values[np.isfinite(values)]
    if not known.size:
        return "–"
    least, most = number(float(known.min())), number(float(known.max()))
    return least if least == most else f"{least} to {most}"


def title_of(kept: Sequence[Worth]) -> str:
    many = len(kept)
    return f"{_NUMBERS[many] if many < len(_NUMBERS) else many} to keep".capitalize()


def search_for(untraced: Sequence[str]) -> str:
    """Python that finds births with stones of the source cities that are ``untraced``."""
    return (
        'import evocity\nrun = evocity.open_run("RUN")\n'
        f"untraced = {list(untraced)!r}\n"
        'shares = run.ancestry("feasible")\n'
        "some = shares[(shares[untraced] > 0.05).all(axis=1)]\n"
        "print(run.keep(5, of=some))"
    )


@dataclass(frozen=True)
class Best:
    """One of the best of the last generation in three dimensions."""

    id: int
    scene: str
    told: str
    rows: list[Row]
    others: list[tuple[str, str]]


def best_of_last(facts: Facts, highest: float) -> list[Best]:
    """The best of the last generation by each goal, for runs without an archive."""
    shown = facts.best(_MOST_BEST)
    others = facts.unlogged([one.birth for one in shown])
    scenes = scene_uris([one.city for one in shown], highest)
    return [
        Best(
            one.birth.id,
            uri,
            f"{_values(facts.sought, one)}{_bounded(facts, one)}",
            rows_of(facts, one.birth.values),
            [(name, number(value, unit)) for name, value, unit in others[one.birth.id]],
        )
        for one, uri in zip(shown, scenes, strict=True)
    ]


def _values(aims, one: Shown) -> str:
    told = (f"{aim.name} {number(one.birth.values.get(aim.name), aim.unit)}" for aim in aims)
    return ", ".join(told)


def _bounded(facts: Facts, one: Shown) -> str:
    """The constraints beside the goals in a caption: what the individual has, and the bounds."""
    constraints = [aim for aim in facts.told.aims if aim not in facts.sought]
    told = "; ".join(f"{_values([aim], one)} ({aim.bounds})" for aim in constraints)
    verb = "breaks a constraint" if one.birth.id in facts.broken else "constraints"
    return f". {verb.capitalize()}: {told}" if told else ""


__all__ = ["Best", "Compared", "Worth", "best_of_last", "few_to_keep", "search_for", "title_of"]
