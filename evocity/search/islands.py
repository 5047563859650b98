"""What a recipe says of islands: populations by their own operators, goals or algorithms.

`evocity.search.archipelago` breeds them.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from evocity.errors import shown, with_near_miss
from evocity.fitness import Aims, Measure
from evocity.search.algorithms import algorithms
from evocity.search.mixture import OperatorEntry, entry_of
from evocity.search.searching import SearchSection, some_algorithm
from evocity.search.sections import RunSection
from evocity.search.values import Section, Title

#: A fault: key, what was found, what is allowed.
Fault = tuple[str, str, str]
#: Islands of one search, at most.
MOST_ISLANDS = 256
# Who lives on an island, at least.
_FEWEST = RunSection.model_fields["population"].metadata[0].ge


class IslandSection(BaseModel):
    """``[[islands]]``: a population of its own.

    ``population``: births of each generation, and the most that live; ``operators``: the mixture,
    where what an entry leaves out is that of ``[operators]``; ``measures``: what is sought here of
    the recipe's goals, all unless they are told; ``weights``: of measures in a sum; ``algorithm``
    and its keys: those of ``[search]`` unless they are told.
    """

    model_config = ConfigDict(extra="allow", frozen=True, strict=True)

    name: Title | None = None
    population: int | None = Field(None, ge=_FEWEST, le=1_000_000)
    operators: dict[str, Annotated[OperatorEntry, BeforeValidator(entry_of)]] | None = Field(
        None, min_length=1
    )
    measures: list[str] | None = Field(None, min_length=1)
    weights: dict[str, Annotated[float, Field(gt=0, le=1e9, allow_inf_nan=False)]] | None = None
    algorithm: Annotated[str, AfterValidator(some_algorithm)] | None = None

    def search_of(self, search: SearchSection) -> SearchSection:
        """How this island selects, in a recipe with this ``search``."""
        own = dict(self.model_extra or {})
        if self.algorithm in (None, search.algorithm):
            own = (search.model_extra or {}) | own
        shared = {"picks": search.picks, "adapt": search.adapt}
        return SearchSection(**own | shared | {"algorithm": self.algorithm or search.algorithm})

    def operators_of(self, operators: Mapping[str, OperatorEntry]) -> dict[str, OperatorEntry]:
        """The mixture of this island, in a recipe with these ``operators``."""
        if self.operators is None:
            return dict(operators)
        return {
            name: OperatorEntry(
                **(_told(operators[name]) if name in operators else {}) | _told(entry)
            )
            for name, entry in self.operators.items()
        }

    def aims_of(self, aims: Aims) -> Aims:
        """What is wanted on this island, of a run with these ``aims``: its goals, by its weights,
        and all constraints."""
        if self.measures is not None:
            narrowed = (
                one
                if one.objective is None or {one.measure.name, one.total} & set(self.measures)
                else replace(one, objective=None, total=None)
                for one in aims.wanted
            )
            kept = (one for one in narrowed if one.objective or one.constraint)
            aims = Aims(tuple(kept))
        return aims.reweighted(self.weights or {})


def _told(entry: OperatorEntry) -> dict[str, Any]:
    return entry.model_dump(exclude_unset=True)


class MigrationSection(Section):
    """``[migration]``: in every so many generations each island's best, so many ``migrants``, may
    live on its neighbours too: on the next island (``ring``), or on all others (``complete``)."""

    along: Literal["ring", "complete", "none"] = "ring"
    every: int = Field(10, ge=1, le=99_999_999)
    migrants: int = Field(2, ge=1, le=1_000_000)

    def neighbours(self, count: int) -> list[tuple[int, int]]:
        """(giver, taker) of so many islands, by their numbers."""
        pairs = [(one, (one + turn) % count) for one in range(count) for turn in range(1, count)]
        kept = {"ring": pairs[:: max(1, count - 1)], "complete": pairs, "none": []}
        return kept[self.along]


# -- a recipe as it is read --------------------------------------------------------------------


def islands_in(raw: Mapping) -> list[dict]:
    """The tables of ``[[islands]]``, if they are well-formed; none if not."""
    islands = raw.get("islands")
    sound = isinstance(islands, list) and all(isinstance(one, dict) for one in islands)
    return islands if sound else []


def fill_islands(raw: dict, noted: list[Mapping] | None = None) -> list[Fault]:
    """Write into ``raw`` what its islands leave out: names, and how many live, which ``[run]``
    tells of all together. ``noted``: of a run that is taken up again, what each was. Returns faults
    of these numbers."""
    islands = islands_in(raw)
    for number, one in enumerate(islands):
        for key, value in (noted[number] if noted and number < len(noted) else {}).items():
            one.setdefault(key, value)
        one.setdefault("name", f"island-{number + 1}")
    run = raw.setdefault("run", {}) if islands else None
    told = [one["population"] for one in islands if "population" in one]
    if not isinstance(run, dict) or not all(map(_whole, told)):
        return []
    left = [one for one in islands if "population" not in one]
    if not left:
        stated = run.setdefault("population", sum(told))
        if not _whole(stated) or stated == sum(told):
            return []
        allowed = f"{sum(told)}, which live on the islands together; or leave it out"
        return [("run.population", shown(stated), allowed)]
    whole = run.get("population", RunSection.model_fields["population"].default)
    if not _whole(whole):
        return []
    rest = whole - sum(told)
    for number, one in enumerate(left):
        one["population"] = max(_FEWEST, rest // len(left) + (number < rest % len(left)))
    if rest >= _FEWEST * len(left):
        return []
    least, found = sum(told) + _FEWEST * len(left), f"{whole} on {len(islands)} islands"
    return [("run.population", found, f"{least} or more, {_FEWEST} on each that tells no other")]


def merged_operators(raw: Mapping, usual: Mapping[str, Any]) -> list[tuple[str, dict]]:
    """(key, entries) of the mixtures that islands of their own have, whole; ``usual``: those of a
    recipe without ``[operators]``."""
    base = raw.get("operators", usual)
    base = base if isinstance(base, dict) else {}

    def table(value: Any) -> Any:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return {"weight": value} if number else value

    found = []
    for number, island in enumerate(islands_in(raw)):
        entries = island.get("operators")
        if not isinstance(entries, dict):
            continue
        whole = {}
        for name, value in entries.items():
            below, above = table(base.get(name, {})), table(value)
            both = isinstance(below, dict) and isinstance(above, dict)
            whole[name] = below | above if both else value
        found.append((f"islands[{number}].", whole))
    return found


def keys_of_islands(raw: Mapping, default: str) -> list[tuple[int, str, dict[str, Any]]]:
    """Of each island whose algorithm is known: its number, the algorithm, and what it is given of
    that one's own keys; ``default``: the algorithm of a recipe that names none."""
    search = raw.get("search", {})
    search = search if isinstance(search, dict) else {}
    common, found = set(SearchSection.model_fields), []
    for number, island in enumerate(islands_in(raw)):
        usual = search.get("algorithm", default)
        name = island.get("algorithm", usual)
        if not isinstance(name, str) or name not in algorithms():
            continue
        own = {key: one for key, one in island.items() if key not in IslandSection.model_fields}
        if name == usual:
            own = {key: one for key, one in search.items() if key not in common} | own
        found.append((number, name, own))
    return found


