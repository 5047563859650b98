"""What a report tells, gathered from a run folder. Nothing in the folder is executed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity import fitness
from evocity.analysis.births import Told
from evocity.analysis.keeping import Keeping, kept_of
from evocity.analysis.likeness import Likeness
from evocity.analysis.wanted import Aim, number_of, overrides_of, recipe_of
from evocity.citymap import CityMap
from evocity.errors import EvocityError, RunError
from evocity.genome import VOID
from evocity.search import Archive, archive
from evocity.search.algorithms import Ranked
from evocity.search.binning import Binned, binned, grid_of_run
from evocity.search.judging import aims_of_run, births_without_genomes
from evocity.search.looks import alike, distinct_first, look_of
from evocity.store import Birth, Run, Source
from evocity.store.events import TURNS

#: More planned than this tells of a damaged recipe.
_MOST_GENERATIONS = 10**9
#: The gallery holds no more individuals than this: the page stays a few megabytes.
MOST_SHOWN = 96
#: So many are worth keeping.
MOST_KEPT = 5
#: As searches of recipes that say nothing of it.
_APART = Ranked.Keys.model_fields["apart"].default


@dataclass(frozen=True)
class Shown:
    """An individual of the last generation, or of the archive, as a gallery shows it."""

    birth: Birth
    rank: int
    city: CityMap


@dataclass(frozen=True)
class Facts:
    """A run, as far as its report tells of it; made from an open `Run`."""

    run: Run

    @cached_property
    def told(self) -> Told:
        """All births up to the last whole generation, as columns; what was wanted. Raises
        `RunError` if there is no generation."""
        return Told(self.run)

    @property
    def sought(self) -> list[Aim]:
        """Those of the aims that are more than a constraint."""
        return [aim for aim in self.told.aims if aim.sought]

    @cached_property
    def recipe(self) -> dict:
        """The recipe as plain values; empty if its text cannot be read."""
        return recipe_of(self.run)

    @property
    def title(self) -> str:
        """The folder's name: a recipe may have been carried out many times."""
        return self.run.path.resolve().name

    @property
    def planned(self) -> int | None:
        """Generations to be bred after the first population; None if the recipe is unreadable."""
        section = self.recipe.get("run", {})
        stated = section.get("generations") if isinstance(section, dict) else None
        if stated is None and self.recipe:
            from evocity.search.sections import RunSection  # which few need, and takes long

            stated = RunSection.model_fields["generations"].default
        known = self.overrides.get("run.generations", stated)
        whole = isinstance(known, int) and not isinstance(known, bool)
        return known if whole and 0 <= known <= _MOST_GENERATIONS else None

    @property
    def overrides(self) -> dict:
        """What replaced the recipe's values, as {"run.seed": 8}."""
        return overrides_of(self.run)

    @property
    def times(self) -> list[tuple[str, str]]:
        """(event, moment in UTC, to the second) of starts, resumes, stops and ends, in order."""
        events = [e for e in self.run.events() if e.get("event") in TURNS]
        return [(e["event"], str(e.get("time"))[:19].replace("T", " ")) for e in events]

    @cached_property
    def sources(self) -> list[Source]:
        """The parents. Raises `RunError` if there is none."""
        sources = self.told.sources
        if not sources:
            raise RunError(
                f"{self.run.path / 'sources'} holds no city",
                "the source cities, as `evocity run` wrote them",
                "bring the folder back from a copy, or start the run again",
            )
        return sources

    @cached_property
    def broken(self) -> set[int]:
        """Ids of those of the last generation that break a constraint."""
        ids = np.array([row["id"] for row in self.members], np.int64)
        return set(ids[~self.told.feasible[self.told.rows(ids)]].tolist())

    @cached_property
    def lived(self) -> list[dict]:
        """The last generation: slot, id, rank, as their algorithms have them; of a run with islands
        ``island`` too, on which they live."""
        columns = ["slot", "id", "rank", *(["island"] if self.run.header.islands else [])]
        return self.run.members(self.told.last).select(columns).to_pylist()

    @cached_property
    def members(self) -> list[dict]:
        """The last generation: slot, id, rank; best first, as its algorithm has them. Of a run with
        islands each individual once, ranked by all goals together."""
        pairs = zip(*(one.tolist() for one in self.told.ranked()), strict=True)
        return [{"slot": n, "id": one, "rank": rank} for n, (one, rank) in enumerate(pairs)]

    @property
    def front(self) -> list[int]:
        """Ids of the last front."""
        return [row["id"] for row in self.members if row["rank"] == 0]

    @cached_property
    def source_births(self) -> list[Birth]:
        """The births of the source cities themselves, in their order: what their codes have;
        without genomes."""
        places = [place for place, name in enumerate(self.run.header.cities) if name != VOID]
        ids = set(places[: self.run.header.population])
        births = births_without_genomes(self.run, 0)
        return [birth for birth in births if birth.operator == "source" and birth.id in ids]

    @property
    def apart(self) -> float:
        """In how large a share of the map two individuals differ at least that do not look alike:
        what the recipe's search asks for."""
        section = self.recipe.get("search")
        stated = number_of(section.get("apart")) if isinstance(section, dict) else None
        return _APART if stated is None or not 0 <= stated <= 1 else stated

    @cached_property
    def shown(self) -> list[Shown]:
        """The last generation's individuals, at most `MOST_SHOWN`, the front first."""
        return self._shown(self.members[:MOST_SHOWN])

    @cached_property
    def look_alikes(self) -> set[int]:
        """Ids of those of `shown` that look like one shown before them."""
        looks = np.array([look_of(one.city) for one in self.shown])
        first: list[int] = []
        for place, look in enumerate(looks):
            if not alike(look, looks[first], self.apart):
                first.append(place)
        return {one.birth.id for n, one in enumerate(self.shown) if n not in first}

    @cached_property
    def archive(self) -> Archive | None:
        """What no other birth ever dominated, or the best of each cell; None if the run does not
        tell what it wanted."""
        try:
            aims_of_run(self.run)
            grid_of_run(self.run)
        except RunError:
            return None
        return archive(self.run, self.told.last)

    @cached_property
    def grids(self) -> dict[str | None, Binned]:
        """The best of each cell of the grid that the run fills, or that islands of it do, by their
        names; those alone whose run tells what it wanted."""
        found = {}
        for island in self.run.header.islands or (None,):
            try:
                grid = grid_of_run(self.run, island)
                goal = None if island is None else self.told.quality_on(island)
                if grid is not None:
                    found[island] = binned(self.run, grid, self.told.last, goal)
            except RunError:
                continue
        return found

    @property
    def binned(self) -> Binned | None:
        """The best of each cell of the grid that the run as a whole fills; None if it fills none,
        or does not tell what it wanted."""
        return self.grids.get(None)

    @cached_property
    def gone(self) -> list[int]:
        """Ids of those of the archive that no longer live, the wide apart first."""
        rows = [] if self.archive is None else self.archive.births.to_pylist()
        dead = [row for row in rows if not row["alive"]]
        return [
            row["id"] for row in sorted(dead, key=lambda row: (-row.get("crowding", 0), row["id"]))
        ]

    @cached_property
    def shown_gone(self) -> list[Shown]:
        """The archive's individuals that no longer live, at most `MOST_SHOWN`."""
        return self._shown([{"id": one, "rank": 0} for one in self.gone[:MOST_SHOWN]])

    @cached_property
    def carded(self) -> frozenset[int]:
        """Ids of those that have a card in a gallery of the page."""
        return frozenset(one.birth.id for one in [*self.shown, *self.shown_gone])

    def best(self, count: int) -> list[Shown]:
        """Of the last generation the best by each measure sought in turn, ``count`` in all. Of
        those that look alike, the first stands for all while there are others to show."""
        rows = {row["id"]: row for row in self.members}
        places = self.told.rows(list(rows))
        keeps = dict(zip(rows, self.told.feasible[places].tolist(), strict=True))
        by_aim = []
        for aim in self.sought:
            losses = aim.losses(self.told.value(aim.name)[places]).tolist()
            loss = dict(zip(rows, losses, strict=True))
            by_aim.append(sorted(rows, key=lambda one, loss=loss: (not keeps[one], loss[one], one)))
        best = list(
            dict.fromkeys(one for together in zip(*by_aim, strict=True) for one in together)
        )
        births = self.run.individuals(best[:MOST_SHOWN])
        first = self.differing([self.city(birth) for birth in births], count)
        return self._shown([rows[best[place]] for place in first])

    def differing(self, cities: Sequence[CityMap], count: int) -> list[int]:
        """Which ``count`` of the ``cities``, given best first, to show, in their order: those that
        differ pairwise first, then the best of the others."""
        looks = [look_of(city) for city in cities]
        return sorted(distinct_first(looks, self.apart, count)[:count].tolist()) if looks else []

    def individuals(self, ids: Sequence[int]) -> list[Birth]:
        """The births with these ``ids``, with genomes. The log is read once for all that a report
        shows."""
        missing = [one for one in ids if one not in self._read]
        if missing:
            shown = [row["id"] for row in self.members[:MOST_SHOWN]] + self.gone[:MOST_SHOWN]
            births = self.run.individuals(list(dict.fromkeys([*missing, *shown])))
            self._read.update((birth.id, birth) for birth in births)
        return [self._read[one] for one in ids]

    @cached_property
    def _read(self) -> dict[int, Birth]:
        return {}

    def _shown(self, rows: Sequence[dict]) -> list[Shown]:
        births = self.individuals([row["id"] for row in rows])
        return [
            Shown(birth, row["rank"], self.city(birth))
            for row, birth in zip(rows, births, strict=True)
        ]

    def unlogged(self, births: Sequence[Birth]) -> dict[int, list[tuple[str, float, str]]]:
        """By id what ``births`` have of all measures that the run did not log, as (name, value,
        unit); NaN where one has no value. It takes longer than all else in a report: ask it of
        few."""
        sources = [source.city for source in self.sources]
        reference = fitness.Reference.sources(sources)
        others = [
            measure.bound(reference)
            for measure in fitness.measures()
            if measure.name not in self.run.header.columns
        ]
        parents = [None] * len(births)
        if any("parents" in measure.takes for measure in others):  # they are read from the log
            parents = self.run.parents(births)
        found = {}
        for birth, bred_of in zip(births, parents, strict=True):
            city, given = self.city(birth), {"parents": bred_of, "sources": sources}
            given["genome"] = birth.genome
            found[birth.id] = [(m.name, _measured(m, city, given), m.unit) for m in others]
        return found

    @cached_property
    def kept_few(self) -> Keeping:
        """Those of the archive that are worth keeping, at most `MOST_KEPT`; none where there is no
        archive. Those that look like one before them are left out."""
        if self.archive is None or not len(self.archive):
            return Keeping()
        likeness = Likeness(self.told)
        for one in [*self.shown, *self.shown_gone]:
            likeness.note(one.birth.id, one.city)
        kept = kept_of(self.told, self.archive.ids, likeness, MOST_KEPT)
        births = self.individuals([one.individual.id for one in kept])
        for one, birth in zip(kept, births, strict=True):
            one.individual.is_known(birth, self.city(birth))
        return kept

    @cached_property
    def _cities(self) -> dict[int, CityMap]:
        return {}

    def city(self, birth: Birth) -> CityMap:
        """The decoded map of a birth, decoded once. Raises `RunError` if it has none."""
        if birth.id not in self._cities:
            self._cities[birth.id] = self.decoded(birth)
        return self._cities[birth.id]

    def decoded(self, birth: Birth) -> CityMap:
        """As `city`, and not kept: for many."""
        expressed = self.told.expressed(birth)
        if expressed.city is None:
            raise RunError(
                f"individual {birth.id}: {expressed.problem}",
                "individuals that stand for a map, as when they were evaluated",
                "the run's files are damaged: see what is left with evocity status",
            )
        return expressed.city


def figures_told(figures: Mapping[str, float]) -> list[tuple[str, str]]:
    """What an algorithm tells of all the living, for people: "qd score" and its value."""
    return [
        ("".join(filter(str.isprintable, name)).replace("_", " "), f"{value:.4g}")
        for name, value in figures.items()
    ]


def _measured(measure, city: CityMap, extras: Mapping) -> float:
    try:
        return measure(city, **extras)
    except EvocityError:  # not the run's measure: a report does not fail for it
        return math.nan
