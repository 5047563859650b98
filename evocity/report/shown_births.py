"""The individuals that a report shows: which ones, each read and decoded once."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity import fitness
from evocity.analysis import Run
from evocity.analysis.births import Births, source_births
from evocity.analysis.goals import number_of, recipe_of
from evocity.analysis.shortlist import Shortlist
from evocity.citymap import CityMap
from evocity.errors import EvocityError, RunError
from evocity.search import Archive
from evocity.selection.algorithms import Ranked
from evocity.selection.thumbprints import alike, distinct_first, look_of
from evocity.store import Birth, Source

#: Individuals of a gallery, at most: the page stays a few megabytes.
MOST_SHOWN = 96
#: Individuals of the shortlist, at most.
MOST_KEPT = 5
# The default of recipes.
_APART = Ranked.Keys.model_fields["apart"].default


@dataclass(frozen=True)
class Shown:
    """An individual of a gallery: its birth, its rank and its decoded map."""

    birth: Birth
    rank: int
    city: CityMap


@dataclass(frozen=True)
class ShownBirths:
    """The individuals of a ``run`` that its report shows. Nothing in the folder is executed."""

    run: Run

    @property
    def births(self) -> Births:
        """All births as columns. Raises `RunError` if there is no complete generation."""
        return self.run.columns

    @cached_property
    def sources(self) -> list[Source]:
        """The source cities. Raises `RunError` if the run folder has none."""
        if not self.births.sources:
            raise RunError(
                f"the folder {self.run.path / 'sources'} contains no source city",
                "the source cities that `evocity run` wrote",
                "restore the folder from a backup, or start the run again",
            )
        return self.births.sources

    @cached_property
    def source_births(self) -> list[Birth]:
        """The births of the parents' own codes, without genomes."""
        return source_births(self.run)

    @cached_property
    def living(self) -> list[tuple[int, int]]:
        """Id and rank of each individual of the last generation, best first."""
        return list(zip(*(one.tolist() for one in self.births.ranked()), strict=True))

    @cached_property
    def broken(self) -> set[int]:
        """Ids of the living that break a constraint."""
        births = self.births
        return set(births.ids[births.alive & ~births.feasible].tolist())

    @cached_property
    def archive(self) -> Archive | None:
        """The run's archive; None where provenance does not record the goals."""
        return self.run.archive if self.births.has_known_goals else None

    @cached_property
    def gone(self) -> list[int]:
        """Ids of the archive's individuals that are not alive, by falling crowding distance."""
        rows = [] if self.archive is None else self.archive.births.to_pylist()
        dead = [row for row in rows if not row["alive"]]
        return [row["id"] for row in sorted(dead, key=lambda r: (-r.get("crowding", 0), r["id"]))]

    @cached_property
    def apart(self) -> float:
        """The least share of the map in which different individuals differ, by the recipe."""
        section = recipe_of(self.run).get("search")
        stated = number_of(section.get("apart")) if isinstance(section, dict) else None
        return _APART if stated is None or not 0 <= stated <= 1 else stated

    # -- which are shown ---------------------------------------------------------------------

    @cached_property
    def shown(self) -> list[Shown]:
        """The last generation's individuals, at most `MOST_SHOWN`, the front first."""
        return self._shown(self.living[:MOST_SHOWN])

    @cached_property
    def shown_gone(self) -> list[Shown]:
        """The archive's individuals that are not alive, at most `MOST_SHOWN`."""
        return self._shown([(one, 0) for one in self.gone[:MOST_SHOWN]])

    @cached_property
    def carded(self) -> frozenset[int]:
        """Ids of the individuals that have a card in a gallery."""
        return frozenset(one.birth.id for one in [*self.shown, *self.shown_gone])

    @cached_property
    def look_alikes(self) -> set[int]:
        """Ids of those in `shown` that look like one shown before them."""
        looks = np.array([look_of(one.city) for one in self.shown])
        first: list[int] = []
        for place, look in enumerate(looks):
            if not alike(look, looks[first], self.apart):
                first.append(place)
        return {one.birth.id for n, one in enumerate(self.shown) if n not in first}

    def best(self, count: int) -> list[Shown]:
        """Return the best ``count`` of the last generation, by each goal in turn, if they look
        different."""
        births, ranks = self.births, dict(self.living)
        rows = births.rows(list(ranks))
        broken = ~births.feasible[rows]
        ids = np.array(list(ranks), np.int64)
        by_aim = [
            ids[np.lexsort((ids, aim.losses(births.value(aim.name)[rows]), broken))].tolist()
            for aim in births.sought
        ]
        best = list(dict.fromkeys(one for turn in zip(*by_aim, strict=True) for one in turn))
        looks = [look_of(self.city(one)) for one in self.run.individuals(best[:MOST_SHOWN])]
        first = distinct_first(looks, self.apart, count)[:count].tolist() if looks else []
        return self._shown([(best[place], ranks[best[place]]) for place in sorted(first)])

    @cached_property
    def shortlist(self) -> Shortlist:
        """The few worth keeping, at most `MOST_KEPT`; empty where there is no archive."""
        if self.archive is None or not len(self.archive):
            return Shortlist()
        for one in [*self.shown, *self.shown_gone]:
            self.run.likeness.note(one.birth.id, one.city)
        kept = self.run.keep(MOST_KEPT)
        births = self.individuals([one.individual.id for one in kept])
        for one, birth in zip(kept, births, strict=True):
            one.individual.is_known(birth, self.city(birth))
        return kept

    # -- what is read of them ----------------------------------------------------------------

    def individuals(self, ids: Sequence[int]) -> list[Birth]:
        """Return the births with these ``ids``, with genomes; reads the log once for the report."""
        missing = [one for one in ids if one not in self._read]
        if missing:
            shown = [one for one, _ in self.living[:MOST_SHOWN]] + self.gone[:MOST_SHOWN]
            births = self.run.individuals(list(dict.fromkeys([*missing, *shown])))
            self._read.update((birth.id, birth) for birth in births)
        return [self._read[one] for one in ids]

    @cached_property
    def _read(self) -> dict[int, Birth]:
        return {}

    @cached_property
    def _cities(self) -> dict[int, CityMap]:
        return {}

    def _shown(self, ranked: Sequence[tuple[int, int]]) -> list[Shown]:
        births = self.individuals([one for one, _ in ranked])
        pairs = zip(births, ranked, strict=True)
        return [Shown(birth, rank, self.city(birth)) for birth, (_, rank) in pairs]

    def city(self, birth: Birth) -> CityMap:
        """Return the decoded map of a birth, decoded once. Raises `RunError` if it has none."""
        if birth.id not in self._cities:
            self._cities[birth.id] = map_of(self.births, birth)
        return self._cities[birth.id]

    def unlogged(self, births: Sequence[Birth]) -> dict[int, list[tuple[str, float, str]]]:
        """Measure ``births`` by measures that the run did not log: id -> (name, value, unit)."""
        sources = [source.city for source in self.sources]
        reference = fitness.Reference.sources(sources)
        others = [
            measure.bound(reference)
            for measure in fitness.measures()
            if measure.name not in self.run.header.columns
        ]
        parents = [None] * len(births)
        if any("parents" in measure.takes for measure in others):  # read from the log
            parents = self.run.parents(births)
        values = {}
        for birth, bred_of in zip(births, parents, strict=True):
            given = {"parents": bred_of, "sources": sources, "genome": birth.genome}
            city = self.city(birth)
            values[birth.id] = [(m.name, _measured(m, city, given), m.unit) for m in others]
        return values


def map_of(births: Births, birth: Birth) -> CityMap:
    """Return the map of one of the ``births``. Raises `RunError` if it has none."""
    expressed = births.expressed(birth)
    if expressed.city is None:
        raise RunError(
            f"individual {birth.id} has no map: {expressed.problem}",
            "a genome that decodes to a map, as in the run",
            "see the damage with `evocity status`, and restore the files from a backup",
        )
    return expressed.city


def figure_texts(figures: Mapping[str, float]) -> list[tuple[str, str]]:
    """Return the figures of a search algorithm for people: "qd score" and its value."""
    return [
        ("".join(filter(str.isprintable, name)).replace("_", " "), f"{value:.4g}")
        for name, value in figures.items()
    ]


def _measured(measure, city: CityMap, extras: Mapping) -> float:
    try:
        return measure(city, **extras)
    except EvocityError:  # not a measure of the run: the report goes on without it
        return math.nan