def on_island(key: str, number: int) -> str:
    """The ``key`` of a fault of ``[search]``, where it is an island's."""
    return key.replace("search.", f"islands[{number}].", 1) if key.startswith("search.") else key


def faults_of_islands(recipe: Any) -> list[Fault]:
    """Faults of the islands, and of migration, of a `Recipe` that is sound by itself."""
    islands, faults = recipe.islands, []
    if not islands:
        if recipe.migration.model_fields_set:
            faults.append(("migration", "without islands", "[[islands]], two or more"))
        return faults
    names = [one.name for one in islands]
    for number, name in enumerate(names):
        if name in names[:number]:
            faults.append((f"islands[{number}].name", f"{shown(name)} twice", "another name"))
    sizes = [one.population for one in islands]
    if recipe.migration.along != "none" and recipe.migration.migrants > min(sizes):
        smallest = names[sizes.index(min(sizes))]
        allowed = f"{min(sizes)} or fewer, who live on {shown(smallest)}, the smallest island"
        faults.append(("migration.migrants", str(recipe.migration.migrants), allowed))
    if recipe.search.window is not None:
        found = f"{recipe.search.window}, with {len(islands)} islands"
        faults.append(("search.window", found, "no window: islands breed whole generations"))
    if _unentered(recipe.search.algorithm):
        faults.append(_nobody_enters("search.algorithm", recipe.search.algorithm))
    goals = _goals(recipe)
    for number, (island, own) in enumerate(zip(islands, recipe.local, strict=True)):
        key = f"islands[{number}]"
        faults += _measure_faults(island, key, goals)
        if island.algorithm is not None and _unentered(island.algorithm):
            faults.append(_nobody_enters(f"{key}.algorithm", island.algorithm))
        sought = {total or one.name for one, total in goals if _sought(island, one, total)}
        told = own.search.faults(len(sought), island.population, len(recipe.parents))
        faults += [(on_island(place, number), *rest) for place, *rest in told]
    return faults


def _goals(recipe: Any) -> list[tuple[Measure, str | None]]:
    """What is sought, each measure with the sum that it counts in."""
    return [
        (measure, entry.total)
        for entry in recipe.fitness
        if entry.is_objective
        for measure in entry.measures
    ]


def _sought(island: IslandSection, measure: Measure, total: str | None) -> bool:
    return island.measures is None or bool({measure.name, total} & set(island.measures))


def _measure_faults(
    island: IslandSection, key: str, goals: list[tuple[Measure, str | None]]
) -> list[Fault]:
    known = list(dict.fromkeys([*(m.name for m, _ in goals), *(t for _, t in goals if t)]))
    faults = [
        (
            f"{key}.measures",
            with_near_miss(f"{shown(name)}, which is no goal of the recipe", name, known),
            f"some of its goals: {', '.join(known)}",
        )
        for name in dict.fromkeys(island.measures or ())
        if name not in known
    ]
    for name in dict.fromkeys(island.measures or ()):
        if island.measures.count(name) > 1:
            faults.append((f"{key}.measures", f"{shown(name)} twice", "each goal once"))
    summed = [m.name for m, total in goals if total is not None and _sought(island, m, total)]
    for name in island.weights or {}:
        if name not in summed:
            found = with_near_miss(f"{shown(name)}, which counts in no sum here", name, summed)
            allowed = ", ".join(summed) or "none: no measure that is sought here is part of a sum"
            faults.append((f"{key}.weights", found, allowed))
    return faults


def _unentered(algorithm: str) -> bool:
    """Whether nobody from elsewhere can live by an ``algorithm``: it breeds by itself, or hangs on
    the whole run."""
    kind = algorithms()[algorithm]
    return kind.breeds_by is not None or kind.replays


def _nobody_enters(key: str, algorithm: str) -> Fault:
    others = [name for name in algorithms() if not _unentered(name)]
    found = f"{shown(algorithm)}, which breeds by itself: nobody from another island can live by it"
    return key, found, f"with islands {' or '.join(map(shown, others))}"


def _whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


__all__ = [
    "MOST_ISLANDS",
    "Fault",
    "IslandSection",
    "MigrationSection",
    "faults_of_islands",
    "fill_islands",
    "islands_in",
    "keys_of_islands",
    "merged_operators",
    "on_island",
]
